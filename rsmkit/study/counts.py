"""Responses that are counts: trials or exposure of each run, and runs as shares and rates.

Surfaces of counts predict a probability or a rate per unit of exposure. So everything that compares runs with
surfaces takes the runs by :func:`as_rates`; only the fit itself takes the counts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, cast

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Floats
from rsmkit.runs.record.run import Run
from rsmkit.runs.record.run_table import Runs
from rsmkit.study.file import ResponseOptions, Study

if TYPE_CHECKING:  # these load scipy, which a look at a small file does not need
    from rsmkit.surfaces.fitted_response import FittedResponse
    from rsmkit.surfaces.models.glm import GlmSurface
    from rsmkit.surfaces.models.surface import IntervalKind, Surface

__all__ = [
    "CountedRuns",
    "as_rates",
    "counted_predictors",
    "rate_of",
    "run_sizes",
    "single_trials",
    "sizes_named",
    "sizes_taken",
]


def rate_of(study: Study, name: str, run: Run) -> float:
    """Share or rate of one run; the number as it is for a response that is no count, nan where there is none.

    Raises
    ------
    RsmkitError
        Naming the run whose count, trials or exposure cannot be.
    """
    if name in study.failures:
        return float(not run.done)
    value = run.value(name)
    if name not in study.counts or not math.isfinite(value):
        return value
    return value / _size(study.counts[name], name, run)


def as_rates(study: Study, runs: Runs) -> Runs:
    """The same runs with a share, or a rate, in place of every count, and whether they failed.

    Raises
    ------
    RsmkitError
        Naming the first run whose count, trials or exposure cannot be.
    """
    if not study.counts:
        return runs

    def turned(run: Run | None) -> Run | None:
        if run is None:
            return run
        state = run.state(runs.responses)
        if state == "failed":
            return replace(run, responses={**run.responses, **dict.fromkeys(study.failures, 1.0)})
        if state not in ("done", "partial"):
            return run
        rates = {name: rate_of(study, name, run) for name in study.counts}
        known = {name: rate for name, rate in rates.items() if math.isfinite(rate)}
        return replace(run, responses={**run.responses, **known})

    responses = study.responses if runs.responses == study.asked else runs.responses
    return replace(runs, runs=tuple(map(turned, runs.runs)), responses=responses, outcomes=study.failures)


def run_sizes(study: Study, runs: Runs) -> dict[str, Floats]:
    """Trials or exposure of each run, shape (n,), by response; nan where nothing was counted.

    Raises
    ------
    RsmkitError
        Naming the first run whose count, trials or exposure cannot be.
    """
    return {
        name: np.array(
            [
                _size(options, name, run)
                if run is not None and (options.failure or math.isfinite(run.value(name)))
                else math.nan
                for run in runs.runs
            ]
        )
        for name, options in study.counts.items()
    }


def single_trials(study: Study, runs: Runs) -> frozenset[str]:
    """Responses of which each run is a single yes or no, which tells little of the probability there."""
    return frozenset(
        name
        for name, sizes in run_sizes(study, runs).items()
        if study.counts[name].distribution == "binomial" and (sizes[np.isfinite(sizes)] == 1.0).all()
    )


def sizes_named(study: Study) -> tuple[str, ...]:
    """Names under which trials or exposures of the runs are found."""
    named = [size for o in study.counts.values() for size in (o.trials, o.exposure) if isinstance(size, str)]
    return tuple(dict.fromkeys(named))


def sizes_taken(study: Study, runs: Runs) -> dict[str, list[float | None]]:
    """What a fit takes from the runs beside their responses, as JSON values."""
    return {
        name: [float(size) if math.isfinite(size) else None for size in sizes]
        for name, sizes in run_sizes(study, runs).items()
    }


def _size(options: ResponseOptions, name: str, run: Run) -> float:
    """Trials or exposure of a run in which something was counted."""
    from rsmkit.surfaces.estimation.counts.scoring import wrong_count

    assert options.distribution is not None
    if options.failure:
        return 1.0
    key, wanted = ("trials", options.trials) if options.trials is not None else ("exposure", options.exposure)
    where = ", ".join(f"{factor} = {value}" for factor, value in run.made_at.items())
    if isinstance(wanted, str):
        own = run.made_at.get(wanted, run.value(wanted))
        size = float(own) if isinstance(own, int | float) and not isinstance(own, bool) else math.nan
        if not math.isfinite(size):
            how = (
                f"fill the column {wanted} of the run sheet and record it again"
                if run.by_hand
                else f"let the simulator return it beside {name}, or give a number"
            )
            raise RsmkitError(
                f"responses.{name}.{key} = '{wanted}': the run at {where} has no number {wanted}; {how}"
            )
    else:
        size = 1.0 if wanted is None else float(wanted)
    wrong = wrong_count(options.distribution, run.value(name), size, stated=wanted is not None)
    if wrong:
        raise RsmkitError(f"response {name}, the run at {where}: {wrong}")
    return size


@dataclass(frozen=True)
class CountedRuns:
    """A surface of counts whose intervals are those of the runs that were made at given points.

    Parameters
    ----------
    surface : FittedResponse
    sizes : mapping of bytes to float
        Trials or exposure of all runs of a point, by the bytes of the point.
    """

    surface: FittedResponse[Surface]
    sizes: Mapping[bytes, float]

    def predict(
        self, points: Floats, *, interval: float, kind: IntervalKind = "prediction"
    ) -> tuple[Floats, Floats, Floats]:
        """Mean, low and high at natural points (n, k), each shape (n,)."""
        if kind != "prediction":
            return self.surface.predict(points, interval, kind)
        x = np.asarray(points, float) + 0.0
        found: tuple[Floats, Floats, Floats] = self._counts.predict_runs(x, interval, self._size(x))
        return found

    def sampling_sd(self, points: Floats) -> Floats:
        """Standard deviation of the share or the rate that the runs at points (n, k) show, shape (n,)."""
        x = np.asarray(points, float) + 0.0
        found: Floats = self._counts.sampling_sd(x, self._size(x))
        return found

    @property
    def _counts(self) -> GlmSurface:
        return cast("GlmSurface", self.surface.surface)

    def _size(self, x: Floats) -> Floats:
        """Of all runs of each point, nan where none was made."""
        return np.array([self.sizes.get(point.tobytes(), math.nan) for point in x])


def counted_predictors(
    study: Study, surfaces: Mapping[str, FittedResponse[Surface]], made: Runs
) -> dict[str, CountedRuns]:
    """Surfaces of the counts among the responses, with intervals for the runs in `made`.

    The mean of m runs of sizes s has the variance of one run of size ``m^2 / sum(1/s)``, which for equal
    sizes is their sum.
    """
    sizes, found = run_sizes(study, made), {}
    for name in study.counts:
        of: dict[bytes, dict[str, float]] = {}
        for point, run, size in zip(made.points + 0.0, made.runs, sizes[name].tolist(), strict=True):
            if run is not None and math.isfinite(size):
                of.setdefault(point.tobytes(), {})[run.key] = size
        found[name] = CountedRuns(
            surfaces[name],
            {place: len(own) ** 2 / sum(1.0 / size for size in own.values()) for place, own in of.items()},
        )
    return found
