"""A kind of surface of one's own, in one file: radial basis functions through all runs."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.json_codec import to_json
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.kinds import Form, Kind, ModelFit
from rsmkit.surfaces.models.surface import check_confidence
from rsmkit.surfaces.reading import FactorForm, read_form, read_space, write_space


@dataclass(frozen=True, eq=False)
class RadialSurface:
    """``sum_i w_i |z - z_i|^3 + b0 + z'b`` with z the coded factors, through every run (Duchon 1977)."""

    form: ClassVar[str] = "radial"

    space: object
    response: str
    data: FitData

    @cached_property
    def runs(self):
        return self.space.encode(self.data.points)

    @cached_property
    def weights(self):
        n, k = self.runs.shape
        powers = np.column_stack([np.ones(n), self.runs])
        matrix = np.block(
            [[distances(self.runs, self.runs) ** 3, powers], [powers.T, np.zeros((k + 1, k + 1))]]
        )
        return np.linalg.lstsq(matrix, np.r_[self.data.y, np.zeros(k + 1)], rcond=None)[0]

    @cached_property
    def errors(self):
        """At each run, predicted from the others; shape (n,)."""
        everyone = np.arange(len(self.data))
        without = [RadialSurface(self.space, self.response, self.data.without(i)) for i in everyone]
        points = self.data.points
        return self.data.y - [s.predict(points[i : i + 1])[0] for i, s in enumerate(without)]

    def predict(self, points, interval=None, kind="prediction"):
        x = np.asarray(points, float)
        if x.ndim != 2 or x.shape[1] != len(self.space):
            raise RsmkitError(f"points of {self.response} need shape (n, {len(self.space)}), got {x.shape}")
        z, n = self.space.encode(x), len(self.data)
        mean = distances(z, self.runs) ** 3 @ self.weights[:n] + self.weights[n] + z @ self.weights[n + 1 :]
        if interval is None:
            return mean
        check_confidence(interval)
        half = np.quantile(np.abs(self.errors), interval)
        return mean, mean - half, mean + half

    def gradient(self, points):
        z, n = self.space.encode(np.asarray(points, float)), len(self.data)
        away = z[:, None, :] - self.runs
        slopes = np.einsum("mn,mnk,n->mk", 3.0 * distances(z, self.runs), away, self.weights[:n])
        by_natural = 2.0 / (self.space.highs - self.space.lows)
        return np.where(self.space.numeric, (slopes + self.weights[n + 1 :]) * by_natural, 0.0)

    def to_json(self):
        return to_json(RadialForm(self.form, self.response, write_space(self.space), self.data))


@dataclass(frozen=True)
class RadialForm:
    """How it stands in ``model.json``."""

    model: str
    response: str
    factors: tuple[FactorForm, ...]
    runs: FitData


def distances(a, b):
    return np.linalg.norm(a[:, None, :] - b, axis=2)


def read(document):
    form = read_form(RadialForm, document)
    space = read_space(form.factors)
    return RadialSurface(space, form.response, form.runs.checked(space))


def report(surface):
    error = float(np.sqrt(np.mean(surface.errors**2)))
    return {"response": surface.response, "model": surface.form, "runs": len(surface.data), "rmse_loo": error}


def summary(surface, report):
    return f"{surface.response}: radial basis functions, leave-one-out error {report['rmse_loo']:.4g}"


def fit(request):
    surface = RadialSurface(request.space, request.response, request.data)
    return ModelFit(surface, float(surface.errors @ surface.errors), "through every run")


ROW = Kind("a radial basis function at each run", fit, "radial", lambda: Form(read, report, summary))
