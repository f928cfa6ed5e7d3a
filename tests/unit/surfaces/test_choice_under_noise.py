"""Which of ten models is taken when the best is partly the luckiest."""

import numpy as np
import pytest

from rsmkit.errors import FitError
from rsmkit.language.space import Space
from rsmkit.surfaces.choose import _winner, choose_surface
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.kinds import KINDS, ModelFit, ModelRequest, fit_kind
from rsmkit.surfaces.models.gaussian_process import fit_gaussian_process, nested_errors
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.polynomial_fit import fit_surface

RNG = np.random.default_rng(3)
SPACE = Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
POINTS = RNG.uniform(-1.0, 1.0, (20, 2))
NOISE = RNG.normal(size=20)


def judged(surface, errors):
    return ModelFit(surface, float(errors @ errors), errors=errors)


def test_the_simplest_model_within_a_standard_error_is_taken():
    plain = fit_surface(SPACE, POINTS, NOISE).surface
    fewer = fit_surface(SPACE, POINTS, NOISE, order=1).surface
    process = fit_gaussian_process(SPACE, "y", checked_data(SPACE, POINTS, NOISE, None, None))
    errors = np.where(np.arange(20) % 2, 1.0, 1.2)
    found = {
        "polynomial": judged(plain, errors),
        "reduced": judged(fewer, np.full(20, 1.06)),
        "gaussian process": judged(process, np.where(np.arange(20) % 3, 1.0, 1.15)),
    }
    assert _winner(found, ["gaussian process", "polynomial", "reduced"]) == "reduced"
    # the same at every run: beyond chance, however little it is
    found["gaussian process"] = judged(process, 0.9 * errors)
    assert _winner(found, ["gaussian process", "polynomial", "reduced"]) == "gaussian process"


def test_a_process_judged_without_a_run_never_saw_it():
    data = checked_data(SPACE, POINTS, NOISE, None, None)
    errors = nested_errors(fit_gaussian_process(SPACE, "y", data))
    other = NOISE.copy()
    other[4] += 100.0
    changed = nested_errors(fit_gaussian_process(SPACE, "y", checked_data(SPACE, POINTS, other, None, None)))
    # found from another start, so equal only to where a descent of the likelihood ends
    assert changed[4] - errors[4] == pytest.approx(100.0, abs=1e-2)


def test_as_many_coefficients_as_runs_do_not_compete():
    space = Space(a=(-1.0, 1.0), b=(-1.0, 1.0), c=(-1.0, 1.0))
    points = RNG.uniform(-1.0, 1.0, (20, 3))
    y = points.sum(axis=1) + 0.2 * NOISE
    plain = fit_surface(space, points, y).surface
    request = ModelRequest(space, "y", plain.data, plain.terms, plain)
    with pytest.raises(FitError, match="as many coefficients as there are runs"):
        fit_kind(KINDS["cubic"], request)
    found = choose_surface(space, points, y, options=SurfaceOptions(model="auto"), deterministic=False)
    fresh = RNG.uniform(-1.0, 1.0, (200, 3))
    off = np.sqrt(np.mean((found.surface.predict(fresh) - fresh.sum(axis=1)) ** 2))
    assert off <= 1.1 * np.sqrt(np.mean((plain.predict(fresh) - fresh.sum(axis=1)) ** 2))
