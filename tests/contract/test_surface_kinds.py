"""Every row of the register of surface kinds keeps the contract, and one's own is a kind like the rest."""

import json
import logging
import re
from dataclasses import replace

import numpy as np
import pytest
from toy_surface import ROW, RadialSurface

from rsmkit.cli import main
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.reference import study_reference
from rsmkit.scikit_learn import SurfaceRegressor
from rsmkit.surfaces.choose import choose_surface
from rsmkit.surfaces.kinds import KINDS, ModelFit, words
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.testing import check_surface_kind


@pytest.fixture
def radial(monkeypatch):
    """The register with a row more."""
    monkeypatch.setitem(KINDS, "radial", ROW)


@pytest.mark.parametrize("word", KINDS)
def test_contract(word):
    found = check_surface_kind(word)
    assert found.surface.form == KINDS[word].makes


def test_contract_of_a_kind_of_ones_own(radial):
    found = check_surface_kind("radial")
    assert isinstance(found.surface, RadialSurface)
    assert found.remark == "through every run"


def test_contract_on_runs_of_ones_own(radial):
    rng = np.random.default_rng(0)
    points = rng.uniform(size=(12, 2))
    found = check_surface_kind(
        "radial", space=Space(a=(0, 1), b=(0, 1)), points=points, y=points.sum(axis=1) ** 2
    )
    assert len(found.surface.data) == 12


# ---------------------------------------------------------------- what the contract notices


def broken(**methods):
    """The row with a surface that differs in some methods."""
    made = type("Broken", (RadialSurface,), methods)

    def fit(request):
        surface = made(request.space, request.response, request.data)
        return ModelFit(surface, float(surface.errors @ surface.errors))

    return replace(
        ROW, fit=fit, form=lambda: replace(ROW.form(), read=lambda d: made(**vars(ROW.form().read(d))))
    )


def swapped(self, points, interval=None, kind="prediction"):
    found = RadialSurface.predict(self, points, interval, kind)
    return found if interval is None else (found[0], found[2], found[1])


def narrowing(self, points, interval=None, kind="prediction"):
    return RadialSurface.predict(self, points, None if interval is None else 1.0 - interval, kind)


def flat(self, points, interval=None, kind="prediction"):
    found = RadialSurface.predict(self, points, interval, kind)
    return found[:1] if interval is None else found


@pytest.mark.parametrize(
    ("row", "message"),
    [
        (broken(predict=swapped), "in disorder"),
        (broken(predict=narrowing), "shrinks with more confidence"),
        (broken(predict=flat), r"predicts shape \(1,\) for 20 points"),
        (broken(gradient=lambda self, x: 1.01 * RadialSurface.gradient(self, x)), "gradient by a is off"),
        (broken(gradient=lambda self, x: np.ones((len(x), 1))), "gradient has shape"),
        (broken(to_json=lambda self: {**RadialSurface.to_json(self), "more": 1}), "without 'more'"),
        (
            replace(ROW, form=lambda: replace(ROW.form(), newer=("runs",))),
            "cannot be read from an older file, without 'runs'",
        ),
        (broken(form="another"), "its surface is 'another'"),
        (
            replace(ROW, fit=lambda r: ModelFit(RadialSurface(r.space, "z", r.data), 1.0)),
            "renames the response",
        ),
        (replace(ROW, options=("colour",)), "options that there are not: colour"),
        (replace(ROW, fit=lambda request: ModelFit(ROW.fit(request).surface, 0.0)), "were not left out"),
        (replace(ROW, fit=lambda request: ModelFit("surface", 1.0)), "makes a str"),
        (replace(ROW, form=lambda: replace(ROW.form(), report=lambda s: {})), "does not name its response"),
        (
            replace(ROW, form=lambda: replace(ROW.form(), html=lambda s, report: s.response)),
            "takes the response's name for HTML",
        ),
        (
            replace(ROW, form=lambda: replace(ROW.form(), page=lambda s, confidence: {})),
            "do not name their function",
        ),
    ],
)
def test_broken_contracts_are_noticed(monkeypatch, row, message):
    monkeypatch.setitem(KINDS, "radial", row)
    with pytest.raises(AssertionError, match=message):
        check_surface_kind("radial")


def test_a_kind_that_is_none_is_named():
    with pytest.raises(AssertionError, match="no kind 'radial'"):
        check_surface_kind("radial")


# ---------------------------------------------------------------- a row more is a word more


def test_the_word_is_known_everywhere(radial):
    assert words()[-2:] == ("radial", "auto")
    assert SurfaceOptions(model="radial").problems() == []
    assert '`"radial"`' in study_reference()
    x = np.random.default_rng(1).uniform(size=(15, 2))
    y = x[:, 0] ** 2 + x[:, 1]
    regressor = SurfaceRegressor("radial").fit(x, y)
    np.testing.assert_allclose(regressor.predict(x), y, rtol=1e-9)


def test_without_its_row_it_is_no_word():
    (problem,) = SurfaceOptions(model="radial").problems()
    assert problem[0] == "model"
    with pytest.raises(RsmkitError, match=r"surface model must be polynomial, .* or auto; got 'radial'"):
        choose_surface(
            Space(a=(0, 1)), [[0.0], [0.5], [1.0]], [1, 2, 3], options=SurfaceOptions(model="radial")
        )


def test_auto_compares_it_with_the_others(radial):
    """A kink, which no polynomial follows."""
    space = Space(a=(-1.0, 1.0))
    x = np.linspace(-1, 1, 21)[:, None]
    found = choose_surface(space, x, np.abs(x[:, 0] - 0.05), options=SurfaceOptions(model="auto"))
    assert "radial" in {row.model for row in found.table}


@pytest.mark.slow
@pytest.mark.e2e
def test_a_study_goes_through_all_stages(radial, tmp_path, monkeypatch, capsys):
    def rsmkit(*words):
        """Run a command in this process, which alone knows the kind; give what it printed."""
        with pytest.raises(SystemExit) as end:
            main(list(words))
        assert end.value.code == 0
        return capsys.readouterr().out

    monkeypatch.chdir(tmp_path)
    rsmkit("new", "study")
    file = tmp_path / "study" / "study.toml"
    file.write_text(file.read_text().replace("order = 2 ", 'model = "radial"\norder = 2 '))
    document = json.loads(rsmkit("run", "study", "-j", "1", "--json"))
    assert [stage["stage"] for stage in document["stages"]] == ["plan", "evaluate", "fit", "verify"]
    (search,) = json.loads((tmp_path / "study" / "verification.json").read_text())["searches"]
    assert search["verdict"] == "CONFIRMED"
    surface = json.loads((tmp_path / "study" / "model.json").read_text())["responses"]["sag_mm"]["surface"]
    assert surface["model"] == "radial"
    page = (tmp_path / "study" / "explorer.html").read_text()
    assert (
        "This kind of surface cannot be drawn live here: mass [kg] (radial), tip deflection [mm] (radial)"
        in page
    )
    data = json.loads(
        re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1]
    )
    assert [response["model"] for response in data["responses"]] == [None] * 3
    assert data["reports"]["sag_mm"]["model"] == "radial"
    verified = json.loads((tmp_path / "study" / "verification.json").read_text())["searches"]
    assert json.loads(rsmkit("status", "study", "--json"))["next"] == verified[0]["next_step"]
    for handler in logging.getLogger("rsmkit").handlers:
        handler.close()
