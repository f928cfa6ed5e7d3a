"""``verify --uncertainty N`` on a study: runs, journal, verdict."""

import json

from click.testing import CliRunner
from served_study import STUDY

from rsmkit.cli import main
from rsmkit.stages.evaluate import evaluate_design
from rsmkit.stages.fit import fit_study
from rsmkit.stages.planning.plan import plan_design
from rsmkit.stages.service.prove import prove_study
from rsmkit.study.folder import open_study


def prepared(tmp_path, text=STUDY):
    (tmp_path / "study.toml").write_text(text)
    folder = open_study(tmp_path)
    plan_design(folder)
    evaluate_design(folder)
    fit_study(folder)
    return folder


def test_runs_are_kept_and_compared_with_what_was_promised(tmp_path):
    folder = prepared(tmp_path, STUDY.replace('load_N = { law = "normal", sd_pct = 2 }\n', ""))
    before = len((tmp_path / "runs.jsonl").read_text().splitlines())
    result = prove_study(folder, 20)
    made = len((tmp_path / "runs.jsonl").read_text().splitlines()) - before
    assert made == 20
    document = json.loads((tmp_path / "uncertainty.json").read_text())
    mass = document["responses"]["mass_kg"]["true"]
    # mass is a product of both factors, which the surface has exactly
    assert mass["verdict"] == "CONFIRMED"
    assert abs(mass["mean"] / document["responses"]["mass_kg"]["mean"] - 1.0) < 1e-9
    assert {"out_of_specification", "out_low", "out_high", "out_gain", "sd_gain", "quantiles"} <= set(mass)
    assert document["true"]["runs"] == 20
    assert result.exit_code == (0 if result.confirmed else 5)
    again = prove_study(open_study(tmp_path), 20)
    assert again.found.to_json() == result.found.to_json()
    assert len((tmp_path / "runs.jsonl").read_text().splitlines()) == before + 20


def test_settings_vary_in_the_runs_alone(tmp_path):
    folder = prepared(tmp_path)
    result = prove_study(folder, 12)
    assert result.found.true["verdict"] == "NOT COMPARED"
    assert "load_N" in result.found.true["sentence"]
    lines = (tmp_path / "runs.jsonl").read_text().splitlines()
    loads = {json.loads(line).get("factors", {}).get("load_N") for line in lines}
    assert len(loads - {None}) == 12
    # sag is proportional to the load: 2 % more of it
    sag = result.found.responses["sag_mm"]
    assert sag.true["sd"] > sag.sd


def test_the_command_line_says_what_was_found(tmp_path):
    prepared(tmp_path, STUDY.replace('load_N = { law = "normal", sd_pct = 2 }\n', ""))
    done = CliRunner().invoke(main, ["verify", str(tmp_path), "--uncertainty", "6", "-j", "1"])
    assert "Service, proven  6 runs under the laws" in done.output
    assert done.exit_code in (0, 5), done.output
    refused = CliRunner().invoke(main, ["verify", str(tmp_path), "--uncertainty", "0"])
    assert refused.exit_code == 2
