"""History: columns, dense output, events, export, figure."""

import csv

import numpy as np
import pytest

import sim
from sim.aero.given_coefficients import GivenCoefficients
from sim.core.errors import InputError
from sim.flight.columns import COLUMNS
from sim.flight.trajectory import Body, InitialState, Integration, fly_body


@pytest.fixture(scope="module")
def flown():
    body = Body.with_coefficients(
        600.0,
        (70.0, 450.0, 450.0),
        1.0,
        1.12838,
        GivenCoefficients(
            axial=0.2, normal_slope=2.0, pitch_slope=-0.3, pitch_damping=-2.0, nose_radius_m=0.2
        ),
    )
    start = InitialState.entry(82_000.0, 4300.0, -15.0, alpha_deg=30.0, heading_deg=40.0, latitude_deg=28.0)
    return fly_body(body, start, integration=Integration(rtol=1e-8))


def test_every_documented_column_is_there_and_nothing_else(flown):
    assert list(flown.columns) == list(COLUMNS)
    assert {column.shape for column in flown.columns.values()} == {(len(flown),)}
    assert set(COLUMNS) <= set(dir(flown))


def test_columns_are_attributes_and_items_and_cannot_be_changed(flown):
    assert flown.altitude_m is flown["altitude_m"]
    with pytest.raises(ValueError, match="read-only"):
        flown.altitude_m[0] = 0.0


def test_unknown_columns_are_refused_with_the_list(flown):
    with pytest.raises(AttributeError, match="altitude_m"):
        _ = flown.altitude_km
    with pytest.raises(KeyError, match="altitude_m"):
        _ = flown["altitude_km"]


def test_dense_output_meets_the_steps(flown):
    at = flown.at(flown.time_s[::50])
    for name in ("altitude_m", "speed_m_s", "alpha_deg", "mach", "CA", "downrange_m", "pitch_deg"):
        np.testing.assert_allclose(at[name], flown[name][::50], rtol=1e-9, atol=1e-9)


def test_dense_output_between_the_steps_follows_the_motion(flown):
    t = np.linspace(1.0, flown.time_s[-1] - 1.0, 301)
    h = 1e-3
    before, after, now = flown.at(t - h), flown.at(t + h), flown.at(t)
    climb = (after["altitude_m"] - before["altitude_m"]) / (2 * h)
    np.testing.assert_allclose(climb, -now["velocity_down_m_s"], atol=2e-2)
    heating = (after["stagnation_heat_load_J_m2"] - before["stagnation_heat_load_J_m2"]) / (2 * h)
    np.testing.assert_allclose(heating, now["stagnation_heat_flux_W_m2"], rtol=1e-4)


def test_columns_agree_with_one_another(flown):
    c = flown.columns
    np.testing.assert_allclose(
        c["dynamic_pressure_Pa"], 0.5 * c["density_kg_m3"] * c["airspeed_m_s"] ** 2, rtol=1e-12
    )
    np.testing.assert_allclose(
        np.hypot(np.hypot(c["velocity_north_m_s"], c["velocity_east_m_s"]), c["velocity_down_m_s"]),
        c["speed_m_s"],
        rtol=1e-12,
    )
    np.testing.assert_allclose(c["airspeed_m_s"], c["speed_m_s"], rtol=1e-12)
    # Planar flight: pitch = path angle + angle of attack, and the heading stays on a great circle.
    np.testing.assert_allclose(c["pitch_deg"], c["path_angle_deg"] + c["alpha_deg"], atol=1e-6)
    assert np.abs(c["crossrange_m"]).max() < 1e-4


def test_times_outside_the_flight_are_refused(flown):
    for bad in (-1.0, flown.time_s[-1] + 1.0):
        with pytest.raises(InputError, match="lasts from 0"):
            flown.at(bad)


def test_events_are_extremes_of_the_dense_output(flown):
    fine = flown.at(np.linspace(0.0, flown.time_s[-1], 40_001))
    for event, column in (
        ("peak_heating", "stagnation_heat_flux_W_m2"),
        ("peak_load", "load_factor_g"),
        ("peak_dynamic_pressure", "dynamic_pressure_Pa"),
    ):
        found = flown.events[event]
        assert found.value >= fine[column].max() * (1 - 1e-9)
        assert found.value == pytest.approx(fine[column].max(), rel=1e-5)
        assert found.unit == COLUMNS[column].unit
    assert flown.events["impact"].altitude_m == pytest.approx(0.0, abs=1e-6)


def test_csv_round_trip(flown, tmp_path):
    path = flown.to_csv(tmp_path / "flight.csv", every_s=5.0)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == list(COLUMNS)
    expected = flown.sampled(5.0)
    for name in ("time_s", "altitude_m", "quaternion_0"):
        assert [float(row[name]) for row in rows] == expected[name].tolist()
    assert [entry.name for entry in tmp_path.iterdir()] == ["flight.csv"]


def test_frame_has_the_columns(flown):
    frame = flown.to_frame()
    assert list(frame.columns) == list(COLUMNS)
    assert len(frame) == len(flown)


def test_sampling_interval_must_be_positive(flown):
    with pytest.raises(InputError, match="positive"):
        flown.sampled(0.0)


def test_figure_3_is_drawn(flown):
    import matplotlib

    matplotlib.use("agg")
    figure = sim.plot_history(flown)
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert len(labels) == 12
    assert "Mach number" in labels
    matplotlib.pyplot.close(figure)
