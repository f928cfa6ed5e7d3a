"""Which of ten models is taken when the best is partly the luckiest."""

import numpy as np
import pytest

from rsmkit.errors import FitError
from rsmkit.language.space import Space
from rsmkit.surfaces.choice_rule import winner
from rsmkit.surfaces.choose import choose_surface
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.kinds import KINDS, ModelFit, ModelRequest, fit_kind
from rsmkit.surfaces.models.box_cox import fit_box_cox
from rsmkit.surfaces.models.gaussian_process import fit_gaussian_process, nested_errors
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.polynomial_fit import fit_surface

RNG = np.random.default_rng(3)
SPACE = Space(a=(-1.0, 1.0), b=(-1.0, 1.0))
POINTS = RNG.uniform(-1.0, 1.0, (20, 2))
NOISE = RNG.normal(size=20)


def judged(surface, errors):
    return ModelFit(surface, float(errors @ errors), errors=errors)


def candidates():
    plain = fit_surface(SPACE, POINTS, NOISE).surface
    fewer = fit_surface(SPACE, POINTS, NOISE, order=1).surface
    box_cox = fit_box_cox(SPACE, "y", checked_data(SPACE, POINTS, np.exp(NOISE), None, None), plain.terms)
    process = fit_gaussian_process(SPACE, "y", checked_data(SPACE, POINTS, NOISE, None, None))
    return {"polynomial": plain, "reduced": fewer, "box-cox": box_cox, "gaussian process": process}


def taken(errors, refused=()):
    found = {word: judged(surface, errors[word]) for word, surface in candidates().items() if word in errors}
    return winner(found, [word for word in found if word not in refused], spread=1.0)


def test_what_is_no_polynomial_must_predict_clearly_better():
    """By a fifth than the better of the polynomial and what is left of it, however sure it is."""
    errors = {
        "polynomial": np.full(20, 1.0),
        "reduced": np.full(20, 1.2),
        "gaussian process": np.full(20, 0.81),
    }
    assert taken(errors) == "polynomial"
    assert taken({**errors, "gaussian process": np.full(20, 0.79)}) == "gaussian process"
    assert taken({**errors, "reduced": np.full(20, 0.95)}) == "reduced"
    assert taken({"gaussian process": np.full(20, 2.0), "box-cox": np.full(20, 1.0)}) == "box-cox"


def test_of_models_that_chance_may_order_the_one_with_fewest_parameters_is_taken():
    alternating = np.where(np.arange(20) % 2, 1.0, 1.2)
    # squares 1 and 1.44 against 1.22 at every run: a mean of nothing, in any number of standard errors
    assert taken({"polynomial": alternating, "reduced": np.full(20, np.sqrt(1.22))}) == "reduced"
    assert taken({"polynomial": 0.9 * alternating, "reduced": alternating}) == "polynomial"
    few = {"polynomial": np.full(20, 9.0), "box-cox": alternating, "gaussian process": np.full(20, 1.1)}
    assert taken(few) == "box-cox"
    assert taken({**few, "gaussian process": np.full(20, 0.9)}) == "gaussian process"


def test_errors_that_are_next_to_nothing_are_alike():
    errors = {
        "polynomial": np.full(20, 1.0),
        "box-cox": np.full(20, 9e-6),
        "gaussian process": np.full(20, 1e-9),
    }
    assert taken(errors) == "box-cox"
    assert taken({**errors, "box-cox": np.full(20, 1.2e-5)}) == "gaussian process"
    assert taken(errors, refused=("box-cox",)) == "gaussian process"


def test_a_run_that_nothing_else_tells_of_keeps_a_model_out():
    endless = np.append(np.zeros(19), np.inf)
    errors = {"polynomial": endless, "reduced": np.full(20, 1.0), "gaussian process": np.full(20, 0.5)}
    assert taken(errors) == "gaussian process"
    assert taken(dict.fromkeys(errors, endless)) == "reduced"


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
