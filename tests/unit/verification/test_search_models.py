"""What a refinement learns from runs: polynomials, processes, failures; against closed forms and peers."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import qmc

from rsmkit.language.space import Factor, Space
from rsmkit.optimum.problem import build_problem
from rsmkit.verification.refinement.front_search import hypervolume_gains
from rsmkit.verification.refinement.global_step import GlobalStep
from rsmkit.verification.refinement.models.cube import Cube
from rsmkit.verification.refinement.models.failures import fit_failures, fit_failures_near
from rsmkit.verification.refinement.models.learner import Learner, log_expected_improvement
from rsmkit.verification.refinement.models.local_polynomial import fit_local_polynomial, monomials
from rsmkit.verification.refinement.models.processes import Form, fit_process
from rsmkit.verification.refinement.models.quantities import Knowledge
from rsmkit.verification.refinement.models.sparse_polynomial import fit_sparse_polynomial

NUMBERS = np.zeros(3, bool)
UNIT = qmc.Sobol(3, rng=5).random(64)
ELSEWHERE = qmc.Sobol(3, rng=6).random(16)


def by_differences(function, x, step=1e-6):
    moves = step * np.eye(x.shape[1])
    return np.array([(function(x + e) - function(x - e)) / (2 * step) for e in moves]).T


def test_a_sparse_polynomial_is_found_exactly():
    def f(u):
        x = 2 * u - 1
        return 3 - x[:, 0] + 2 * x[:, 1] ** 4 + x[:, 0] * x[:, 2] ** 2 + 0.5 * x[:, 0] * x[:, 1] * x[:, 2]

    found = fit_sparse_polynomial(UNIT[:30], f(UNIT[:30]), NUMBERS, (0, 0, 0))
    assert found.exact
    np.testing.assert_allclose(found.mean(ELSEWHERE), f(ELSEWHERE), rtol=1e-10)
    np.testing.assert_allclose(found.gradient(ELSEWHERE), by_differences(f, ELSEWHERE), rtol=1e-6, atol=1e-7)


def test_a_smooth_function_does_not_pass_for_a_polynomial():
    y = np.exp(2 * UNIT[:, 0]) / (1 + UNIT[:, 1] * UNIT[:, 2])
    assert not fit_sparse_polynomial(UNIT, y, NUMBERS, (0, 0, 0)).exact


def test_categories_enter_a_sparse_polynomial_by_their_indicators():
    unit = UNIT.copy()
    unit[:, 2] = np.floor(3 * unit[:, 2])
    y = 1 + unit[:, 0] ** 2 + np.array([0.0, 2.0, -1.0])[unit[:, 2].astype(int)] * unit[:, 1]
    found = fit_sparse_polynomial(unit, y, np.array([False, False, True]), (0, 0, 3))
    assert found.exact
    np.testing.assert_allclose(found.mean(unit), y, rtol=1e-10)


@pytest.mark.parametrize(("order", "count"), [(0, 7), (1, 4), (2, 10), (3, 19)])
def test_local_polynomials(order, count):
    exponents = monomials(~NUMBERS, order)
    assert len(exponents) == count
    truth = np.arange(1.0, count + 1)
    center = np.array([0.4, 0.5, 0.6])

    def f(u):
        return np.prod((u - center)[:, None] ** exponents, axis=2) @ truth

    weights = np.linspace(0.1, 1.0, 64)
    y = f(UNIT) + 0.01 * np.sin(90 * UNIT[:, 0])
    found = fit_local_polynomial("", exponents, UNIT, y, center, weights)
    np.testing.assert_allclose(
        found.gradient(ELSEWHERE), by_differences(found.mean, ELSEWHERE), rtol=1e-5, atol=1e-6
    )
    left = np.arange(64) != 7
    without = fit_local_polynomial("", exponents, UNIT[left], y[left], center, weights[left])
    assert found.residuals[7] == pytest.approx(y[7] - without.mean(UNIT[7:8])[0], rel=1e-6)
    assert fit_local_polynomial("", exponents, UNIT[:count], y[:count], center, weights[:count]) is None


def test_sums_of_functions_of_one_factor_are_learnt_from_few_runs():
    def f(u):
        return np.sin(6 * u).sum(axis=1) + u[:, 1] ** 3

    errors = {
        nested: np.abs(
            fit_process(Form("rbf", nested), UNIT[:24], f(UNIT[:24]), NUMBERS).mean(ELSEWHERE) - f(ELSEWHERE)
        ).max()
        for nested in (False, True)
    }
    assert errors[True] < 0.2 * errors[False]


def test_gradients_of_processes_in_every_form():
    y = np.exp(3 * UNIT[:, 0]) + UNIT[:, 1] * UNIT[:, 2]
    for kernel in ("rbf", "matern52"):
        for nested in (False, True):
            for warped in (False, True):
                form = Form(kernel, nested, warped)
                process = fit_process(form, UNIT[:30], y[:30], NUMBERS, nugget=(1e-5, 1e-4), spread=3.0)
                slopes = by_differences(process.mean, ELSEWHERE, 1e-5)
                np.testing.assert_allclose(process.gradient(ELSEWHERE), slopes, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("z", [3.0, 0.0, -0.5, -2.0, -8.0, -30.0, -300.0, -2e4])
def test_logarithm_of_the_expected_improvement_far_in_the_tail(z):
    # E max(0, z - N) = phi(z) times the integral of t exp(z t - t^2 / 2) over positive t
    scale = max(1.0, -z)
    integral, _ = quad(
        lambda s: s * np.exp(z / scale * s - 0.5 * (s / scale) ** 2), 0.0, np.inf, epsabs=0, epsrel=1e-12
    )
    exact = -0.5 * z * z - 0.5 * np.log(2 * np.pi) + np.log(integral) - 2 * np.log(scale)
    found = log_expected_improvement(np.array([-2.0 * z]), np.array([2.0]), 0.0)[0]
    assert found == pytest.approx(exact + np.log(2.0), rel=1e-9, abs=1e-9)


def test_failures_beyond_an_oblique_limit():
    unit = UNIT[:40]
    alive = unit.sum(axis=1) < 1.7
    found = fit_failures(unit, alive, NUMBERS)
    chance = np.exp(found.log_chance(ELSEWHERE))
    clear = np.abs(ELSEWHERE.sum(axis=1) - 1.7) > 0.2
    np.testing.assert_array_equal((chance > 0.5)[clear], (ELSEWHERE.sum(axis=1) < 1.7)[clear])
    np.testing.assert_allclose(
        found.gradient(ELSEWHERE), by_differences(found.latent, ELSEWHERE), rtol=1e-5, atol=1e-6
    )
    assert fit_failures(unit, np.ones(40, bool), NUMBERS) is None


def test_failures_against_scikit_learns_classifier():
    from sklearn.gaussian_process import GaussianProcessClassifier
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    alive = np.linalg.norm(UNIT - 0.5, axis=1) > 0.35
    peer = GaussianProcessClassifier(ConstantKernel(10.0) * RBF(0.4), optimizer=None).fit(UNIT, alive)
    mine = np.exp(fit_failures(UNIT, alive, NUMBERS).log_chance(ELSEWHERE))
    theirs = peer.predict_proba(ELSEWHERE)[:, 1]
    assert np.corrcoef(mine, theirs)[0, 1] > 0.85
    decided = np.abs(theirs - 0.5) > 0.2
    np.testing.assert_array_equal((mine > 0.5)[decided], (theirs > 0.5)[decided])


@pytest.mark.parametrize("m", [2, 3])
def test_hypervolume_gains_against_pymoo(m):
    from pymoo.indicators.hv import HV

    rng = np.random.default_rng(2)
    front, values = rng.random((12, m)), rng.random((20, m)) * 1.2
    volume = HV(ref_point=np.full(m, 1.1))
    base = volume(front)
    expected = [volume(np.vstack([front, np.minimum(value, 1.1)])) - base for value in values]
    tolerance = 1e-12 if m == 2 else 1e-2 * base  # 4096 quasi-random points
    np.testing.assert_allclose(hypervolume_gains(values, front), expected, atol=tolerance)


def test_what_is_a_line_in_one_response_is_learnt_whole_and_the_rest_is_composed():
    space = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))

    def simulator(p):
        return {"u": p.sum(axis=1) ** 2 + 1, "v": np.exp(p[:, 0])}

    def knowledge(minimize, *subject_to):
        problem = build_problem(space, minimize, simulator, responses=["u", "v"], subject_to=subject_to)
        known = problem.evaluate(UNIT[:30])
        found = Knowledge(problem, known, noisy=False)
        found.learn(known)
        return problem, found

    _, found = knowledge("3*u - 2", "v <= 2", "a + b <= 1")
    assert found.objectives[0].whole is not None
    assert [list(m.learners) for m in found.margins] == [[""]]
    for text in ("u/v", "abs(u - 3)", "u + 2*v", "a*v", "max(u, v)"):
        problem, found = knowledge(text)
        quantity = found.objectives[0]
        assert quantity.whole is None
        model = quantity.ranked(np.full(3, 0.5), 0.25)[0].model
        true = problem.evaluate(ELSEWHERE).objectives[:, 0]
        np.testing.assert_allclose(model.mean(ELSEWHERE), true, rtol=0.02, atol=0.02)
        np.testing.assert_allclose(
            model.gradient(ELSEWHERE), by_differences(model.mean, ELSEWHERE), rtol=1e-3, atol=2e-3
        )


def test_a_quantity_that_does_not_vary():
    cube = Cube(Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0)))
    learner = Learner(cube)
    learner.learn(UNIT[:10], np.full(10, 4.0))
    assert learner.ranked(np.full(3, 0.5), 0.25)[0].model.mean(ELSEWHERE).tolist() == [4.0] * 16
    assert np.isfinite(learner.log_improvement(ELSEWHERE, 4.0)).all()


def test_the_cube_knows_numbers_levels_and_categories():
    space = Space(
        [
            Factor("x", -1.0, 3.0),
            Factor("n", 2, 6, integer=True),
            Factor("d", levels=(1.0, 2.0, 5.0)),
            Factor("c", levels=("p", "q")),
        ]
    )
    cube = Cube(space)
    natural = np.array([[1.0, 4.0, 2.0, 1.0]])
    np.testing.assert_array_equal(cube.unit(natural), [[0.5, 0.5, 0.25, 1.0]])
    np.testing.assert_array_equal(cube.natural(cube.unit(natural)), natural)
    np.testing.assert_array_equal(cube.natural(np.array([[1.4, 0.6, 0.7, 1.0]])), [[3.0, 4.0, 5.0, 1.0]])
    around = cube.around(cube.unit(natural)[0], 0.01)
    np.testing.assert_allclose(around.low, [0.49, 0.25, 0.0, 1.0])
    np.testing.assert_allclose(around.high, [0.51, 0.75, 1.0, 1.0])
    assert cube.apart(cube.unit(natural), cube.unit(natural * [1, 1, 1, 0]))[0, 0] == np.inf
    sample = cube.sample(cube.whole(np.zeros(4)), 64, 1, categories=True)
    assert space.contains(cube.natural(sample)).all()
    assert set(sample[:, 3]) == {0.0, 1.0}


def test_the_global_step_counts_the_chances_that_constraints_hold_and_the_run_succeeds():
    space = Space(a=(0.0, 1.0), b=(0.0, 1.0), c=(0.0, 1.0))
    problem = build_problem(
        space, "u", lambda p: {"u": p[:, 0], "v": p[:, 1]}, responses=["u", "v"], subject_to=["v >= 0.6"]
    )
    known = problem.evaluate(UNIT)
    found = Knowledge(problem, known, noisy=False)
    found.learn(known)
    alive = UNIT[:, 2] < 0.5
    failures = fit_failures(UNIT, alive, NUMBERS)
    cube = Cube(space)
    points = np.array([[0.0, 0.9, 0.2], [0.0, 0.2, 0.2], [0.0, 0.9, 0.9]])
    step = GlobalStep(cube, problem, found.objectives[0], found.margins, failures, 0.3)
    best, infeasible, failing = step.score(points)
    assert best > infeasible + 10
    assert best > failing + 10
    unconstrained = GlobalStep(cube, problem, found.objectives[0], [], None, 0.3).score(points)
    np.testing.assert_allclose(unconstrained, np.log(0.3), atol=1e-3)  # every one gains 0.3
    (point, _) = step.maximise(UNIT[:2], 1)
    assert point[0] < 0.1
    assert point[1] >= 0.6
    assert point[2] < 0.6


def oblique(seed=1, k=3):
    """Runs all over the cube and about a point of the plane x1 + x2 + x3 = 1.6, beyond which they fail."""
    rng = np.random.default_rng(seed)
    place = np.array([0.7, 0.6, 0.3])
    unit = np.vstack([rng.random((20, k)), place + 0.02 * rng.standard_normal((24, k))])
    return unit, unit.sum(axis=1) <= 1.6, place


def test_the_boundary_of_failing_is_found_as_finely_as_runs_lie_about_it():
    unit, alive, place = oblique()
    categorical = np.zeros(3, bool)
    distance = np.abs(unit - place).max(axis=1)
    everywhere = fit_failures(unit, alive, categorical)
    near = fit_failures_near(unit, alive, categorical, distance, 0.02)
    across = place + np.array([-0.01, 0.01])[:, None]  # 0.03 in the sum to either side
    sure = np.exp(near.log_chance(across))
    assert sure[0] > 0.9
    assert sure[1] < 0.1
    coarse = np.exp(everywhere.log_chance(across))
    assert coarse[0] - coarse[1] < sure[0] - sure[1]
    step = 1e-6 * np.eye(3)
    slopes = [(near.latent(place[None] + s) - near.latent(place[None] - s))[0] / 2e-6 for s in step]
    np.testing.assert_allclose(near.gradient(place[None])[0], slopes, rtol=1e-5)
    assert fit_failures_near(unit[alive], alive[alive], categorical, distance[alive], 0.02) is None


def test_draws_of_success_are_as_likely_as_the_chance_says():
    unit, alive, place = oblique()
    found = fit_failures(unit, alive, np.zeros(3, bool))
    points = place + np.array([-0.05, -0.01, 0.0, 0.01, 0.05])[:, None]
    drawn = (found.samples(points, 4000, np.random.default_rng(2)) > 0).mean(axis=0)
    # four standard errors of a share of 4000 draws: 4 * sqrt(0.25 / 4000)
    np.testing.assert_allclose(drawn, np.exp(found.log_chance(points)), atol=0.032)
