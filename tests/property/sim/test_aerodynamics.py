"""Properties of the aerothermodynamics that hold for any vehicle and flight condition."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.aero import gas
from sim.aero.coefficients import Air, coefficients
from sim.aero.methods import PRESETS, Resolution
from sim.body.geometry import sphere_cone
from sim.body.vehicle import reference_vehicle

QUICK = settings(max_examples=40)


def wetted_area_m2(shape):
    """Surface without the base, as cone frusta between the points of the outline."""
    x, r = shape.outline()
    return math.pi * float(np.sum((r[1:] + r[:-1]) * np.hypot(np.diff(x), np.diff(r))))


@QUICK
@given(mach=st.floats(1.0001, 100.0), gamma=st.floats(1.1, 1.67))
def test_prandtl_meyer_inverse(mach, gamma):
    angle = gas.prandtl_meyer_angle(mach, gamma)
    assert gas.prandtl_meyer_mach(angle, gamma) == pytest.approx(mach, rel=1e-10)


@QUICK
@given(
    half_angle=st.floats(3.0, 40.0),
    bluntness=st.just(0.0) | st.floats(1e-3, 0.9),
    share=st.floats(0.0, 1.0),
    k=st.floats(1.0, 2.0),
)
def test_unshadowed_sphere_cones_follow_their_closed_forms(half_angle, bluntness, share, k):
    th, a = math.radians(half_angle), math.radians(share * half_angle)
    r1 = bluntness * math.cos(th)
    cap = 0.5 * math.cos(a) ** 2 * (1 - math.sin(th) ** 4) + 0.25 * math.sin(a) ** 2 * math.cos(th) ** 4
    ring = math.cos(a) ** 2 * math.sin(th) ** 2 + 0.5 * math.sin(a) ** 2 * math.cos(th) ** 2
    lift = math.sin(a) * math.cos(a)
    got = coefficients(
        sphere_cone(half_angle, bluntness, 1.0), 8.0, math.degrees(a), "newtonian", stagnation_cp=k
    )
    assert float(got.CA) == pytest.approx(k * (bluntness**2 * cap + (1 - r1**2) * ring), abs=1e-6)
    normal = bluntness**2 * 0.5 * math.cos(th) ** 4 + (1 - r1**2) * math.cos(th) ** 2
    assert float(got.CN) == pytest.approx(k * lift * normal, abs=1e-6)


@QUICK
@given(
    preset=st.sampled_from(sorted(PRESETS)),
    design=st.tuples(st.floats(3.0, 12.0), st.floats(8.0, 17.0), st.floats(0.09, 0.36)),
    mach=st.floats(0.05, 25.0),
    alpha=st.floats(0.0, 180.0),
    density=st.floats(1e-9, 1.3),
    temperature=st.floats(160.0, 350.0),
)
def test_loads_are_finite_and_bounded_everywhere(preset, design, mach, alpha, density, temperature):
    air = Air(density * gas.GAS_CONSTANT * temperature, density, temperature)
    vehicle = reference_vehicle(*design)
    got = coefficients(vehicle, mach, alpha, preset, air=air, blend=(4.5, 5.5), resolution=Resolution())
    for name in ("CA", "CN", "CM_nose", "Cmq", "stagnation_heat_flux_W_m2", "surface_heat_rate_W"):
        assert np.isfinite(getattr(got, name)), name
    # Where the air is thin the molecules' own motion presses as well: with S = M sqrt(gamma/2) by 1/S^2, and
    # by sqrt(pi Tw/T)/S where they leave a wall hotter than the air, by less than six times.
    inverse = 1.0 / (mach * math.sqrt(0.7))
    thin = 1.0 + inverse * (inverse + math.sqrt(6.0 * math.pi))
    assert abs(got.CA - got.CA_friction) < 4.0 * thin
    assert -0.2 * thin < got.CN - got.CN_friction < 20.0 * thin
    # No shear stress exceeds that of free-molecular flow on a surface facing the stream.
    molecules = 0.5 * (1.0 + math.sqrt(1.0 + 2.0 / (math.pi * 1.4 * mach * mach)))
    bound = 2.0 * molecules * wetted_area_m2(vehicle.shape) / vehicle.reference_area_m2
    assert math.hypot(got.CA_friction, got.CN_friction) < bound
    # Broadside the flow parts along the body to both ends; elsewhere friction pulls with the stream.
    along = math.cos(math.radians(alpha))
    assert abs(along) < 0.2 or got.CA_friction * along >= 0.0
