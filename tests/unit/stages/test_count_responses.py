"""Studies with responses that are counts: the same numbers as R's ``glm``, and what is refused.

The moths are those of ``tests/validation/surfaces/test_counts.py``: Collett (1991), by Venables & Ripley,
*Modern Applied Statistics with S*, 4th ed., section 7.2.
"""

import json

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expit
from scipy.stats import binom, norm, poisson

from rsmkit.cli import main
from rsmkit.errors import RsmkitError, StudyError
from rsmkit.language.space import Space
from rsmkit.stages.fit import fit_study
from rsmkit.study.file import load_study
from rsmkit.study.folder import open_study
from rsmkit.surfaces.choose import choose_surface
from rsmkit.surfaces.estimation.counts.count_limits import count_limits
from rsmkit.surfaces.estimation.counts.scoring import Counts

MOTHS = """
[factors]
sex = { levels = ["F", "M"] }
ldose = { low = 0, high = 5, integer = true }
[responses]
dead = { distribution = "binomial", trials = "n" }
[simulator]
run = "moths:count"
[design]
kind = "file"
file = "doses.csv"
[surface]
terms = ["FO", "TWI"]
[[search]]
minimize = "-dead"
"""
SIMULATOR = """
DEAD = {"M": (1, 4, 9, 13, 18, 20), "F": (0, 2, 6, 10, 12, 16)}
def count(sex, ldose):
    return {"dead": DEAD[sex][int(ldose)], "n": 20}
"""


def rsmkit(capsys, *words):
    with pytest.raises(SystemExit) as end:
        main(list(words))
    out = capsys.readouterr()
    return end.value.code, out.out + out.err


@pytest.fixture
def moths(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(MOTHS)
    (tmp_path / "moths.py").write_text(SIMULATOR)
    rows = [f"{sex},{dose}" for sex in "MF" for dose in range(6)]
    (tmp_path / "doses.csv").write_text("\n".join(["sex,ldose", *rows]) + "\n")
    return tmp_path


def test_a_study_of_counts_has_the_numbers_of_r(moths, capsys):
    code, out = rsmkit(capsys, "run", ".", "-j", "1", "--json")
    assert code == 0
    out = out[: out.rindex("\n}\n") + 3]  # what follows was told to the terminal
    stages = {stage["stage"]: stage for stage in json.loads(out)["stages"]}
    report = stages["fit"]["surfaces"]["dead"]
    assert (report["model"], report["distribution"]) == ("glm", "binomial")
    assert (report["deviance"], report["null_deviance"]) == pytest.approx((4.99372731, 124.87559260))
    assert report["choice"] == "dead: binomial, as it is a count."
    # R: predict(fit, data.frame(sex = "M", ldose = 5), type = "response") from the coefficients printed there
    highest = expit(-2.993541755 + 0.174986788 + 5 * (0.906036435 + 0.352912989))
    folder = open_study(moths)
    (optimum,) = folder.fitted().optima  # read from its file
    assert folder.study.space.values(optimum.best.point) == {"sex": "M", "ldose": 5}
    assert optimum.best.responses["dead"] == pytest.approx(highest, rel=1e-6)
    (verified,) = stages["verify"]["searches"]
    dead = verified["responses"]["dead"]
    assert dead["actual"] == 1.0  # 20 of 20
    assert 20 * dead["low"] == pytest.approx(round(20 * dead["low"]))
    assert dead["low"] <= highest <= dead["high"] == 1.0
    objective = verified["objectives"]["-dead"]  # its limits are those of the count
    assert (objective["low"], objective["high"]) == (-dead["high"], -dead["low"])
    assert objective["margin_of_error"] == pytest.approx(
        norm.ppf(0.975) * np.sqrt(highest * (1 - highest) / 20), rel=1e-6
    )
    assert verified["verdict"] == "CONFIRMED"
    assert fit_study(open_study(moths)).fresh  # read from its files


def test_another_number_of_trials_makes_the_model_stale(moths, capsys):
    for stage in ("plan", "evaluate", "fit"):
        assert rsmkit(capsys, stage, ".")[0] == 0
    file = moths / "study.toml"
    file.write_text(file.read_text().replace('"n"', "40"))
    assert "out of date" in open_study(moths).fit_problem()
    report = fit_study(open_study(moths)).overview()["surfaces"]["dead"]
    assert max(report["diagnostics"]["observed"]) == 0.5


@pytest.mark.parametrize(
    ("trials", "message"),
    [
        ("", "response dead, the run at sex = M, ldose = 1: 4 is neither 0 nor 1; name the trials"),
        (', trials = "m"', "responses.dead.trials = 'm': the run at sex = M, ldose = 0 has no number m; let"),
        (
            ', trials = "ldose"',
            "response dead, the run at sex = M, ldose = 0: trials of 0; it should be above 0",
        ),
        (", trials = 12", "response dead, the run at sex = M, ldose = 3: 13 of 12 trials; correct the count"),
    ],
)
def test_counts_that_cannot_be_are_named(moths, capsys, trials, message):
    file = moths / "study.toml"
    file.write_text(file.read_text().replace(', trials = "n"', trials))
    assert rsmkit(capsys, "plan", ".")[0] == rsmkit(capsys, "evaluate", ".", "-j", "1")[0] == 0
    code, out = rsmkit(capsys, "fit", ".")
    assert code == 2
    assert message in " ".join(out.split())
    assert "Traceback" not in out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ('distribution = "poisson", trials = 3', "responses.dead.trials goes with distribution = 'binomial'"),
        ("exposure = 3", "responses.dead.exposure goes with distribution = 'poisson'"),
        ('distribution = "poisson", exposure = -1', "responses.dead.exposure must be positive, got -1"),
        ('distribution = "binomial", trials = 2.5', "responses.dead.trials must be a whole number, got 2.5"),
        ('distribution = "binomial", trials = "dead"', "responses.dead.trials is the response itself"),
        ('distribution = "poisson", exposure = "sex"', "responses.dead.exposure: factor sex holds texts"),
        ('distribution = "normal"', "responses.dead.distribution"),
    ],
)
def test_options_that_mean_nothing_are_refused(moths, options, message):
    file = moths / "study.toml"
    file.write_text(file.read_text().replace('distribution = "binomial", trials = "n"', options))
    with pytest.raises(StudyError, match=message):
        load_study(moths)


@pytest.mark.parametrize(
    ("distribution", "y", "message"),
    [
        ("poisson", 0.0, "not one event in 5 runs"),
        ("binomial", 0.0, "not one success in 5 runs"),
        ("binomial", 3.0, "every trial of 5 runs a success"),
    ],
)
def test_runs_that_are_all_alike_are_said_and_estimated_with_less_bias(distribution, y, message):
    x = np.linspace(0.0, 1.0, 5)[:, None]
    counts = Counts(distribution, np.full(5, 3.0))
    choice = choose_surface(Space(a=(0, 1)), x, np.full(5, y), counts=counts, response="y")
    assert message in choice.report()["note"]
    fitted = choice.surface.predict(x)
    if distribution == "poisson":  # the constant's equation: events and half the number of coefficients
        assert 3.0 * fitted.sum() == pytest.approx(0.5 * 3, abs=1e-9)
    else:
        assert (np.abs(fitted - y / 3.0) < 0.5).all()
        assert ((fitted > 0.0) & (fitted < 1.0)).all()


def test_limits_of_a_count_average_over_what_is_not_known_of_its_mean():
    """The least k with a chance of 2.5 % (97.5 %) of a count up to k, by adaptive integration."""
    eta, error, size = np.array([0.7, -1.0, 2.0]), np.array([0.4, 1.2, 0.0]), np.array([9.0, 30.0, 5.0])
    for name, law in (
        ("poisson", lambda k, e, s: poisson.cdf(k, s * np.exp(e))),
        ("binomial", lambda k, e, s: binom.cdf(k, s, expit(e))),
    ):
        limits = np.array(count_limits(name, eta, error, size, 0.95))
        for j in range(3):
            for limit, chance in zip(limits[:, j], (0.025, 0.975), strict=True):

                def below(k, j=j, law=law):
                    if not error[j]:
                        return law(k, eta[j], size[j])
                    return quad(lambda z: norm.pdf(z) * law(k, eta[j] + error[j] * z, size[j]), -9, 9)[0]

                assert below(limit) >= chance > (below(limit - 1) if limit else 0.0)


def test_a_sheet_has_a_column_for_the_trials(moths, capsys):
    file = moths / "study.toml"
    file.write_text(file.read_text().replace('[simulator]\nrun = "moths:count"\n', ""))
    assert rsmkit(capsys, "plan", ".")[0] == 0
    assert rsmkit(capsys, "sheet", "sheet.csv", ".")[0] == 0
    head, *rows = (moths / "sheet.csv").read_text().splitlines()
    names = head.split(",")
    assert "n" in names
    filled = []
    for row in rows:
        cells = dict(zip(names, row.split(","), strict=True))
        cells["dead"] = str(int(cells["ldose"]) + 2 * (cells["sex"] == "M") + 1)
        cells["n"] = "" if cells["ldose"] == "3" else "20"
        filled.append(",".join(cells.values()))
    (moths / "filled.csv").write_text("\n".join([head, *filled]) + "\n")
    assert rsmkit(capsys, "record", "filled.csv", ".")[0] == 0
    with pytest.raises(RsmkitError, match="fill the column n of the run sheet and record it again"):
        fit_study(open_study(moths))
    (moths / "filled.csv").write_text("\n".join([head, *(r.replace(",,", ",20,") for r in filled)]) + "\n")
