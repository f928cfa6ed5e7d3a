"""A new design family is one file and one row: this one goes from its study file to a verified optimum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from click.testing import CliRunner

import rsmkit.design.families.registry as register
from rsmkit.cli import main
from rsmkit.design.design import Design
from rsmkit.design.families.registry import Family
from rsmkit.design.options import DesignOptions
from rsmkit.io.json_codec import read_json
from rsmkit.io.option_fields import doc
from rsmkit.language.space import Space
from rsmkit.reference import study_reference
from rsmkit.testing import check_design_family


@dataclass(frozen=True, kw_only=True)
class SpiralOptions(DesignOptions):
    """Points on a spiral, a toy."""

    points: int = doc("points on the spiral", 12)
    turns: float = doc("turns about the centre", 2.5)

    def problems(self):
        """Report what is wrong beyond types."""
        wrong = [] if self.points > 2 else [("points", f"must be at least 3, got {self.points}")]
        return super().problems() + wrong


def make_spiral(space, options, site):
    """Outwards from the centre in the first two factors, up and down in the others."""
    t = np.linspace(0.0, 1.0, options.points)
    angle = 2.0 * np.pi * options.turns * t
    waves = [np.cos((j + 1) * angle) for j in range(len(space) - 2)]
    coded = np.column_stack([t * np.cos(angle), t * np.sin(angle), *waves])[:, : len(space)]
    coded = np.where(space.numeric, coded, 0.0)
    return Design(space, space.snap(space.decode(coded)), ("spiral",) * options.points)


@pytest.fixture(autouse=True)
def spiral(monkeypatch):
    """The one row."""
    monkeypatch.setitem(register.FAMILIES, "spiral", Family("spiral", SpiralOptions, make_spiral))


def test_it_keeps_the_contract():
    check_design_family("spiral", {"points": 9}, Space(a=(0.0, 2.0), b=(1.0, 5.0), c=(0.0, 1.0)), runs=9)


def test_the_reference_of_the_study_file_tells_of_it():
    assert '### `kind = "spiral"`\n\nPoints on a spiral, a toy.' in study_reference()
    assert "| `turns` | number | `2.5` | turns about the centre |" in study_reference()


def test_its_keys_are_checked(tmp_path):
    (tmp_path / "study.toml").write_text(
        "[factors]\na = {low = 0, high = 1}\n[responses]\ny = {}\n"
        "[design]\nkind = 'spiral'\npoints = 2\n[simulator]\nrun = 'a:b'\n"
    )
    result = CliRunner().invoke(main, ["plan", str(tmp_path)])
    assert result.exit_code == 2
    assert "design.points must be at least 3, got 2" in result.output


def test_it_leads_to_a_verified_optimum(tmp_path):
    study = tmp_path / "beam"
    assert CliRunner().invoke(main, ["new", str(study)]).exit_code == 0
    text = (study / "study.toml").read_text()
    before, table = text.split("[design]")
    after = table[table.index("\n[") :].replace("[surface]", '[surface]\nmodel = "auto"')
    (study / "study.toml").write_text(
        before + "[design]\nkind = 'spiral'\npoints = 16\nturns = 1.75\n" + after
    )
    result = CliRunner().invoke(main, ["run", str(study), "--jobs", "1"])
    assert result.exit_code == 0, result.output
    assert "  CONFIRMED" in result.output
    assert "NOT CONFIRMED" not in result.output
    assert (study / "design.csv").read_text().count(",spiral,") == 16
    made_from = read_json(study / "plan.json", "")["made_from"]["design"]
    assert made_from == {"kind": "spiral", "points": 16, "turns": 1.75}
