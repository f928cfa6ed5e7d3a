"""Every kind of surface gives the same numbers in the page as in Python."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri, stdtrit

from rsmkit.language.space import Factor, Space
from rsmkit.language.terms import full_terms
from rsmkit.report.explorer.fit_scene import fit_scene
from rsmkit.surfaces.estimation.coordinates import Coordinates
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.estimation.stretch import Stretch
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import page_model
from rsmkit.surfaces.models.box_cox import BoxCoxSurface, power_transform
from rsmkit.surfaces.models.gaussian_process import GaussianProcessSurface
from rsmkit.surfaces.models.glm import fit_glm
from rsmkit.surfaces.models.mixed import fit_mixed
from rsmkit.surfaces.models.polynomial import fit_polynomial
from rsmkit.surfaces.models.stretched import stretched_at

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SPACE = Space([Factor("a", 1.0, 3.0), Factor("b", 10.0, 40.0), Factor("tool", levels=("x", "y", "z"))])
NUMERIC = Space(SPACE.factors[:2])


def runs(space, count=40):
    """Random runs that leave the edges of the box free, so that the page must go on outside the hull."""
    rng = np.random.default_rng(11)
    points = space.snap(space.decode(rng.uniform(-0.9, 0.9, (count, len(space)))))
    points[:, 2:] = rng.integers(0, 3, points[:, 2:].shape)
    y = (
        5
        + np.exp(points[:, 0])
        + 0.02 * points[:, 1] ** 1.5
        + points[:, 2:].sum(axis=1)
        + rng.normal(0, 0.1, count)
    )
    return FitData(points, y)


def compared(page, surface):
    """Values, intervals and lines of both kinds, to 1e-12 of the scale of the response."""
    points = np.random.default_rng(12).uniform(
        surface.space.lows, surface.space.highs, (50, len(surface.space))
    )
    points = surface.space.snap(points)
    values = page.evaluate(
        "([model, points]) => { const s = rsmkit.models.surfaceOf(model); "
        "return points.map((p) => [s.predict(p), ...s.interval(p)]); }",
        [page_model(surface), points.tolist()],
    )
    mean, low, high = surface.predict(points, interval=0.95)
    got = np.transpose(values)
    same(got, [mean, low, high])
    _, low, high = surface.predict(points, interval=0.95, kind="mean")
    got = page.evaluate(
        "([model, points]) => points.map((p) => rsmkit.models.surfaceOf(model).interval(p, 0))",
        [page_model(surface), points.tolist()],
    )
    same(got, np.column_stack([low, high]))
    for j, factor in enumerate(surface.space):
        places = np.linspace(factor.low, factor.high, len(factor.levels) or 7)
        line = np.tile(points[0], (len(places), 1))
        line[:, j] = places
        means, ends = page.evaluate(
            "([model, point, j, places]) => { const s = rsmkit.models.surfaceOf(model); "
            "return [s.means(point, j, places), s.intervals(point, j, places)]; }",
            [page_model(surface), points[0].tolist(), j, places.tolist()],
        )
        mean, low, high = surface.predict(line, interval=0.95)
        same(means, mean)
        same(ends, np.column_stack([low, high]))


def same(got, expected):
    scale = np.abs(np.asarray(expected)[np.isfinite(expected)]).max(initial=0.0)
    # infinite limits come as infinities: playwright hands them over
    np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12 * scale)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_polynomials_with_a_categorical_factor(page, order):
    compared(page, fit_polynomial(SPACE, "y", runs(SPACE), full_terms(SPACE, order)))


def test_blocks_are_averaged(page):
    data = runs(NUMERIC)
    blocked = FitData(data.points, data.y, blocks=tuple("pqr"[i % 3] for i in range(len(data))))
    compared(page, fit_polynomial(NUMERIC, "y", blocked, full_terms(2)))


@pytest.mark.parametrize(
    ("family", "parameters", "expression"),
    [
        ("exp", (1.7,), ""),
        ("exp", (1e-6,), ""),
        ("power", (-1.2,), ""),
        ("natpower", (2.5,), ""),
        ("twosided", (2.1,), ""),
        ("twosided", (-1.4,), ""),
        ("roberts", (1.1,), ""),
        ("roberts_interior", (2.0, 0.35), ""),
        ("kumaraswamy", (0.4, -0.3), ""),
        ("beta", (0.5, -0.2), ""),
        ("beta", (-0.7, 0.6), ""),
        ("fixed", (), "log(x) + x / 7"),
    ],
)
def test_stretched_factors(page, family, parameters, expression):
    data = runs(NUMERIC)
    low, high = data.points.min(axis=0), data.points.max(axis=0)
    stretches = (
        Stretch(family, parameters, float(low[0]), float(high[0]), expression),
        Stretch("identity", (), float(low[1]), float(high[1])),
    )
    coordinates = Coordinates(tuple(low.tolist()), tuple(high.tolist()), stretches)
    surface = stretched_at(NUMERIC, "y", data, full_terms(2), coordinates, 1.0, 2.0)
    compared(page, surface)


@pytest.mark.parametrize("power", [0.0, 0.003, 0.5, -1.3])
def test_box_cox(page, power):
    data = runs(NUMERIC)
    moved = FitData(data.points, power_transform(data.y, power))
    compared(page, BoxCoxSurface(fit_polynomial(NUMERIC, "y", moved, full_terms(2)), power, 1.0))


@pytest.mark.parametrize("family", ["twosided", "beta"])
def test_box_cox_of_stretched_factors(page, family):
    data = runs(NUMERIC)
    low, high = data.points.min(axis=0), data.points.max(axis=0)
    members = (("twosided", (0.7,)), (family, (1.3,) if family == "twosided" else (0.3, -0.2)))
    stretches = tuple(
        Stretch(name, parameters, float(a), float(b))
        for (name, parameters), a, b in zip(members, low, high, strict=True)
    )
    coordinates = Coordinates(tuple(low.tolist()), tuple(high.tolist()), stretches)
    moved = FitData(data.points, power_transform(data.y, 0.02))
    inner = stretched_at(NUMERIC, "y", moved, full_terms(2), coordinates, 1.0, 2.0)
    compared(page, BoxCoxSurface(inner, 0.02, 1.0))


@pytest.mark.parametrize("method", ["kenward-roger", "kenward-roger-observed", "satterthwaite"])
def test_runs_in_groups(page, method):
    """Degrees of freedom differ from point to point: those of plots, of batches, or of runs."""
    data, rng = runs(SPACE), np.random.default_rng(14)
    plots, batches = np.arange(40) // 4, np.arange(40) % 7
    points = data.points.copy()
    points[:, 0] = points[4 * plots, 0]
    y = data.y + rng.normal(0, 0.8, 10)[plots] + rng.normal(0, 0.3, 7)[batches]
    groups = {"plot": tuple(map(str, plots)), "batch": tuple(map(str, batches))}
    grouped = FitData(points, y, blocks=tuple("pqr"[i // 14] for i in range(40)), random=groups)
    compared(page, fit_mixed(fit_polynomial(SPACE, "y", grouped, full_terms(SPACE, 1)), method))


def test_groups_of_unknown_variance(page):
    """Plots that their terms use up: intervals are infinite where they depend on them."""
    data = runs(NUMERIC, 12)
    plots = np.arange(12) // 4
    points = data.points.copy()
    points[:, 0] = np.array([1.0, 2.0, 3.0])[plots]
    grouped = FitData(points, data.y, random={"plot": tuple(map(str, plots))})
    surface = fit_mixed(fit_polynomial(NUMERIC, "y", grouped, full_terms(2)))
    assert np.isinf(surface.predict(points, interval=0.95)[2]).all()
    compared(page, surface)


@pytest.mark.parametrize("beyond", [0.25, 0.025, 0.0005])
def test_quantiles_of_students_t(page, beyond):
    degrees = [0.4, 1.0, 1.9, 2.0, 3.3, 4.0, 7.7, 23.1, 61.0, 300.5, 1999.0, 2001.0, 5e4, 1e12]
    got = page.evaluate(
        "([degrees, beyond, z]) => degrees.map((df) => rsmkit.student.quantile(df, beyond, z))",
        [degrees, beyond, float(ndtri(1 - beyond))],
    )
    np.testing.assert_allclose(got, -stdtrit(degrees, beyond), rtol=1e-13)


@pytest.mark.parametrize("kernel", ["matern52", "rbf"])
@pytest.mark.parametrize("kriging", ["ordinary", "simple"])
def test_gaussian_process(page, kernel, kriging):
    data = runs(SPACE)
    coordinates = Coordinates((1.0, 10.0, -1.0), (3.0, 40.0, 1.0))
    lengths = np.array([0.9, 1.4, 2.0, 2.0, 2.0])
    surface = GaussianProcessSurface(SPACE, "y", coordinates, data, kernel, lengths, 1.3, 1e-2, kriging)
    compared(page, surface)


@pytest.mark.parametrize(
    ("distribution", "size"),
    [("binomial", 1.0), ("binomial", 40.0), ("binomial", 2500.0), ("poisson", 0.7), ("poisson", 900.0)],
)
def test_counts(page, distribution, size):
    """Limits of a new count are whole, so that they agree to the last digit or not at all."""
    data, rng = runs(SPACE), np.random.default_rng(13)
    mean = (data.y - data.y.min() + 1.0) / (np.ptp(data.y) + 3.0)
    sizes = np.full(len(data), size) if size == 1.0 else size + rng.integers(0, 5, len(data))
    drawn = (
        rng.binomial(sizes.astype(int), mean) if distribution == "binomial" else rng.poisson(3 * sizes * mean)
    )
    counts = FitData(data.points, drawn.astype(float))
    plain = fit_polynomial(SPACE, "y", counts, full_terms(SPACE, 1))
    compared(page, fit_glm(plain, distribution, sizes))


@pytest.mark.parametrize("d", [2e-5, -2e-5])
def test_a_stretch_near_the_identity(page, d):
    stretch = Stretch("twosided", (d,), 0.0, 1.0)
    u = np.linspace(0.0, 1.0, 9)
    got = page.evaluate(
        "([d, z]) => z.map((v) => rsmkit.stretches.apply({ family: 'twosided', parameters: [d] }, v))",
        [d, (2 * u - 1).tolist()],
    )
    np.testing.assert_allclose(got, 2 * stretch.forward(u) - 1, rtol=1e-15, atol=1e-16)


def written_surfaces():
    data, rng = runs(SPACE), np.random.default_rng(15)
    plain = fit_polynomial(SPACE, "y", data, full_terms(SPACE, 1))
    yield (
        "mixed",
        fit_mixed(
            fit_polynomial(
                SPACE, "y", replace(data, random={"plot": tuple("abcde" * 8)}), full_terms(SPACE, 1)
            )
        ),
    )
    for power in (0.0, 0.5, -0.4):
        moved = FitData(data.points, power_transform(data.y, power))
        yield (
            f"power {power}",
            BoxCoxSurface(fit_polynomial(SPACE, "y", moved, full_terms(SPACE, 1)), power, 1.0),
        )
    mean = (data.y - data.y.min() + 1.0) / (np.ptp(data.y) + 3.0)
    for distribution, counts in (("binomial", rng.binomial(40, mean)), ("poisson", rng.poisson(40 * mean))):
        counted = replace(plain, data=FitData(data.points, counts.astype(float)))
        yield distribution, fit_glm(counted, distribution, np.full(len(data), 40.0))


WRITE = """([equation, language, back]) => {
  const kept = rsmkit.data, factor = (name, numeric) => ({ name, numeric });
  rsmkit.data = { factors: [factor("a", true), factor("b", true), factor("tool", false)] };
  const made = rsmkit.equations.written(equation, language, "y", {}, back).text;
  rsmkit.data = kept;
  return made;
}"""


@pytest.mark.parametrize(("kind", "surface"), list(written_surfaces()))
def test_copied_equations_predict_what_the_surface_predicts(page, kind, surface):
    """In natural and coded units; Python's text is run, Excel's read with cells given by name."""
    found = fit_scene(FittedResponse(surface))["polynomial"]
    assert not found["is_beside"]
    places = np.random.default_rng(16).uniform([1.0, 10.0], [3.0, 40.0], (20, 2))
    for equation in found["equations"]:
        python, excel = (
            page.evaluate(
                WRITE,
                [equation, language, found.get("back")],
            )
            for language in ("python", "excel")
        )
        level = float("xyz".index(equation["category"]["tool"]))
        expected = surface.predict(np.column_stack([places, np.full(20, level)]))
        coding = equation["coding"] or [[0.0, 1.0], [0.0, 1.0]]
        given = np.transpose([(places[:, j] - coding[j][0]) / coding[j][1] for j in (0, 1)])
        names = {}
        exec(python, names)
        np.testing.assert_allclose(names["y"](*given.T), expected, rtol=1e-11)
        cells = {"A2": given[:, 0], "B2": given[:, 1], "EXP": np.exp}
        np.testing.assert_allclose(eval(excel[1:].replace("^", "**"), cells), expected, rtol=1e-11)
