"""One quantity that the simulator gives, learnt from all runs: over the whole space, and around a point."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfcx, log_ndtr, ndtr

from rsmkit.language.space import Floats
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.local_polynomial import fit_local_polynomial, monomials
from rsmkit.verification.refinement.models.processes import (
    EXACT,
    NOISY,
    Competition,
    Form,
    Process,
    all_forms,
    fit_process,
)
from rsmkit.verification.refinement.models.sparse_polynomial import SparsePolynomial, fit_sparse_polynomial

__all__ = ["Constant", "Learner", "Model", "Ranked", "log_expected_improvement"]

SQRT_2PI = float(np.sqrt(2.0 * np.pi))

NEAREST = 70
STRETCH = 1.25
"""Half-widths within which runs judge a local model."""
REACH = 1.6
"""Half-widths at which runs lose their weight for a polynomial."""


class Model(Protocol):
    """Something that predicts."""

    @property
    def name(self) -> str:
        """In words."""
        ...

    def mean(self, unit: Floats) -> Floats:
        """Predict, shape (q,)."""
        ...

    def gradient(self, unit: Floats) -> Floats:
        """Derivatives by the coordinates, shape (q, k)."""
        ...


@dataclass(frozen=True)
class Ranked:
    """A model and how large its leave-one-out errors are in the region, in its own units."""

    model: Model
    error: float


@dataclass(frozen=True)
class Constant:
    """What is known of a quantity that does not vary."""

    value: float
    name: str = "constant"

    def mean(self, unit: Floats) -> Floats:
        """Predict, shape (q,)."""
        return np.full(len(unit), self.value)

    def gradient(self, unit: Floats) -> Floats:
        """Zero."""
        return np.zeros_like(unit)


@dataclass
class Learner:
    """Models of one quantity.

    Parameters
    ----------
    cube : Cube
        Coordinates.
    margin : bool
        A constraint margin: processes see its asinh, which keeps sign and zero and tames singular ones.
    warped : bool
        Whether processes of the logarithm compete.
    noisy : bool
        Whether the simulator does not repeat itself.
    """

    cube: Cube
    margin: bool = False
    warped: bool = False
    noisy: bool = False
    processes: list[Process] = field(default_factory=list)
    sparse: SparsePolynomial | None = None

    def __post_init__(self) -> None:
        nested = len(self.cube) > 1
        forms = all_forms(warped=self.warped and not self.noisy, nested=nested)
        if self.margin:
            forms = [form for form in forms if not form.nested or form.kernel == "rbf"]
        self._nugget = NOISY if self.noisy else EXACT
        self._competition = Competition(forms, self.cube.categorical, self._nugget)
        self._levels = tuple(f.domain.categories for f in self.cube.space)

    def learn(self, unit: Floats, y: Floats) -> None:
        """Fit everything that holds over the whole space to the runs that succeeded, (n, k) and (n,)."""
        self._unit, self._y = unit, y
        self._scale = float(np.median(np.abs(y))) or float(np.abs(y).max()) or 1.0
        self.values = np.arcsinh(3.0 * y / self._scale) if self.margin else y
        spread = float(np.median(y) - y.min())
        categorical = self.cube.categorical
        self.sparse = None if self.noisy else fit_sparse_polynomial(unit, y, categorical, self._levels)
        known = self.exact is not None
        self.processes = [] if known else self._competition.fit(unit, self.values, spread)

    @property
    def spread(self) -> float:
        """Standard deviation over the runs, own units."""
        return float(self._y.std())

    @property
    def noise_sd(self) -> float:
        """Standard deviation of the noise of one run as the likeliest process has it; 0 without one."""
        return self.processes[0].noise_sd if self.noisy and self.processes else 0.0

    @property
    def exact(self) -> SparsePolynomial | None:
        """The polynomial that the quantity seems to be, if any."""
        return self.sparse if self.sparse is not None and self.sparse.exact else None

    def global_models(self) -> list[Model]:
        """What describes it over the whole space, the likeliest first."""
        if self.exact is not None:
            return [self.exact]
        return list(self.processes) or [Constant(float(self.values.mean()))]

    def normal(self, unit: Floats) -> tuple[Floats, Floats]:
        """Mean and standard deviation, without noise; of a margin those of its asinh, (q,) each."""
        exact = self.exact
        if exact is not None:
            mean, error = exact.mean(unit), float(np.sqrt(np.mean(exact.residuals**2)))
            sd = np.full(len(unit), error + 1e-12 * self.spread)
            if not self.margin:
                return mean, sd
            slope = 3.0 / self._scale / np.sqrt(1.0 + (3.0 * mean / self._scale) ** 2)
            return np.asarray(np.arcsinh(3.0 * mean / self._scale)), np.asarray(slope * sd)
        if not self.processes:
            return np.full(len(unit), float(self.values.mean())), np.full(len(unit), 1e-12)
        best = self._unwarped or self.processes[0]
        mean, sd = best.normal(unit)
        return best.scale.back(mean), np.asarray(best.scale.size * sd)

    def log_improvement(self, unit: Floats, best: float, boldness: float = 1.0) -> Floats:
        """Logarithm of the expected improvement on `best`, shape (q,); first order in a logarithm's units.

        Standard deviations are taken to be `boldness` times as large as the model says.
        """
        if self.exact is None and self.processes and self.processes[0].form.warped:
            process = self.processes[0]
            mean, sd = process.normal(unit)
            target = process.scale.forward(np.array([best]))
            unit_size = float(process.scale.slope(target)[0])
            return np.asarray(
                log_expected_improvement(mean, boldness * sd, float(target[0])) + np.log(unit_size)
            )
        mean, sd = self.normal(unit)
        return log_expected_improvement(mean, boldness * sd, best)

    def samples(self, unit: Floats, count: int, rng: np.random.Generator, boldness: float = 1.0) -> Floats:
        """Draw the quantity (of a margin its asinh) at all points jointly, shape (count, q).

        Deviations from the mean are `boldness` times as large as the model says, and at least as large as
        leave-one-out errors are.
        """
        if self.exact is not None or not self.processes:
            mean, sd = self.normal(unit)
            return np.asarray(mean + sd * rng.standard_normal((count, 1)))
        best = self.processes[0]
        covariance = best.covariance(unit, boldness)
        return np.asarray(best.scale.back(best.kriging.samples(unit, count, rng, covariance)))

    def log_chance(self, unit: Floats) -> Floats:
        """Logarithm of the probability that a margin is satisfied, shape (q,)."""
        mean, sd = self.normal(unit)
        return np.asarray(log_ndtr(mean / np.maximum(sd, 1e-12)))

    def believing(self, unit: Floats) -> Learner:
        """The same after runs at points whose values were as predicted, shape (q, k)."""
        if not self.processes:
            return self
        told = replace(self)
        told.__dict__.update(self.__dict__)
        told.processes = [_believe(one, unit) for one in self.processes[:2]]
        return told

    @property
    def _unwarped(self) -> Process | None:
        return next((one for one in self.processes if not one.form.warped), None)

    # ------------------------------------------------------------------ around a point

    def ranked(self, center: Floats, half_width: float) -> list[Ranked]:
        """Models of the region around a point, shape (k,), by leave-one-out error there."""
        unit, y, values = self._unit, self._y, self.values
        distance = self.cube.apart(unit, center[None])[:, 0]
        inside = distance <= STRETCH * half_width
        entries: list[tuple[float, float, Model]] = []

        def enter(model: Model, residuals: Floats, rows: NDArray[np.intp], *, raw: bool) -> None:
            """Judge by the runs of the region, a margin in the units of its asinh."""
            judged = inside[rows]
            if not judged.any():
                return
            errors = residuals[judged]
            own = float(np.sqrt(np.mean(errors**2)))
            score = own
            if raw and self.margin:
                slope = 3.0 / self._scale / np.sqrt(1.0 + (3.0 * y[rows][judged] / self._scale) ** 2)
                score = float(np.sqrt(np.mean((slope * errors) ** 2)))
            entries.append((score, own, model))

        everything = np.arange(len(y))
        for process in self.processes[:2]:
            enter(process, process.residuals, everything, raw=False)
        if self.sparse is not None:
            doubt = 0.0 if self.sparse.exact else self.sparse.optimism
            enter(self.sparse, doubt * self._sparse_errors, everything, raw=True)
        same = np.flatnonzero(np.isfinite(distance))
        if half_width < 1:
            for zoomed, rows in self._local_processes(center, half_width, distance):
                enter(zoomed, zoomed.residuals, rows, raw=False)
        for order, name in (
            ((2, "quadratic"), (3, "cubic")) if not self._many else ((0, "squares"), (1, "plane"))
        ):
            exponents = monomials(~self.cube.categorical, order)
            if order == 2 and inside.sum() <= len(exponents):
                continue
            weights = _weights(distance[same], half_width)
            model = fit_local_polynomial(name, exponents, unit[same], y[same], center, weights)
            if model is not None:
                enter(model, model.residuals, same, raw=True)
        entries.sort(key=lambda entry: entry[0])
        found = [Ranked(model, own) for _, own, model in entries]
        return found or [Ranked(Constant(float(values.mean())), 0.0)]

    @property
    def _many(self) -> bool:
        """Whether a full quadratic is out of reach."""
        k = int((~self.cube.categorical).sum())
        return (k + 1) * (k + 2) // 2 > len(self._y)

    @property
    def _sparse_errors(self) -> Floats:
        assert self.sparse is not None
        found = self.sparse.residuals
        return found if len(found) == len(self._y) else self._y - self.sparse.mean(self._unit)

    def _local_processes(
        self, center: Floats, half_width: float, distance: Floats
    ) -> list[tuple[_Zoomed, NDArray[np.intp]]]:
        k = len(self.cube)
        same = np.isfinite(distance)
        count = min(NEAREST, max(4 * k + 8, 20, int((distance <= 3 * half_width).sum())), int(same.sum()))
        if count < 4:
            return []
        rows = np.argsort(distance, kind="stable")[:count]
        origin = self._unit[rows].min(axis=0)
        extent = np.ptp(self._unit[rows], axis=0)
        extent[(extent == 0) | self.cube.categorical] = 1.0
        found = []
        for kernel in ("rbf", "matern52"):
            process = fit_process(
                Form(kernel),
                (self._unit[rows] - origin) / extent,
                self.values[rows],
                self.cube.categorical,
                nugget=self._nugget,
            )
            if process is not None:
                found.append((_Zoomed(process, origin, extent), rows))
        return found


@dataclass(frozen=True, eq=False)
class _Zoomed:
    """A process in coordinates of a part of the cube."""

    process: Process
    origin: Floats
    extent: Floats

    @property
    def name(self) -> str:
        return f"local {self.process.name}"

    @property
    def residuals(self) -> Floats:
        return self.process.residuals

    def mean(self, unit: Floats) -> Floats:
        return self.process.mean((unit - self.origin) / self.extent)

    def gradient(self, unit: Floats) -> Floats:
        return self.process.gradient((unit - self.origin) / self.extent) / self.extent


def log_expected_improvement(mean: Floats, sd: Floats, best: float) -> Floats:
    """Logarithm of E max(0, best - N(mean, sd)), accurate far in the tail (Ament et al., NeurIPS 2023)."""
    sd = np.maximum(sd, 1e-300)
    z = (best - mean) / sd
    with np.errstate(all="ignore"):
        near = np.log(np.exp(-0.5 * z * z) / SQRT_2PI + z * ndtr(z))
        tail = np.log(np.maximum(erfcx(-z / np.sqrt(2.0)) * np.abs(z) * np.sqrt(np.pi / 2.0), 1e-300))
        far = -0.5 * z * z - np.log(SQRT_2PI) + np.log(-np.expm1(np.minimum(tail, -1e-300)))
        farther = -0.5 * z * z - np.log(SQRT_2PI) - 2.0 * np.log(np.abs(z))
    return np.asarray(np.where(z > -1.0, near, np.where(z > -1e4, far, farther)) + np.log(sd))


def _believe(process: Process, unit: Floats) -> Process:
    kriging = process.kriging
    told = kriging.extended(unit, kriging.predict(unit))
    return replace(process, kriging=told)


def _weights(distance: Floats, half_width: float) -> Floats:
    if half_width >= 1:
        return np.ones(len(distance))
    floor = 0.001 if half_width < 0.02 else 0.05
    return np.asarray(np.maximum(1.0 - (distance / (REACH * half_width)) ** 3, floor))
