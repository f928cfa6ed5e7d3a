"""rsmkit: response surfaces and designed experiments for expensive simulators.

Plan about fifty runs, fit second-order surfaces, find the optimum on them for free, and prove it on the real
simulation. From the command line see ``rsmkit --help``; from Python start with::

    import rsmkit as rk
    space = rk.Space(width_mm=(30, 60), height_mm=(90, 120))
    design = rk.augment(rk.ccd(space, star="inscribed", center=1), 14, min_distance=0.2)
    runs = rk.evaluate("simulator:cantilever", design)
    surfaces = rk.fit(runs)
    best = rk.search(surfaces, "mass_kg", subject_to=["sag_mm <= 10"])
    rk.verify(best, "simulator:cantilever", surfaces, runs)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rsmkit.api import evaluate, explorer, fit, search, verify
    from rsmkit.design.design import Design
    from rsmkit.design.families.box_behnken import box_behnken
    from rsmkit.design.families.composite import ccd
    from rsmkit.design.families.factorial import fractional_factorial, full_factorial
    from rsmkit.design.families.screening import definitive_screening, plackett_burman
    from rsmkit.design.families.space_filling import fill, halton, latin_hypercube, sobol
    from rsmkit.design.optimal.optimal_design import augment, optimal_design
    from rsmkit.design.quality.assessment import assess
    from rsmkit.design.quality.design_comparison import compare_designs
    from rsmkit.errors import RsmkitError
    from rsmkit.language.space import Factor, Space
    from rsmkit.study.file import load_study

# name -> module it comes from; imported on first use, so that importing rsmkit costs nothing
_HOMES = {
    "Design": "rsmkit.design.design",
    "Factor": "rsmkit.language.space",
    "RsmkitError": "rsmkit.errors",
    "Space": "rsmkit.language.space",
    "assess": "rsmkit.design.quality.assessment",
    "augment": "rsmkit.design.optimal.optimal_design",
    "box_behnken": "rsmkit.design.families.box_behnken",
    "ccd": "rsmkit.design.families.composite",
    "compare_designs": "rsmkit.design.quality.design_comparison",
    "definitive_screening": "rsmkit.design.families.screening",
    "evaluate": "rsmkit.api",
    "explorer": "rsmkit.api",
    "fill": "rsmkit.design.families.space_filling",
    "fit": "rsmkit.api",
    "fractional_factorial": "rsmkit.design.families.factorial",
    "full_factorial": "rsmkit.design.families.factorial",
    "halton": "rsmkit.design.families.space_filling",
    "latin_hypercube": "rsmkit.design.families.space_filling",
    "load_study": "rsmkit.study.file",
    "optimal_design": "rsmkit.design.optimal.optimal_design",
    "plackett_burman": "rsmkit.design.families.screening",
    "search": "rsmkit.api",
    "sobol": "rsmkit.design.families.space_filling",
    "verify": "rsmkit.api",
}

__all__ = [
    "Design",
    "Factor",
    "RsmkitError",
    "Space",
    "assess",
    "augment",
    "box_behnken",
    "ccd",
    "compare_designs",
    "definitive_screening",
    "evaluate",
    "explorer",
    "fill",
    "fit",
    "fractional_factorial",
    "full_factorial",
    "halton",
    "latin_hypercube",
    "load_study",
    "optimal_design",
    "plackett_burman",
    "search",
    "sobol",
    "verify",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'rsmkit' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
