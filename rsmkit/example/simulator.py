"""A stand-in for your simulator: factors and settings come in as keywords, responses go out as a mapping."""


def cantilever(width_mm: float, height_mm: float, length_m: float, load_N: float) -> dict[str, float]:
    """Steel cantilever of rectangular section with a load at its tip (Euler-Bernoulli)."""
    density_kg_m3, modulus_Pa = 7850.0, 210e9
    width, height = width_mm / 1000, height_mm / 1000
    inertia = width * height**3 / 12
    return {
        "mass_kg": density_kg_m3 * width * height * length_m,
        "sag_mm": 1000 * load_N * length_m**3 / (3 * modulus_Pa * inertia),
        "stress_MPa": load_N * length_m * (height / 2) / inertia / 1e6,
    }
