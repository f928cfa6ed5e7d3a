"""The study file: what it means, and that every mistake in it is reported at once."""

import pytest

from rsmkit.errors import RsmkitError, StudyError
from rsmkit.study.file import load_study

GOOD = """
name = "Beam"
[simulator]
run = "beam:deflection"
settings = { load_N = 100.0, mesh = "fine", n = 3 }
[factors]
width_m  = { low = 0.1, high = 0.2, label = "width", unit = "m" }
ribs     = { low = 2, high = 8, integer = true }
material = { levels = ["steel", "aluminium"] }
[responses]
mass_kg = {}
sag_m   = { label = "sag" }
[functions]
area_m2 = "beam:area"
[design]
alpha = 1.5
[[search]]
name = "light"
minimize = "mass_kg + 2*area_m2"
subject_to = ["0 <= sag_m <= 0.01"]
[[search]]
name = "front"
minimize = ["mass_kg", "sag_m"]
[verify]
searches = ["light"]
"""


def problems_of(tmp_path, text):
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(StudyError) as caught:
        load_study(tmp_path)
    assert all(line.startswith("study.toml: ") for line in str(caught.value).splitlines())
    return list(caught.value.problems)


def test_a_good_file_is_read_completely(tmp_path):
    (tmp_path / "study.toml").write_text(GOOD)
    study = load_study(tmp_path)
    assert study.name == "Beam"
    assert study.space.names == ("width_m", "ribs", "material")
    assert [f.kind for f in study.space] == ["continuous", "integer", "categorical"]
    assert study.responses == ("mass_kg", "sag_m")
    assert study.file.simulator.settings == {"load_N": 100.0, "mesh": "fine", "n": 3}
    assert study.file.design.alpha == 1.5
    assert [s.objectives for s in study.searches] == [("mass_kg + 2*area_m2",), ("mass_kg", "sag_m")]
    assert load_study(tmp_path / "study.toml") == study


def test_the_folder_names_an_unnamed_study(tmp_path):
    (tmp_path / "study.toml").write_text(GOOD.replace('name = "Beam"', ""))
    assert load_study(tmp_path).name == tmp_path.name


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("low = 0.1", 'low = "ten"', 'factors.width_m.low must be a number, got "ten"'),
        ("low = 0.1", "low = true", "factors.width_m.low must be a number, got true"),
        ("low = 0.1", "low = nan", "factors.width_m.low must be a number, got nan"),
        ("low = 0.1", "low = 0.3", "factors.width_m: low (0.3) must be less than high (0.2)"),
        ("low = 2", "low = 2.5", "factors.ribs: an integer factor needs whole numbers for low and high"),
        ("alpha = 1.5", "centres = 3", "unknown key design.centres; did you mean center?"),
        ("[verify]", "[verfy]", "unknown key verfy; did you mean verify?"),
        ("alpha = 1.5", "center = 2.0", "design.center must be a whole number, got 2.0"),
        (
            "alpha = 1.5",
            "runs = 50",
            "design.runs has no effect on kind = 'ccd'; leave it out, or take 'fractional-factorial', "
            "'plackett-burman', 'definitive-screening', 'latin-hypercube', 'sobol', 'halton', 'maximin', "
            "'optimal' or 'module:function'",
        ),
        (
            "alpha = 1.5",
            "kind = 'sobel'",
            "design.kind must be ccd, box-behnken, factorial, fractional-factorial, plackett-burman, "
            "definitive-screening, latin-hypercube, sobol, halton, maximin, optimal, simplex-lattice, "
            "simplex-centroid, extreme-vertices, file or module:function; got 'sobel', did you mean 'sobol'?",
        ),
        ("alpha = 1.5", "kind = 3", "design.kind must be a text, got 3"),
        (
            "alpha = 1.5",
            "kind = 'my:points'\nlevels = 3",
            "design.levels has no effect on kind = 'my:points'; leave it out, or take 'factorial'",
        ),
        ("[design]\nalpha = 1.5", "[[design]]\nalpha = 1.5", "design must be a table, got [{'alpha': 1.5}]"),
        (
            "alpha = 1.5",
            "file = 'runs.csv'",
            "design.file has no effect on kind = 'ccd'; leave it out, or take 'file'",
        ),
        (
            "[design]",
            "[surface]\nreduction = 'all'\n[design]",
            "surface.reduction has no effect on model = 'polynomial'; leave it out, or take 'reduced' or "
            "'auto'",
        ),
        ("alpha = 1.5", "alpha = -1", "design.alpha must be positive, got -1"),
        ("alpha = 1.5", "augment_to = 9000000", "design.augment_to must be 1 to 10000, got 9000000"),
        ("alpha = 1.5", "center = 2000000000", "design.center must be 0 to 1000000, got 2000000000"),
        (
            "alpha = 1.5",
            'star = "odd"',
            'design.star must be one of "circumscribed", "inscribed", "faced", got "odd"',
        ),
        (
            'run = "beam:deflection"',
            'run = "beam"',
            "simulator.run must look like 'module:function', got 'beam'",
        ),
        ("mass_kg = {}", "width_m = {}", "width_m is named in factors and responses; use different names"),
        (
            "load_N",
            "width_m",
            "width_m is a factor and a simulator setting; remove it from simulator.settings",
        ),
        (
            "2*area_m2",
            "2*aera_m2",
            "search light: minimize: 'mass_kg + 2*aera_m2' uses the unknown name aera_m2; "
            "did you mean area_m2?",
        ),
        (
            "0 <= sag_m <= 0.01",
            "sag_m",
            "search light: subject_to: 'sag_m' is not a constraint; write it as 'expression <= number'",
        ),
        ('name = "front"', 'name = "light"', "search: the name light is used 2 times; give each its own"),
        (
            '["light"]',
            '["heavy"]',
            "verify.searches names heavy, which is no search (searches: light, front)",
        ),
    ],
)
def test_each_mistake_is_named_with_its_key(tmp_path, old, new, message):
    assert old in GOOD
    assert message in problems_of(tmp_path, GOOD.replace(old, new, 1))


def test_all_mistakes_of_a_table_whose_kind_says_the_keys_are_reported_together(tmp_path):
    text = GOOD.replace("alpha = 1.5", "kind = 'sobol'\nruns = 1.5\nstar = 'faced'\nsede = 2")
    assert problems_of(tmp_path, text) == [
        "design.runs must be a whole number, got 1.5",
        "design.star has no effect on kind = 'sobol'; leave it out, or take 'ccd'",
        "unknown key design.sede; did you mean seed?",
    ]


def test_all_mistakes_are_reported_together(tmp_path):
    text = (
        GOOD.replace("low = 0.1", 'low = "ten"')
        .replace("alpha = 1.5", "centres = 3")
        .replace("low = 2", "low = 9")
        .replace("2*area_m2", "2*aera_m2")
    )
    found = problems_of(tmp_path, text)
    assert len(found) == 4
    assert {line.split()[0].split(":")[0] for line in found} == {
        "factors.width_m.low",
        "unknown",
        "factors.ribs",
        "search",
    }


def test_missing_tables_are_named(tmp_path):
    assert problems_of(tmp_path, 'name = "x"') == ["factors is missing", "responses is missing"]
    empty = problems_of(tmp_path, "[factors]\n[responses]")
    assert empty[0].startswith("factors is empty")
    assert empty[1].startswith("responses is empty")


def test_broken_toml_and_missing_files_are_explained(tmp_path):
    assert "not valid TOML" in problems_of(tmp_path, "x = [1")[0]
    (tmp_path / "study.toml").write_bytes(b"name = '\xff'")
    with pytest.raises(StudyError, match="not UTF-8"):
        load_study(tmp_path)
    with pytest.raises(RsmkitError, match=r"does not exist.*rsmkit new"):
        load_study(tmp_path / "nowhere")
