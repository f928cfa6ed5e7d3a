"""Every row of the register of pressure laws: finite, rising with inclination, called by its own number."""

import importlib.util
import inspect
import math
from pathlib import Path

import numpy as np
import pytest

from sim.aero.aeromodel import prepare
from sim.aero.gas import GAMMA
from sim.aero.methods import PRESETS, ROLES, Laws, methods
from sim.aero.pressure import flow
from sim.aero.pressure_laws.inviscid import nose_trace, recovery, tangent_cone_hammitt_murthy
from sim.aero.pressure_laws.laws import PRESSURE_LAWS, ROUNDING, Place, impact_pressure, wake_pressure
from sim.body.vehicle import reference_vehicle
from sim.core.errors import InputError

ROOT = Path(__file__).parents[2]
FASTEST = 25.0
CONE_SIN = math.sin(math.radians(9.0))
DISTANCE = 3.0  # nose radii behind the tangent point
EVERY = pytest.mark.parametrize(("word", "law"), PRESSURE_LAWS.items(), ids=PRESSURE_LAWS)


def mach_numbers(law):
    """From the lowest Mach number that a law is meant for (at rest none has a meaning) to the highest."""
    low, high = max(law.mach[0], 0.05), min(law.mach[1], FASTEST)
    return np.geomspace(low * (1.0 + 1e-9), high, 9)


def inclinations(law):
    """Sines of inclinations, from the lowest to the highest; zero is among them."""
    return np.sin(np.radians(np.unique(np.append(np.linspace(*law.angle_deg, 61)[:-1], 0.0))))


def stream(mach):
    """The flow as the vehicle's presets see it, with all that any law needs at every Mach number."""
    chosen = methods("newtonian", high=Laws(cone="newtonian_prandtl_meyer", flare="entropy_layer"))
    return flow(mach, 0.0, 1.0, prepare(reference_vehicle(7.5, 12.5, 0.2), chosen).options)


def by_formula(law, s, at):
    """The row's own function with the arguments that its parameters ask for, by their names."""
    given = {
        "sin_inclination": s,
        "k": at.k,
        "mach": at.mach,
        "gamma": GAMMA,
        "match_sin": at.match_sin,
        "grazing_nu_rad": at.grazing_nu_rad,
        "share": at.turn_share,
        "rounding": ROUNDING,
        "cone_cp": tangent_cone_hammitt_murthy(s, at.mach, GAMMA, ROUNDING),
        "distance": DISTANCE,
        "sin_half_angle": CONE_SIN,
    }
    return law.function(*(given[name] for name in inspect.signature(law.function.py_func).parameters))


def by_number(law, s, at):
    """What compiled code computes for the row's number."""
    if "impact" in law.roles:
        place = Place(s, recovery(DISTANCE, CONE_SIN), nose_trace(DISTANCE), 0.0)
        return impact_pressure(law.number, s, place, at)
    return wake_pressure(law.number, s, at)


@EVERY
def test_number_stands_for_the_function_to_the_last_bit(word, law):
    for mach in mach_numbers(law):
        at = stream(mach)
        for s in inclinations(law):
            assert by_number(law, s, at) == by_formula(law, s, at), (mach, s)


@EVERY
def test_pressure_is_finite_and_rises_with_the_inclination(word, law):
    for mach in mach_numbers(law):
        at = stream(mach)
        cp = np.array([by_number(law, s, at) for s in inclinations(law)])
        assert np.all(np.isfinite(cp))
        # Neighbours that are equal in exact arithmetic may differ by the rounding of some ten operations.
        assert np.all(np.diff(cp) >= -1e-15), mach


@EVERY
def test_zero_inclination_has_a_pressure(word, law):
    for mach in mach_numbers(law):
        assert math.isfinite(by_number(law, 0.0, stream(mach)))


def test_numbers_are_the_laws_own():
    assert len({law.number for law in PRESSURE_LAWS.values()}) == len(PRESSURE_LAWS)


@EVERY
def test_row_says_where_it_comes_from_and_where_it_holds(word, law):
    assert law.source.strip()
    assert law.cp.strip()
    assert law.function.py_func.__doc__.strip()
    assert set(law.roles) <= set(ROLES.values())
    assert law.lowest_mach <= law.mach[0] < law.mach[1]
    assert -90.0 <= law.angle_deg[0] < law.angle_deg[1] <= 90.0


@EVERY
def test_word_is_taken_where_the_law_serves_and_refused_elsewhere(word, law):
    for part, role in ROLES.items():
        if role in law.roles:
            assert getattr(Laws(**{part: word}), part) == word
        else:
            with pytest.raises(InputError, match=f"{part} must be one of .*, not '{word}'"):
                Laws(**{part: word})


@EVERY
def test_law_without_a_value_at_rest_is_refused_for_slow_flight(word, law):
    if "impact" not in law.roles:
        return
    slow = Laws(cone=word)
    if law.lowest_mach > 0.0:
        with pytest.raises(InputError, match=f"{word} needs supersonic flow"):
            methods("paper", slow=slow)
    else:
        assert methods("paper", slow=slow).slow == slow


def test_presets_use_words_of_the_register():
    for preset in PRESETS.values():
        for regime in (preset.slow, preset.low, preset.high):
            assert set(vars(regime).values()) <= set(PRESSURE_LAWS)


def test_the_table_in_the_documentation_is_current():
    spec = importlib.util.spec_from_file_location("aero_tables", ROOT / "docs/validation/aero_tables.py")
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    page = (ROOT / "docs" / "aerothermodynamics.md").read_text()
    assert tables.pressure() in page, "run: python docs/validation/aero_tables.py pressure"
