"""Laws of service in a study: the file, the stage, and what it leaves."""

import json

import pytest
from served_study import STUDY

from rsmkit.errors import StudyError
from rsmkit.report.paper.blocks import Grid, Picture, Text
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.hand_in import study_paper
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.service.propagate import propagate_study
from rsmkit.study.file import load_study
from rsmkit.study.folder import open_study


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    place = tmp_path_factory.mktemp("served")
    (place / "study.toml").write_text(STUDY)
    folder = open_study(place)
    plan_design(folder)
    evaluate_design(folder)
    fit_study(folder)
    return place


def test_the_stage_writes_its_file_and_keeps_it_until_something_changes(fitted):
    made = propagate_study(open_study(fitted))
    assert not made.fresh
    document = json.loads((fitted / "uncertainty.json").read_text())
    own = document["responses"]["sag_mm"]
    assert {"mean", "sd", "quantiles", "sobol", "out_of_specification", "cpk"} <= set(own)
    assert {"first", "total", "low", "high"} <= set(own["sobol"]["width_mm"])
    assert list(document["laws"]) == ["width_mm", "height_mm"]  # surfaces know nothing of settings
    assert document["name"] == "lightest"
    again = propagate_study(open_study(fitted))
    assert again.fresh
    assert again.found.to_json() == made.found.to_json()
    assert again.overview()["skipped"]
    (fitted / "study.toml").write_text(STUDY.replace("sd = 0.2", "sd = 0.3"))
    assert not propagate_study(open_study(fitted)).fresh
    (fitted / "study.toml").write_text(STUDY)


def test_the_report_to_hand_in_tells_it(fitted):
    folder = open_study(fitted)
    found = propagate_study(folder).found
    blocks = study_paper(folder).blocks
    grids = {block.title: block for block in blocks if isinstance(block, Grid)}
    assert [row[0] for row in grids["Laws"].rows] == ["width_mm", "height_mm"]
    (sag,) = [row for row in grids["Is it good enough"].rows if row[0] == "sag_mm"]
    own = found.responses["sag_mm"]
    assert sag[1:3] == ["at most 10", 100 * own.out_of_specification]
    assert sag[7] == own.cpk
    shares = {(row[0], row[1]): row[2] for row in grids["Which factor causes it"].rows}
    assert shares["mass_kg", "width_mm"] == 100 * found.responses["mass_kg"].sobol["width_mm"].total
    assert len([block for block in blocks if isinstance(block, Picture) and "factor" in block.caption]) == 1
    summary = [block.text for block in blocks[:8] if isinstance(block, Text)]
    assert any(text.startswith("In service: a specification is not kept in ") for text in summary)


def problems_of(tmp_path, old, new):
    assert old in STUDY
    (tmp_path / "study.toml").write_text(STUDY.replace(old, new))
    with pytest.raises(StudyError) as caught:
        load_study(tmp_path)
    return "\n".join(caught.value.problems)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("sd = 0.2", "sd = -0.2", "uncertainty.width_mm.sd must be positive, got -0.2"),
        ('"normal", sd = 0.2', '"norml", sd = 0.2', "uncertainty.width_mm.law must be one of normal"),
        ("sd = 0.2", "sd = 40", "uncertainty.width_mm: reaches from"),
        (
            "\nload_N = { law",
            "\nload = { law",
            "uncertainty.load: load is no factor or numeric setting",
        ),
        ("sag_mm = { high = 10 }", "sag = { high = 10 }", "specifications.sag: sag is no response"),
        ("high = 10", "", "specifications.sag_mm must have low, high or both"),
        (
            "[propagation]",
            '[correlation]\nfactors = ["width_mm", "height_mm"]\nmatrix = [[1, 2], [2, 1]]\n[propagation]',
            "2 between width_mm and height_mm does not lie between -1 and 1",
        ),
        (
            "[propagation]",
            '[correlation]\nfactors = ["width_mm", "depth"]\nmatrix = [[1, 0], [0, 1]]\n[propagation]',
            "correlation.factors: depth is no law of [uncertainty]",
        ),
        ("draws = 60", 'search = "best"', "propagation.search: best is no search (lightest)"),
        (
            "sd_pct = 2",
            'sd_pct = 2, file = "x.csv"',
            "uncertainty.load_N.file has no effect on",
        ),
        (
            'height_mm = { law = "uniform", half_width = 0.5 }',
            'height_mm = { law = "sample", file = "h.csv" }',
            "h.csv: cannot be read",
        ),
    ],
)
def test_mistakes_are_named(tmp_path, old, new, words):
    assert words in problems_of(tmp_path, old, new)


def test_a_sample_is_read_beside_the_study(tmp_path):
    (tmp_path / "h.csv").write_text("part,height_mm\n1,-0.2\n2,0.1\n3,0.4\n")
    text = STUDY.replace(
        'law = "uniform", half_width = 0.5', 'law = "sample", file = "h.csv", deviations = true'
    )
    (tmp_path / "study.toml").write_text(text)
    study = load_study(tmp_path)
    point = study.space.point({"width_mm": 40.0, "height_mm": 100.0})
    law = study.service.of_factors().at(point).laws["height_mm"]
    assert law.values.tolist() == [99.8, 100.1, 100.4]
