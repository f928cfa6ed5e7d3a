"""A marine fuel blended of four refinery streams: viscosity, density, flash point, sulphur, cost.

The laws are those that refineries blend by:

- viscosity: the blending number of Refutas, ``14.534 ln(ln(v + 0.8)) + 10.975`` with v in mm2/s, adds up by
  mass (Maples, *Petroleum Refinery Process Economics*, 2nd ed., 2000, chapter 2);
- flash point: the index ``log10 I = -6.1188 + 4345.2 / (t + 383)`` with t in degrees Fahrenheit adds up by
  volume (Wickey & Chittenden, *Hydrocarbon Processing & Petroleum Refiner* 42 (6), 1963, 157-158);
- density: volumes add up; sulphur and cost add up by mass.

The streams have properties typical of their kind, no particular refinery's.
"""

from dataclasses import dataclass
from math import exp, log, log10


@dataclass(frozen=True)
class Stream:
    """A component: viscosity at 50 C, density at 15 C, flash point, sulphur, price."""

    viscosity_mm2_s: float
    density_kg_m3: float
    flash_c: float
    sulphur_pct: float
    price_per_t: float


STREAMS = {
    "residue": Stream(60_000.0, 1_010.0, 290.0, 0.95, 330.0),
    "gas_oil": Stream(32.0, 900.0, 190.0, 0.06, 560.0),
    "cycle_oil": Stream(2.6, 950.0, 76.0, 0.45, 470.0),
    "kerosene": Stream(1.1, 800.0, 42.0, 0.02, 690.0),
}


def blending_number(viscosity_mm2_s: float) -> float:
    """Refutas's number of a viscosity."""
    return 14.534 * log(log(viscosity_mm2_s + 0.8)) + 10.975


def viscosity_of(number: float) -> float:
    """Inverse of :func:`blending_number`, mm2/s."""
    return exp(exp((number - 10.975) / 14.534)) - 0.8


def flash_index(flash_c: float) -> float:
    """Index of Wickey and Chittenden of a flash point."""
    return 10.0 ** (-6.1188 + 4345.2 / (1.8 * flash_c + 32.0 + 383.0))


def flash_of(index: float) -> float:
    """Inverse of :func:`flash_index`, degrees Celsius."""
    return (4345.2 / (log10(index) + 6.1188) - 383.0 - 32.0) / 1.8


def fuel(**share: float) -> dict[str, float]:
    """Properties of a blend of these shares by mass, which must add up to one."""
    if abs(sum(share.values()) - 1.0) > 1e-9:
        raise ValueError(f"shares must add up to 1, got {sum(share.values())!r}")
    volume = {name: share[name] / stream.density_kg_m3 for name, stream in STREAMS.items()}
    total = sum(volume.values())

    def by_mass(value) -> float:
        return sum(share[name] * value(stream) for name, stream in STREAMS.items())

    index = sum(volume[name] / total * flash_index(stream.flash_c) for name, stream in STREAMS.items())
    viscosity = viscosity_of(by_mass(lambda stream: blending_number(stream.viscosity_mm2_s)))
    return {
        "lg_viscosity": log10(viscosity),
        "density_kg_m3": 1.0 / total,
        "flash_c": flash_of(index),
        "sulphur_pct": by_mass(lambda stream: stream.sulphur_pct),
        "cost_per_t": by_mass(lambda stream: stream.price_per_t),
    }
