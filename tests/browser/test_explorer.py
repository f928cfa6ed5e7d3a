"""The explorer page in a real browser: its numbers are Python's, its views move together, nothing leaks."""

import json
from dataclasses import replace

import numpy as np
import pytest
from browser_page import choose, finish, patient_page, settle, show, until
from toy_surface import ROW, RadialSurface

from rsmkit.language.browser_formula import browser_formula
from rsmkit.language.conditions import parse_constraint
from rsmkit.report.explorer.explorer_page import write_explorer
from rsmkit.surfaces.estimation.fit_data import FitData
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import KINDS
from rsmkit.variation.door import uncertainty

pytestmark = [pytest.mark.browser, pytest.mark.slow]
PHONE = {"viewport": {"width": 390, "height": 844}, "device_scale_factor": 2}


def point_of(page):
    return np.array(page.evaluate("rsmkit.state.point"))


def ring_of(page, space):
    """Values of the two factors at the ring of the contours, read off its place among the axes."""
    frame = page.locator("#contours .axis").bounding_box()
    ring = page.locator("#contours .ring").bounding_box()
    x = (ring["x"] + ring["width"] / 2 - frame["x"]) / frame["width"]
    y = 1 - (ring["y"] + ring["height"] / 2 - frame["y"]) / frame["height"]
    low, high = space.lows, space.highs
    return low[0] + x * (high[0] - low[0]), low[1] + y * (high[1] - low[1])


def test_surfaces_and_intervals_equal_pythons(page, findings):
    points = np.random.default_rng(3).uniform(findings.space.lows, findings.space.highs, (40, 3))
    points[:8] = findings.runs.points[:8]
    surfaces = {**findings.surfaces, **findings.objective_surfaces}
    assert page.evaluate("rsmkit.study.quantities.map((q) => q.key)") == list(surfaces)
    got = page.evaluate(
        "(points) => rsmkit.study.quantities.map((q) => points.map((p) => [q.value(p), ...q.interval(p)]))",
        points.tolist(),
    )
    for surface, values in zip(surfaces.values(), got, strict=True):
        np.testing.assert_allclose(values, np.transpose(surface.predict(points, interval=0.95)), rtol=1e-12)


def test_leverage_and_constraints_equal_pythons(page, findings):
    points = np.random.default_rng(4).uniform(findings.space.lows, findings.space.highs, (30, 3))
    reach, margin = np.array(
        page.evaluate(
            "(points) => [rsmkit.study.reach, (p) => rsmkit.limits.judged(p).all[0].margin]"
            ".map((f) => points.map(f))",
            points.tolist(),
        )
    )
    runs = findings.runs.points
    expected = [s.leverage(points) / s.leverage(runs).max() for s in findings.surfaces.values()]
    np.testing.assert_allclose(reach, np.max(expected, axis=0), rtol=1e-12)
    # the room is linear, so that interpolation in its table is exact; what lies on the limit keeps it
    np.testing.assert_allclose(margin, findings.functions["room"](points), rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(
    "text",
    [
        "a - b - -2 >= b ** a / 3",
        "min(a, b, 1.5) + max(a, pi) <= tanh(a) * sqrt(b)",
        "log(a) - abs(-b) * exp(-a) >= 0",
    ],
)
def test_formulas_equal_pythons(page, text):
    margin = parse_constraint(text)[0].margin
    values = {"a": 0.7, "b": 2.3}
    got = page.evaluate(
        "([formula, values]) => rsmkit.models.compileFormula(formula)((name) => values[name])",
        [browser_formula(margin), values],
    )
    assert got == pytest.approx(float(margin(values)), rel=1e-14)


def test_dragging_a_profile_moves_every_view(open_page, page_path, findings):
    page = open_page(page_path, viewport={"width": 880, "height": 9000})  # every view is a section
    show(page, "#contours .chart")
    before = point_of(page)
    cell = page.locator("#profiler svg.cell").first.bounding_box()
    page.mouse.move(cell["x"] + 40, cell["y"] + 30)
    page.mouse.down()
    for step in range(6):
        page.mouse.move(cell["x"] + 60 + 24 * step, cell["y"] + 30)
    page.mouse.up()
    settle(page)
    after = point_of(page)
    # the drawing area of a cell starts 5 pixels inside it
    share = (60 + 120 - 5) / (cell["width"] - 10)
    assert after[0] == pytest.approx(10 + 20 * share, abs=0.1)
    assert (after[1:] == before[1:]).all()
    assert float(page.get_by_role("slider", name="speed").input_value()) == pytest.approx(after[0], abs=1e-9)
    assert ring_of(page, findings.space) == pytest.approx(tuple(after[:2]), abs=0.07)  # a pixel
    assert json.loads(page.locator("canvas.stage").get_attribute("data-factors"))["speed"] == pytest.approx(
        after[0]
    )
    assert page.locator("#pins tbody tr").first.inner_text().split()[-1] == f"{after[0]:.2f}".rstrip("0")


# A profile has 43 points, and a band that is computed at every third of them (at every sixth among more than
# four factors); the slice of contours and surface has 25 x 25.


def test_interactions_are_profiles_at_the_ends_of_another_factor(page, findings):
    page.get_by_label("Interactions with").select_option(label="load")
    page.get_by_label("Scale to").select_option(label="all runs")
    settle(page)
    cells = page.locator("#profiler svg.cell")
    assert [cells.nth(j).locator(".others path").count() for j in range(3)] == [2, 2, 0]
    # where the two profiles end: the drawing area reaches from 6 to 88 pixels, with margins of 6 %
    point = np.tile(point_of(page), (2, 1))
    point[:, 0], point[:, 2] = 30.0, [100.0, 400.0]
    low, high = page.evaluate("rsmkit.study.quantities[0].range")
    margin = 0.06 * (high - low)
    toY = 88 - 82 * (findings.surfaces["cost"].predict(point) - low + margin) / (high - low + 2 * margin)
    ends = [cells.nth(0).locator(".others path").nth(i).get_attribute("d").split(" ")[-1] for i in (0, 1)]
    np.testing.assert_allclose([float(text) for text in ends], toY, atol=0.06)
    page.get_by_label("Scale to").select_option(label="what is in sight")
    settle(page)
    for q in range(3):  # now every profile fills its row
        heights = page.evaluate(
            "(q) => [...document.querySelectorAll('#profiler svg.cell')].slice(3 * q, 3 * q + 3)"
            ".map((e) => e.querySelector('svg').getBBox && e.querySelector('.trace').getBBox().height)",
            q,
        )
        assert max(heights) > 0.4 * 82


def test_optimum_button_goes_there_and_far_corners_extrapolate(page, findings):
    badge = page.get_by_text("extrapolating", exact=True)
    page.get_by_role("button", name="Centre").click()
    settle(page)
    np.testing.assert_allclose(point_of(page), [20.0, 0.0, 250.0])
    assert not badge.is_visible()
    page.get_by_role("button", name="Optimum cheapest").click()
    settle(page)
    np.testing.assert_allclose(point_of(page), findings.optima[0].point)
    page.evaluate("rsmkit.state.set({ point: [60, 20, 900] }); rsmkit.state.flush()")
    assert badge.is_visible()


def test_refinement_is_told_wave_by_wave(page):
    show(page, "#refinement .chart")
    assert page.locator("#refinement .plot path").count() == 3  # the grid, the runs, the best so far
    page.locator("#refinement .plot").focus()
    page.keyboard.press("ArrowLeft")
    assert page.locator("#refinement .hint").inner_text() == "run 20, wave 2: 7.5"
    assert page.locator("#refinement li").all_inner_texts() == [
        "2 runs in the whole box", "1 run", "stopped after 3 runs: no model promises a gain; objective 7.5",
    ]  # fmt: skip
    page.get_by_role("button", name="Go to the refined design").click()
    settle(page)
    np.testing.assert_allclose(point_of(page), [12.5, 1.0, 222.0])


def test_texts_of_the_user_stay_texts(page):
    assert page.title() == "Wear & tear <b>study</b>: explorer"
    assert page.locator("img").count() == 0
    assert page.get_by_role("heading", level=1).inner_text() == "Wear & tear <b>study</b>"


def test_verdict_stands_first_and_without_scripts(browser, page_path, findings):
    page = patient_page(browser, java_script_enabled=False)
    page.goto(f"file://{page_path}")
    text = page.get_by_role("region", name="Verdict").inner_text()
    confirmation = findings.verification.searches[0]
    assert confirmation.verdict in text
    assert confirmation.sentence[1:].replace(" +- ", " ± ") in text
    for name, value in confirmation.responses.items():  # the best known design with its true values
        assert f"{value.actual:.5g}" in text, name
    page.get_by_text("What it cost").click()
    assert f"{len(findings.runs)} for the design + 1 to verify = " in page.locator("#verdict").inner_text()
    page.get_by_text("Aim, optimum and comparison").first.click()
    cells = page.get_by_role("row", name="running cost").get_by_role("cell").all_inner_texts()
    cost = confirmation.responses["cost"]
    assert [float(text) for text in cells[0::2]] == pytest.approx([cost.predicted, cost.actual], rel=1e-4)
    assert cells[3] == f"{100 * abs(cost.actual - cost.predicted) / abs(cost.actual):.2f} %"
    page.context.close()


def test_scene_follows_the_design_and_replays_a_run(open_page, page_path):
    page = open_page(page_path, reduced_motion="reduce")
    choose(page, "canvas.stage")
    page.locator("canvas.stage").scroll_into_view_if_needed()
    until(page, "document.querySelector('canvas.stage').dataset.factors")
    page.evaluate("rsmkit.state.setFactor(2, 123)")
    settle(page)
    stage = page.locator("canvas.stage")
    assert json.loads(stage.get_attribute("data-factors"))["load"] == 123
    assert json.loads(stage.get_attribute("data-row")) is None
    page.get_by_label("Replay", exact=True).select_option(label="cheapest")
    time = page.get_by_role("slider", name="Time of the replay")
    time.fill("2")
    settle(page)
    # halfway between t = 1 s, 4 m and t = 3 s, 0 m
    assert json.loads(stage.get_attribute("data-row")) == {"time_s": 2, "height_m": 2}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_ink_is_readable_on_paper(open_page, page_path, scheme):
    page = open_page(page_path, color_scheme=scheme)
    style = "getComputedStyle(document.body)"
    ink, paper = (
        [int(v) for v in page.evaluate(f"{style}.{key}").removeprefix("rgb(").removesuffix(")").split(",")]
        for key in ("color", "backgroundColor")
    )
    assert (luminance(paper) > 0.5) == (scheme == "light")
    bright, dim = sorted([luminance(ink), luminance(paper)], reverse=True)
    assert (bright + 0.05) / (dim + 0.05) > 7  # WCAG 2.1, level AAA
    page.get_by_role("button", name="Switch between light and dark").click()
    changed = page.evaluate(f"{style}.backgroundColor")
    assert changed != f"rgb({', '.join(map(str, paper))})"


def test_paper_gets_every_chart_in_light_colours(open_page, page_path):
    page = open_page(page_path, color_scheme="dark")
    background = "getComputedStyle(document.body).backgroundColor"
    dark = page.evaluate(background)
    page.evaluate("window.dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(background) == "rgb(255, 255, 255)"
    unseen = page.evaluate(
        "[...document.querySelectorAll('.chart:not([data-drawn])')].filter((e) => e.checkVisibility()).length"
    )
    assert unseen == 0
    page.evaluate("window.dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(background) == dark


def luminance(colour):
    """Relative luminance of WCAG 2.1."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (v / 255 for v in colour)]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


@pytest.mark.parametrize("path", ["page_path", "plain_path"])
def test_a_telephone_needs_no_sideways_scroll(open_page, request, path):
    page = open_page(request.getfixturevalue(path), **PHONE)
    finish(page)
    assert page.locator(".view:visible").count() == page.locator(".view").count()
    charts = page.locator(".chart:visible")
    for i in range(charts.count()):
        charts.nth(i).scroll_into_view_if_needed()
        until(page, "(e) => e.dataset.drawn", charts.nth(i).element_handle())
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_page_is_whole_with_surfaces_alone(open_page, plain_path):
    page = open_page(plain_path)
    np.testing.assert_allclose(point_of(page), [20.0, 0.0, 250.0])
    show(page, "#contours .chart")
    show(page, "#fit .chart")
    assert page.locator("#object, #searches, #refinement, #front-1").count() == 0


def test_objectives_need_no_surface_of_their_own(open_page, findings, tmp_path):
    path = tmp_path / "explorer.html"
    write_explorer(path, replace(findings, objective_surfaces={}, verification=None))
    page = open_page(path)
    assert page.evaluate("rsmkit.state.quantity") == "0.5*cost + 2*wear"
    show(page, "#fit .chart")
    assert page.get_by_label("Surface of", exact=True).input_value() == "cost"


def test_a_surface_without_a_twin_in_the_page_leaves_the_rest_whole(
    open_page, findings, tmp_path, monkeypatch
):
    monkeypatch.setitem(KINDS, "radial", ROW)
    runs = findings.runs
    known = FitData(*(a[:14] for a in (runs.points, runs.y("wear"))))  # without the repeated centre
    radial = FittedResponse(RadialSurface(findings.space, "wear", known))
    path = tmp_path / "explorer.html"
    write_explorer(path, replace(findings, surfaces={**findings.surfaces, "wear": radial}))
    page = open_page(path)
    assert "This kind of surface cannot be drawn live here: wear" in page.locator("body").inner_text()
    cost, wear, both = page.evaluate("rsmkit.study.quantities.map((q) => q.value(rsmkit.state.point))")
    point = np.array(point_of(page))
    assert cost == pytest.approx(findings.surfaces["cost"].predict(point[None])[0], rel=1e-12)
    assert np.isnan([wear, both]).all()
    assert page.evaluate("rsmkit.study.reach(rsmkit.state.point)") <= 1
    for quantity in ("wear", "cost"):
        page.evaluate("(quantity) => rsmkit.state.set({ quantity })", quantity)
        settle(page)
        show(page, "#contours .chart")
    show(page, "#fit .chart")
    page.evaluate("rsmkit.state.set({ quantity: 'wear' })")
    settle(page)
    assert "Not shown of this surface (radial): Effects" in page.locator("#fit").inner_text()
    assert page.locator("#fit .chart:visible").count() == 0


def test_profiles_stop_where_a_value_is_unknown(open_page, page_path):
    page = open_page(page_path)
    page.evaluate(
        "() => { const q = rsmkit.study.quantities[0]; q.value = () => NaN; "
        "q.values = (point, j, values) => values.map((_, i) => (i < 20 ? NaN : 50)); "
        "rsmkit.state.setFactor(1, 2); }"
    )
    settle(page)
    trace = page.locator("#profiler svg.cell .trace").first.get_attribute("d")
    assert trace.count("L") == 43 - 20 - 1


def test_equations_for_other_programs_predict_what_the_surface_predicts(page, findings):
    """Python's text is run as Python; Excel's has the same operators, and its cells are given by name."""
    texts = page.evaluate(
        "rsmkit.data.fits.cost.polynomial.equations.map((e) => "
        "['python', 'excel'].map((language) => rsmkit.equations.written(e, language, 'cost', {}).text))"
    )
    points = findings.runs.points
    expected = findings.surfaces["cost"].predict(points)
    for (python, excel), given in zip(texts, (points, findings.space.encode(points)), strict=True):
        names = {}
        exec(python, names)
        np.testing.assert_allclose(names["cost"](*given.T), expected, rtol=1e-12)
        cells = dict(zip(("A2", "B2", "C2"), given.T, strict=True))
        np.testing.assert_allclose(eval(excel[1:].replace("^", "**"), cells), expected, rtol=1e-12)


def test_runs_marked_in_one_view_are_lit_in_every_other(page, findings):
    page.evaluate(
        "rsmkit.views.choose('quality'); rsmkit.state.set({ quantity: 'cost' }); rsmkit.state.flush()"
    )
    show(page, "#fit-residuals .chart")
    page.locator("#fit-residuals svg.plot").focus()
    page.keyboard.press("ArrowRight")
    words = page.locator("#fit-residuals .hint").inner_text()
    page.keyboard.press("Enter")
    settle(page)
    (run,) = page.evaluate("rsmkit.state.brush.rows")
    residual = findings.surfaces["cost"].report()["diagnostics"]["studentised"][run]
    assert words.startswith(f"run {run + 1}: studentised residual {residual:.3f}".replace("-", "−"))
    np.testing.assert_array_equal(page.evaluate("rsmkit.state.brush.points[0]"), findings.runs.points[run])
    assert f"run {run + 1} Unmark" in page.locator("#fit .marked").inner_text()
    page.evaluate("rsmkit.views.choose('map')")
    show(page, "#contours .chart")
    assert page.locator("#contours .lit-dot").get_attribute("d")


def test_what_the_laws_do_is_drawn_as_python_found_it(open_page, findings, tmp_path):
    """The third run of the curve is a quantile of Python's, the last bar the largest total index."""
    surfaces = {"cost": findings.surfaces["cost"]}
    found = uncertainty(
        surfaces, {"speed": {"sd": 0.5}}, specifications={"cost": {"high": 60.0}}, draws=20, seed=1
    )
    path = tmp_path / "explorer.html"
    write_explorer(
        path, replace(findings, surfaces=surfaces, objective_surfaces={}, optima=(), uncertainty=found)
    )
    page = open_page(path)
    show(page, "#in-service .chart")
    page.locator("#in-service svg.plot").first.focus()
    for _ in range(3):
        page.keyboard.press("ArrowRight")
    share, value = list(found.responses["cost"].quantiles.items())[2]
    words = page.locator("#in-service .hint").first.inner_text()
    assert words.startswith(f"{100 * float(share):g} % of cases below {value:.5g}"[:-1])
    page.locator("#in-service svg.plot").nth(1).focus()
    page.keyboard.press("ArrowLeft")
    total = found.responses["cost"].sobol["speed"].total
    assert f"speed, with others: {100 * total:.3g} %" in page.locator("#in-service .hint").nth(1).inner_text()
