"""Study files and tables that ``golden_scenarios.py`` works on."""

from __future__ import annotations

from collections.abc import Mapping

PROCESS = {
    "factors": "temp_C = { low = 20, high = 80, label = 'temperature', unit = 'C' }\n"
    "time_h = { low = 1, high = 5 }",
    "responses": "yield_pct = { label = 'yield', unit = '%' }\ncost_eur = {}\npurity = {}",
    "simulator": "run = 'simulator:process'",
}
BEAM = {
    "factors": "width_mm = { low = 20, high = 60 }\nribs = { low = 1, high = 6, integer = true }\n"
    "gauge_mm = { levels = [1.0, 1.5, 2.5] }\nmaterial = { levels = ['steel', 'aluminium', 'titanium'] }",
    "responses": "mass_kg = {}\nsag_mm = {}",
    "simulator": "run = 'simulator:beam'\nsettings = { load_N = 500.0 }",
}
STEEP = {
    "factors": "x = { low = -1, high = 1 }\ny = { low = -1, high = 1 }",
    "responses": "load = {}\narea = {}",
    "simulator": "run = 'simulator:steep'",
}


def box(k: int) -> dict[str, str]:
    """A study of k continuous factors that is only planned."""
    names = "ABCDEFGHJ"[:k]
    return {
        "factors": "\n".join(f"{name} = {{ low = {i}, high = {2 * i + 3} }}" for i, name in enumerate(names)),
        "responses": "y = {}",
    }


def study(base: Mapping[str, str], **tables: str) -> str:
    """The text of a study file: a table per name; `searches` stands at its end as it is."""
    parts = dict(base) | tables
    heads = "".join(f"[{name}]\n{text}\n" for name, text in parts.items() if name != "searches")
    return "name = 'Golden'\n" + heads + parts.get("searches", "")


def search(name: str, minimize: str, rest: str = "") -> str:
    """One search of a study file."""
    aim = f"minimize = {minimize}\n" if minimize else ""
    return f"[[search]]\nname = '{name}'\n{aim}{rest}\n"


ENTRY = study(
    {
        "factors": "theta_c1_deg = { low = 5.0, high = 10.0 }\nnose_radius_m = { low = 0.15, high = 0.30 }\n"
        "speed_m_s = { low = 4240.0, high = 4360.0 }",
        "responses": "axial_integral = {}\nheat_integral = {}",
        "simulator": "run = 'sim.reentry:evaluate'",
        "simulator.settings": "theta_c2_deg = 12.0\naltitude_m = 82000.0\ntheta_deg = -15.0\nnu_deg = 15.0\n"
        "alpha_deg = 30.0\npreset = 'paper'\nblend = [4.5, 5.5]\nmass_kg = 1000.0\ncg_fraction = 0.55\n"
        "length_1_m = 1.6\nlength_2_m = 0.4\nlength_3_m = 0.7",
    },
    design="star = 'faced'\ncenter = 1",
    searches=search(
        "sturdy",
        "'axial_integral / 1e8 + heat_integral / 1e8'",
        "robust = { noise = { speed_m_s = { mean = 4300.0, spread = 30.0 } } }\npreset = 'fast'",
    ),
)
"""The dispersed entry of ``studies/robust_design.py``, its speed as a noise factor."""

SEARCH_BASE = study(
    PROCESS,
    functions="waste = 'simulator:waste'",
    design="center = 2\naugment_to = 16",
    searches=search("best", "'-yield_pct'"),
)
FEW_MORE = "[verify]\nrefine = { batch = 4, max_runs = 8 }\n"
FAST = "preset = 'fast'"
WISHES = (
    "[search.desirability]\nyield_pct = { goal = 'maximize', low = 60, high = 85 }\n"
    "cost_eur = { goal = 'minimize', low = 7, high = 14, weight = 2, importance = 3 }\n"
    "purity = { goal = 'target', low = 0.85, target = 0.9, high = 0.95, weight_above = 0.5 }"
)
SEARCHES = {
    "seeds": "".join(search(f"seed{seed}", "'-yield_pct'", f"{FAST}\nseed = {seed}") for seed in (1, 2, 7)),
    "presets": "".join(
        search(name, "'0.3*cost_eur - yield_pct + 5*abs(purity - 0.9)'", f"preset = '{name}'\npolish = false")
        for name in ("paper", "fast", "matlab_like")
    ),
    "polish": search("cobyqa", "'-yield_pct*purity'", f"{FAST}\npolish_method = 'cobyqa'"),
    "limits": search("within", "'-yield_pct'", "subject_to = ['9 <= cost_eur <= 10.5', 'waste <= 3']"),
    "nowhere": search("nowhere", "'-yield_pct'", "subject_to = ['cost_eur <= 2']\npreset = 'fast'"),
    "pareto": search("two", "['-yield_pct', 'cost_eur']", "population = 20\ngenerations = 12")
    + search("three", "['-yield_pct', 'cost_eur', '-purity']", f"{FAST}\nsubject_to = ['waste <= 4']"),
    "wishes": search("wishes", "", f"{FAST}\nsubject_to = ['waste <= 5']\n{WISHES}") + FEW_MORE,
}
SURFACE_BASE = study(
    STEEP,
    design="kind = 'latin-hypercube'\nruns = 24\nseed = 3",
    searches=search("least", "'load + 0.3*area'", "preset = 'fast'"),
)
SURFACES = {
    "linear": "order = 1",
    "cubic": "order = 3",
    "terms": "terms = ['FO', 'x*y', 'x^3']",
    "reduced": "model = 'reduced'",
    "backward": "model = 'reduced'\nreduction = 'backward'",
    "forward": "model = 'reduced'\nreduction = 'forward'\norder = 3",
    "subsets": "model = 'reduced'\nreduction = 'all'",
    "stretched": "model = 'stretched'",
    "families": "model = 'stretched'\nstretch_factors = { x = 'kumaraswamy', y = 'power' }",
    "formula": "model = 'stretched'\nstretch = 'exp(x)'",
    "roberts": "model = 'stretched'\nstretch = 'roberts'",
    "box-cox": "model = 'box-cox'",
    "both": "model = 'stretched box-cox'",
    "gaussian": "model = 'gaussian process'",
    "auto": "model = 'auto'",
}
TWO, THREE, FIVE, SEVEN = box(2), box(3), box(5), box(7)
FIRST = "\n[surface]\norder = 1"
PLANS = {
    "fraction-quadratic": (SEVEN, "kind = 'fractional-factorial'\nruns = 16"),
    "ccd-spherical": (THREE, "alpha = 'spherical'\ncenter = 2"),
    "ccd-uncorrelated": (THREE, "alpha = 'uncorrelated'"),
    "ccd-alpha": (TWO, "alpha = 1.2\nstar = 'inscribed'"),
    "ccd-fraction": (FIVE, "cube = 'fraction'\nstar = 'faced'"),
    "ccd-generators": (FIVE, "generators = ['E=ABCD']\nblocked = true\nalpha = 'orthogonal'"),
    "ccd-mixed": (BEAM, "star = 'faced'\ncenter = 1"),
    "box-behnken": (THREE, "kind = 'box-behnken'\ncenter = 3"),
    "box-behnken-blocked": (FIVE, "kind = 'box-behnken'\nblocked = true\ncenter = 4"),
    "factorial": (THREE, "kind = 'factorial'\nlevels = 3\ncenter = 0"),
    "factorial-mixed": (BEAM, "kind = 'factorial'\nlevels = { width_mm = 3, ribs = 3 }\nreduction = 2"),
    "fraction": (SEVEN, "kind = 'fractional-factorial'\nruns = 16\ncenter = 2" + FIRST),
    "fraction-generators": (FIVE, "kind = 'fractional-factorial'\ngenerators = ['D=AB', 'E=-AC']" + FIRST),
    "plackett-burman": (SEVEN, "kind = 'plackett-burman'\nruns = 12" + FIRST),
    "definitive": (FIVE, "kind = 'definitive-screening'" + FIRST),
    "definitive-more": (SEVEN, "kind = 'definitive-screening'\nruns = 21\ncenter = 3" + FIRST),
    "lhs-maximin": (THREE, "kind = 'latin-hypercube'\nruns = 12"),
    "lhs-discrepancy": (THREE, "kind = 'latin-hypercube'\nruns = 12\nspread = 'discrepancy'\nseed = 2"),
    "lhs-correlation": (THREE, "kind = 'latin-hypercube'\nruns = 12\nspread = 'correlation'\nseed = 3"),
    "lhs-within": (TWO, "kind = 'latin-hypercube'\nruns = 10\nsubject_to = ['A + B <= 4']"),
    "sobol": (THREE, "kind = 'sobol'\nruns = 16\nseed = 2"),
    "sobol-within": (TWO, "kind = 'sobol'\nruns = 10\nsubject_to = ['A + B <= 4']"),
    "halton": (BEAM, "kind = 'halton'\nruns = 30"),
    "maximin": (THREE, "kind = 'maximin'\nruns = 15\nseed = 4"),
    "spread": (TWO, "augment_to = 18\ncriterion = 'maximin'"),
    "optimal-d": (THREE, "kind = 'optimal'\nruns = 14"),
    "optimal-a": (THREE, "kind = 'optimal'\nruns = 13\ncriterion = 'A'\nseed = 2"),
    "optimal-g": (TWO, "kind = 'optimal'\nruns = 9\ncriterion = 'G'\nstarts = 4"),
    "optimal-i": (BEAM, "kind = 'optimal'\nruns = 28\ncriterion = 'I'\nstarts = 3"),
    "bayesian": (THREE, "kind = 'optimal'\nruns = 11\ncriterion = 'bayesian-D'"),
    "replicates": (TWO, "kind = 'optimal'\nruns = 12\nreplicates = true"),
    "within": (TWO, "kind = 'optimal'\nruns = 10\nsubject_to = ['A*B <= 6', 'A >= 0.5']\nmin_distance = 0.3"),
    "ball": (THREE, "center = 1\naugment_to = 20\nregion = 'ball'"),
    "stars": (TWO, "center = 1\naugment_to = 13\nregion = 'stars'\ncriterion = 'G'\nseed = 5"),
    "augmented": (THREE, "center = 1\naugment_to = 22\ncriterion = 'I'\nseed = 2"),
    "whole-plots": (THREE, "kind = 'optimal'\nruns = 12\nblocks = [4, 4, 4]\nblock_variance = 2.0"),
    "covariance": (TWO, "kind = 'optimal'\nruns = 6\ncovariance = 'covariance.csv'"),
    "file": (TWO, "kind = 'file'\nfile = 'points.csv'\naugment_to = 9"),
    "candidates": (TWO, "kind = 'optimal'\nruns = 7\ncandidates = 'candidates.csv'"),
    "own": (TWO, "kind = 'simulator:spiral'\nruns = 8\nseed = 6"),
    "linear": (FIVE, "kind = 'optimal'\nruns = 9" + FIRST),
    "terms": (THREE, "kind = 'optimal'\nruns = 11\n[surface]\nterms = ['FO', 'A*B', 'C^2']"),
    "cubic": (TWO, "kind = 'optimal'\nruns = 14\nseed = 2\n[surface]\norder = 3"),
}
GOOD = study(BEAM, searches=search("light", "'mass_kg'", "subject_to = ['sag_mm <= 4']"))
WRONG = {
    "many": GOOD.replace("low = 20", "low = 'ten'")
    .replace("500.0", "'heavy', ribs = 1")
    .replace("mass_kg'", "mas_kg'")
    .replace("[responses]", "[design]\ncentres = 3\nstar = 'odd'\nruns = 5\n[verfy]\n[responses]"),
    "bounds": GOOD.replace("low = 20", "low = 70"),
    "levels": GOOD.replace("[1.0, 1.5, 2.5]", "[1.0, 'two']"),
    "constraint": GOOD.replace("sag_mm <= 4", "sag_mm"),
    "expression": GOOD.replace("'mass_kg'", "'mass_kg + __import__(1)'"),
    "twice": GOOD + search("light", "'mass_kg'"),
    "empty": "name = 'x'\n",
    "toml": "x = [1",
    "nothing": GOOD.replace("simulator:beam", "simulator:bean"),
    "nomodule": GOOD.replace("simulator:beam", "simulatr:beam"),
    "raises": GOOD.replace("'steel', 'aluminium', 'titanium'", "'steel', 'wood', 'paper'"),
    "options": GOOD + "[surface]\nreduction = 'all'\nmodel = 'stretched'\nstretch = 'odd'\n",
    "toofew": study(box(3), design="kind = 'optimal'\nruns = 4"),
    "noroom": study(box(2), design="kind = 'sobol'\nruns = 5\nsubject_to = ['A + B <= -10']"),
    "noruns": study(box(2), design="kind = 'halton'"),
    "less": study(box(2), design="augment_to = 5"),
    "nofile": study(box(2), design="kind = 'file'\nfile = 'points.csv'"),
    "odd": study(box(2), design="kind = 'plackett-burman'\nruns = 13"),
    "fold": study(box(3), design="kind = 'fractional-factorial'\nruns = 6"),
}
BAD_TABLES = {
    "ragged.csv": "x,y\n1,2\n3\n4,5\n",
    "text.csv": "x,y\n1,2\nthree,4\n5,6\n7,8\n",
    "constant.csv": "x,y\n1,2\n1,3\n1,4\n",
    "few.csv": "x,y\n1,2\n2,3\n",
    "head.csv": "x,y\n",
    "huge.csv": "x,y\n1,2\n2,1e300\n3,1\n4,4\n",
}
