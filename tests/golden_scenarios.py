"""What ``golden.py`` runs: scenarios by name, each a sequence of steps (see ``golden.run_scenario``)."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from golden_studies import (
    BAD_TABLES,
    BEAM,
    ENTRY,
    FAST,
    FEW_MORE,
    PLANS,
    SEARCH_BASE,
    SEARCHES,
    STEEP,
    SURFACE_BASE,
    SURFACES,
    WRONG,
    search,
    study,
)

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT / "tests" / "data"
Step = str | tuple[str, ...] | Callable[[Path], None]


def write(**files: str) -> Step:
    """Write study files, by folder; each folder also gets the simulator."""

    def step(work: Path) -> None:
        for folder, text in files.items():
            (work / folder).mkdir()
            (work / folder / "study.toml").write_text(text)
            shutil.copy(DATA / "golden" / "simulator.py", work / folder)

    return step


def put(name: str, text: str) -> Step:
    """Write one file."""
    return lambda work: (work / name).write_text(text) and None


def edit(name: str, old: str, new: str) -> Step:
    """Replace a text that is there."""

    def step(work: Path) -> None:
        text = (work / name).read_text()
        if old not in text:
            raise ValueError(f"{name} has no {old!r}")
        (work / name).write_text(text.replace(old, new, 1))

    return step


def copies(base: str, texts: Mapping[str, str]) -> Step:
    """Copies of a study that has been run, each with a study file of its own."""

    def step(work: Path) -> None:
        for name, text in texts.items():
            shutil.copytree(work / base, work / name, ignore=shutil.ignore_patterns("*.html", "model.json"))
            (work / name / "study.toml").write_text(text)

    return step


def bring(*sources: Path) -> Step:
    """Copy folders or files of the repository, without what a study has left there."""

    def step(work: Path) -> None:
        left = ("*.json", "*.jsonl", "design.csv", "responses.csv", "*.html", "runs", "*.log", "history-*")
        for source in sources:
            if source.is_dir():
                ignored = shutil.ignore_patterns(*left, "*.ipynb", "__pycache__", ".rsmkit*")
                shutil.copytree(source, work / source.name, ignore=ignored)
            else:
                shutil.copy(source, work / source.name)

    return step


RUN = "run {0} -j 1 --json"


def whole(text: str, *more: str) -> list[Step]:
    """Run one study from plan to verification."""
    return [write(s=text), RUN.format("s"), *more]


COMMANDS = (
    *("new", "check", "plan", "evaluate", "fit", "verify", "run", "status", "explore", "sheet", "record"),
    "completion",
)
HELP = [
    ("--help", "", *(f"{command} --help" for command in COMMANDS)),
    ("--version", "completion bash", "completion zsh", "completion fish"),
    "python -m rsmkit.reference study-file",
    "python -m rsmkit.reference commands",
]

TEMPLATE = [
    "new study",
    ("new study", "status study", "status study --json", "evaluate study", "fit study", "verify study"),
    "check study",
    "check study --json",
    "plan study",
    ("plan study --json", "evaluate study --dry-run", "evaluate study --dry-run --json"),
    "evaluate study --only 1-3,14 -j 1 --no-color",
    "evaluate study --limit 2 -j 1 -q",
    ("status study --json", "fit study"),
    "evaluate study -j 1",
    "fit study",
    ("fit study", "fit study --force --json", "status study"),
    "verify study -j 1",
    "verify study --tolerance 1e-12 --json",
    (
        "explore study --no-open --json",
        "status study",
        "status study --json",
        "run study",
        "run study --json",
    ),
]

LATER = [
    "new study",
    "run study -q -j 1",
    edit("study/study.toml", "high = 60.0", "high = 62.0"),
    ("status study --json", "status study", "evaluate study", "fit study --json", "verify study"),
    edit("study/study.toml", "[verify]", "[verify]\nrefine = { batch = 4, max_runs = 12 }"),
    "run study -j 2 -q",
    edit("study/study.toml", "sag_mm <= 10", "sag_mm <= 12"),
    edit("study/study.toml", "minimize ", "population = 8\ngenerations = 6\nminimize "),
    "status study",
    "run study -j 1 --json",
    "verify study --refine -j 1",
    "verify study --refine -j 1 --json",
    "verify study --against-ga --seeds 2 -j 1 --json",
    ("verify study", "plan study --compare study/design.csv", "status study"),
    "run study --force -j 1",
]

REENTRY = [
    bring(ROOT / "studies" / "reentry"),
    edit("reentry/study.toml", "[verify]", "[verify]\nrefine = { batch = 4, max_runs = 8 }"),
    "plan reentry",
    "evaluate reentry -j 1 -q",
    "fit reentry",
    "verify reentry -j 1",
    "verify reentry --refine -j 1 --json",
    ("status reentry", "fit reentry --json", "run reentry --json"),
]

LABORATORY = [
    bring(ROOT / "studies" / "laboratory"),
    ("plan laboratory", "evaluate laboratory", "sheet sheet.csv laboratory", "sheet sheet.csv laboratory"),
    put("half.csv", "time_min,temperature_F,yield_pct,viscosity_cSt,molecular_weight\n80,170,76.5,62,2940\n"),
    (
        "record half.csv laboratory --json",
        "status laboratory",
        "fit laboratory",
        "record laboratory/results.csv laboratory",
        "record laboratory/results.csv laboratory --json",
        "status laboratory --json",
        "fit laboratory",
        "fit laboratory --json",
        "sheet again.csv laboratory --json",
        "verify laboratory",
        "run laboratory",
        "check laboratory",
        "explore laboratory --no-open",
    ),
    put("wrong.csv", "time_min,temperature_F,yield_pct,viscosity_cSt\n80,170,much,62\n"),
    ("record wrong.csv laboratory", "record nowhere.csv laboratory"),
]

EXTERNAL = [
    bring(ROOT / "studies" / "external_command"),
    "check external_command --json",
    "run external_command -j 1",
    "status external_command --json",
]

ROBUST = whole(
    study(
        STEEP,
        design="star = 'faced'\ncenter = 1",
        surface="model = 'polynomial'",
        searches=search(
            "sturdy",
            "'load'",
            "robust = { noise = { y = { mean = 0.0, spread = 0.3 } }, deviations = 2.0 }\npreset = 'fast'",
        )
        + search(
            "even",
            "'load + area'",
            "subject_to = ['area <= 3.5']\nrobust = { noise = { y = { mean = 0.1, spread = 0.4, "
            "distribution = 'uniform' } }, nodes = 5 }\npreset = 'fast'",
        )
        + "[verify]\ntolerance_pct = 20.0\n",
    ),
    "verify s",
)

FLIGHTS = whole(ENTRY, "fit s", "status s --json")

MIXED = whole(
    study(
        BEAM,
        design="kind = 'optimal'\nruns = 36\ncriterion = 'I'\nseed = 2\n"
        "subject_to = ['ribs + 0.1*width_mm <= 10']",
        surface="model = 'reduced'",
        searches=search("light", "'mass_kg'", "subject_to = ['sag_mm <= 4', 'ribs >= 2']\npreset = 'fast'")
        + search("both", "['mass_kg', 'log(sag_mm)']", "population = 16\ngenerations = 10")
        + FEW_MORE,
    ),
    "verify s --refine -j 1 --json",
    ("status s",),
)

SEARCHING = [
    write(base=SEARCH_BASE),
    RUN.format("base"),
    copies("base", {name: SEARCH_BASE.partition("[[search]]")[0] + text for name, text in SEARCHES.items()}),
    tuple(f"fit {name} --json" for name in SEARCHES),
    "verify seeds -j 1 --json",
    "verify limits -j 1 --json",
    "verify pareto -j 1",
    "verify pareto -j 1 --json",
    "verify wishes -j 1",
    "verify wishes --refine -j 1 --json",
    "verify pareto --against-ga -j 1",
]

SURFACING = [
    write(base=SURFACE_BASE),
    RUN.format("base"),
    copies(
        "base",
        {
            name: SURFACE_BASE.replace("[[search]]", f"[surface]\n{t}\n[[search]]")
            for name, t in SURFACES.items()
        },
    ),
    tuple(f"{command} {name} --json" for name in SURFACES for command in ("plan", "fit")),
    "verify both -j 1",
    "verify gaussian -j 1 --json",
    "verify auto -j 1 --json",
]

FAILED = [
    write(
        troubled=study(
            STEEP | {"simulator": "run = 'simulator:troubled'\nretries = 1\nbatch = 1"},
            design="kind = 'factorial'\nlevels = 4",
            searches=search("least", "'load'", FAST),
        ),
        slow=study(
            STEEP | {"simulator": "run = 'simulator:slow'\ntimeout_s = 2\nbatch = 1"},
            design="star = 'faced'\ncenter = 1",
        ),
    ),
    RUN.format("troubled"),
    "status troubled",
    "evaluate troubled -j 1",
    "evaluate troubled --retry-failed --only 1 -j 1 --json",
    "fit troubled",
    "evaluate troubled --retry-failed --max-failures 1 -j 1 -q",
    "evaluate slow -j 1",
    "plan slow",
    "evaluate slow -j 1",
    "status slow --json",
]

NOISE = "run = 'simulator:noisy'\ndeterministic = false\nseed = 'seed'"
NOISY = [
    write(
        twice=study(
            STEEP | {"responses": "load = {}", "simulator": f"{NOISE}\nreplicates = 2"},
            design="star = 'faced'\ncenter = 3",
            searches=search("least", "'load'", FAST),
        ),
        once=study(
            STEEP | {"responses": "load = {}", "simulator": NOISE},
            design="kind = 'optimal'\nruns = 12\nreplicates = true",
            searches=search("least", "'load'", FAST),
            verify="refine = { batch = 2, max_runs = 6, noise_sd = 0.1 }",
        ),
        arrays=study(
            STEEP | {"simulator": "run = 'simulator:arrays'\nvectorized = true\nbatch = 5"},
            design="kind = 'sobol'\nruns = 16\nseed = 5",
            surface="model = 'auto'",
            searches=search("least", "'load - area'", FAST),
        ),
    ),
    RUN.format("twice"),
    RUN.format("once"),
    "verify once --refine -j 1 --json",
    RUN.format("arrays"),
    ("status twice", "status arrays --json"),
]

BLOCKS = [
    write(
        ccd=study(
            STEEP,
            design="alpha = 'orthogonal'\nblocked = true\ncenter = 3\ncenter_axial = 3",
            searches=search("least", "'load'", FAST),
        ),
        optimal=study(
            STEEP,
            design="kind = 'optimal'\nruns = 12\nblocks = [4, 4, 4]",
            searches=search("least", "'load'", FAST),
        ),
    ),
    RUN.format("ccd"),
    "sheet sheet.csv ccd",
    RUN.format("optimal"),
]

DESIGNS = [
    write(**{name: study(base, design=design) for name, (base, design) in PLANS.items()}),
    put("file/points.csv", "A,B\n0,1\n3,5\n0,5\n3,1\n1.5,3\n0.75,2.5\n"),
    put(
        "candidates/candidates.csv",
        "A,B\n" + "".join(f"{a},{b}\n" for a in (0, 1, 2, 3) for b in (1, 2, 4, 5)),
    ),
    put(
        "covariance/covariance.csv",
        "".join(",".join(str(0.5 ** abs(i - j)) for j in range(6)) + "\n" for i in range(6)),
    ),
    tuple(f"plan {name} --json" for name in PLANS),
    (
        "plan optimal-d --compare optimal-a/design.csv --compare box-behnken --json",
        "plan replicates --compare file/design.csv --compare own/design.csv",
        "plan optimal-d --compare ccd-fraction/design.csv",
        "plan sobol",
    ),
]


def examples() -> tuple[str, ...]:
    """Command lines that fit tables of published experiments."""
    catalogue = json.loads((DATA / "surfaces" / "catalogue.json").read_text())
    lines = []
    for example in catalogue:
        words = {
            "data": f"data/{Path(example['data']).name}.csv",
            "factors": ",".join(example["factors"]),
            "response": example["response"],
            "coding": example.get("coding"),
            "blocks": example.get("blocks"),
            "order": example.get("order"),
            "terms": ",".join(example.get("terms", ())) or None,
        }
        line = "fit " + " ".join(f"--{key} {word}" for key, word in words.items() if word is not None)
        lines += [line, f"{line} --json"]
    return tuple(dict.fromkeys(lines))


TABLES = [
    bring(ROOT / "studies" / "laboratory" / "results.csv", ROOT / "studies" / "robust_design.csv"),
    lambda work: (work / "data").mkdir(),
    lambda work: (
        [shutil.copy(path, work / "data") for path in sorted((DATA / "surfaces").rglob("*.csv"))] and None
    ),
    put("weights.csv", "x;y;w\n1,0;2,1;1\n2,0;3,9;1\n3,0;6,2;2\n4,0;8,1;0\n5,0;9,7;1\n6,0;12,4;1\n"),
    examples(),
    (
        "fit --data weights.csv --factors x --response y --weights w --order 1",
        "fit --data results.csv --factors time_min,temperature_F --response yield_pct --coding "
        "time_min=85:5,temperature_F=175:5",
        "fit --data robust_design.csv --factors theta_c1_deg,theta_c2_deg,nose_radius_m --response "
        "heat_MJ_m2,axial_1e8 --blocks entry --json",
        "fit --data data/montgomery_ccd.csv --factors x1,x2 --response y1,y2,y3 --json",
        "fit --data data/strd_Filip.csv --factors x --response y --order 10 --json",
        "fit --data data/strd_Longley.csv --factors x1,x2,x3,x4,x5,x6 --response y --order 1 --json",
        "fit --data data/strd_NoInt1.csv --factors x --response y --terms 0,FO",
    ),
]

ERRORS = [
    write(**WRONG),
    *(put(name, text) for name, text in BAD_TABLES.items()),
    tuple(f"plan {name}" for name in WRONG),
    (
        *(f"fit --data {name} --factors x --response y" for name in BAD_TABLES),
        "status nowhere",
        "status nowhere --json",
        "plan many --json",
        "fit --data nowhere.csv --factors x --response y --json",
        "fit --data few.csv --factors x,z --response y",
        "fit --data few.csv --factors x",
        "fit --data few.csv --factors x --response y --coding x1=5",
        "fit --data few.csv --factors x --response y --terms x*w",
        "fit --factors x --response y",
        "run nothing --backend cloud",
        "run nothing -j 0",
        "evaluate nothing --only 3-1",
        "evaluate nothing --only x",
        "frob",
        "plan nothing --colour",
        "completion tcsh",
        "record nowhere.csv nothing",
        "plan nothing --compare nowhere.csv",
    ),
    "check nothing",
    "check nomodule",
    "check nomodule --json",
    "check raises",
    put("nothing/plan.json", "{"),
    ("evaluate nothing", "status nothing"),
]

PYTHON = [
    bring(ROOT / "studies" / "laboratory", DATA / "golden" / "simulator.py", DATA / "golden" / "api.py"),
    "python api.py",
]

SCENARIOS: dict[str, list[Step]] = {
    "reentry": REENTRY,  # the longest first, so that others run beside it
    "searches": SEARCHING,
    "surfaces": SURFACING,
    "designs": DESIGNS,
    "later": LATER,
    "mixed": MIXED,
    "failed": FAILED,
    "noisy": NOISY,
    "template": TEMPLATE,
    "errors": ERRORS,
    "tables": TABLES,
    "external": EXTERNAL,
    "robust": ROBUST,
    "robust-flights": FLIGHTS,
    "blocks": BLOCKS,
    "laboratory": LABORATORY,
    "python": PYTHON,
    "help": HELP,
}
