"""The re-entry study's scene draws the vehicle that the simulator flies."""

from pathlib import Path

import numpy as np
import pytest
from browser_page import patient_page

from sim.body.vehicle import reference_vehicle

pytestmark = [pytest.mark.browser, pytest.mark.slow]

SCENE = (Path(__file__).parents[2] / "studies" / "reentry" / "vehicle.js").read_text(encoding="utf-8")
SCRIPT = f"(function () {{ {SCENE}\nreturn {{ outline, draw }}; }})()"


@pytest.fixture(scope="module")
def blank(browser):
    page = patient_page(browser)
    yield page
    page.context.close()


@pytest.mark.parametrize(
    "settings", [{}, {"length_1_m": 1.1, "length_2_m": 0.9, "length_3_m": 0.3, "length_1_datum": "nose_tip"}]
)
def test_outline_equals_the_simulators(blank, settings):
    for theta_c1, theta_c2, nose in np.random.default_rng(5).uniform([5, 10, 0.15], [10, 15, 0.3], (25, 3)):
        factors = {"theta_c1_deg": theta_c1, "theta_c2_deg": theta_c2, "nose_radius_m": nose}
        got = blank.evaluate(
            f"([factors, settings]) => {SCRIPT}.outline(factors, settings, 30)", [factors, settings]
        )
        expected = reference_vehicle(theta_c1, theta_c2, nose, **settings).shape.outline(30)
        np.testing.assert_allclose(got, np.column_stack(expected), rtol=1e-12, atol=1e-15)


ROW = {
    "altitude_m": 3e4,
    "mach": 8.0,
    "alpha_deg": 12.0,
    "path_angle_deg": -40.0,
    "stagnation_heat_flux_W_m2": 2e6,
}


@pytest.mark.parametrize("row", [None, ROW], ids=["design", "replay"])
def test_the_vehicle_fills_a_fair_part_of_the_canvas(blank, row):
    blank.set_content("<canvas style='width:300px;height:200px'></canvas>")
    painted = blank.evaluate(
        f"""([factors, row]) => {{
        const canvas = document.querySelector("canvas");
        const columns = {{ stagnation_heat_flux_W_m2: [1e6, 4e6] }};
        const colours = {{ ink: "#000", soft: "#888", dark: false }};
        const frame = {{ settings: {{}}, row, columns, turn: 0.6, tilt: 0.35, ...colours }};
        {SCRIPT}.draw(canvas, factors, frame);
        const {{ width, height }} = canvas;
        const bytes = canvas.getContext("2d").getImageData(0, 0, width, height).data;
        return bytes.filter((value, i) => i % 4 === 3 && value > 0).length / (width * height);
        }}""",
        [{"theta_c1_deg": 7, "theta_c2_deg": 12, "nose_radius_m": 0.2}, row],
    )
    assert 0.08 < painted < 0.6
