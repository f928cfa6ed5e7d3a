from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rsmkit.design.design import Design
from rsmkit.design.families.two_level.factorial import full_factorial
from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space

SPACE = Space(angle_deg=(5, 10), radius_m=(0.15, 0.30), gas=["air", "CO2, dry"])


def example() -> Design:
    points = [[5.0, 0.3, 0], [1 / 3, 0.1 + 0.2, 1], [-7e-17, 1e23, 1]]
    return Design(SPACE, np.array(points), ("axial", "center", "given"), (1, 1, 2))


def written(tmp_path, text: str):
    path = tmp_path / "design.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_every_bit_survives_the_file(tmp_path):
    design = example()
    design.to_csv(tmp_path / "design.csv")
    back = Design.from_csv(tmp_path / "design.csv", SPACE)
    assert back.points.tobytes() == design.points.tobytes()
    assert (back.kinds, back.blocks) == (design.kinds, design.blocks)


def test_file_has_natural_and_coded_columns(tmp_path):
    space = Space(angle_deg=(5, 10), radius_m=(0.25, 0.5), gas=["air", "CO2, dry"])
    Design(space, np.array([[10.0, 0.25, 1]]), ("axial",)).to_csv(tmp_path / "design.csv")
    head, row = (tmp_path / "design.csv").read_text().splitlines()
    assert head == "run,kind,angle_deg,radius_m,gas,angle_deg_coded,radius_m_coded,gas_coded"
    assert row == '1,axial,10.0,0.25,"CO2, dry",1.0,-1.0,1.0'


def test_a_table_of_natural_columns_alone_is_enough(tmp_path):
    path = written(tmp_path, "\ufeffgas,angle_deg,radius_m\nair,6,0.2\n\n")
    design = Design.from_csv(path, SPACE)
    assert design.kinds == ("given",)
    assert design.points.tolist() == [[6.0, 0.2, 0.0]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("angle_deg,gas\n5,air\n", "no column for radius_m"),
        ("angle_deg,angle_deg,radius_m,gas\n5,5,0.2,air\n", "angle_deg appears twice"),
        ("angle_deg,radius_m,gas\n", "no runs"),
        ("angle_deg,radius_m,gas\n5,0.2\n", "line 2 has 2 values for 3 columns"),
        ("angle_deg,radius_m,gas\n5,x,air\n", "line 2, column radius_m: 'x' is not a number"),
        ("angle_deg,radius_m,gas\n5,0.2,air\n5,inf,air\n", "line 3, column radius_m: 'inf' is not a finite"),
        ("angle_deg,radius_m,gas\n5,0.2,helium\n", "'helium' is not one of air, CO2, dry"),
        ("angle_deg,radius_m,gas,block\n5,0.2,air,a\n", "column block: 'a' is not a whole number"),
        ("angle_deg,radius_m,gas,angle_deg_coded\n5,0.2,air,0.5\n", "angle_deg_coded is 0.5 but"),
        ('angle_deg,radius_m,gas\n5,0.2,"air\n', "not a CSV table"),
    ],
)
def test_a_damaged_table_is_explained(tmp_path, text, message):
    with pytest.raises(RsmkitError, match=message):
        Design.from_csv(written(tmp_path, text), SPACE)


def test_a_missing_file_is_explained(tmp_path):
    with pytest.raises(RsmkitError, match="cannot be read"):
        Design.from_csv(tmp_path / "none.csv", SPACE)


def test_points_of_the_wrong_shape_are_refused():
    with pytest.raises(RsmkitError, match="shape"):
        Design(SPACE, np.zeros((2, 2)), ("given", "given"))
    with pytest.raises(RsmkitError, match="finite"):
        Design(SPACE, np.full((1, 3), np.nan), ("given",))
    with pytest.raises(RsmkitError, match="kinds"):
        Design(SPACE, np.zeros((2, 3)), ("given",))


def test_points_cannot_be_changed_afterwards():
    with pytest.raises(ValueError, match="read-only"):
        example().points[0, 0] = 1.0


def test_selection_keeps_kinds_and_blocks():
    chosen = example().select([2, 0])
    assert chosen.kinds == ("given", "axial")
    assert chosen.blocks == (2, 1)


def test_html_escapes_and_names_levels():
    shown = Design(Space(gas=["<air>", "CO2"]), np.array([[0.0]]), ("given",))._repr_html_()
    assert "&lt;air&gt;" in shown


def test_factors_may_be_called_as_our_own_columns_are(tmp_path):
    space = Space(kind=["red", "green"], run=(1.0, 2.0), block=(0.0, 1.0), run_coded=(5.0, 6.0))
    design = full_factorial(space)
    blocked = replace(design, blocks=(1, 2) * (len(design) // 2), kinds=("corner",) * len(design))
    for made in (design, blocked):
        made.to_csv(tmp_path / "design.csv")
        again = Design.from_csv(tmp_path / "design.csv", space)
        assert (again.points == made.points).all()
        assert (again.kinds, again.blocks) == (made.kinds, made.blocks)


NUMBERS = Space(a=(0.0, 1.0), b=(-2.0, 5.0))
POINTS = np.array([[0.1, -1.7], [1.0, 5.0], [0.3, 2.5e-3]])


@pytest.mark.parametrize("blocks", [(), (1, 2, 2)])
def test_a_table_of_ours_and_one_of_a_person_read_the_same(tmp_path, blocks):
    Design(NUMBERS, POINTS, ("center", "", "axial"), blocks).to_csv(tmp_path / "d.csv")
    text = (tmp_path / "d.csv").read_text()
    (tmp_path / "person.csv").write_text(text.replace("a_coded", '"a_coded"', 1))
    ours = Design.from_text(text, "d.csv", NUMBERS)
    theirs = Design.from_csv(tmp_path / "person.csv", NUMBERS)
    for found in (ours, theirs):
        np.testing.assert_array_equal(found.points, POINTS)
        assert (found.kinds, found.blocks) == (("center", "given", "axial"), blocks)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("-1.7,", "-1.7x,"), "line 2, column b: '-1.7x' is not a number"),
        (("-1.7,", "nan,"), "line 2, column b: 'nan'"),
        (("-1.7,", "-1.6,"), "b_coded is"),
        (("\n3,", "\n3,3,"), "line 4 has 7 values for 6 columns"),
        (("\n2,", ",9\n2,"), "line 2 has 7 values for 6 columns"),
        (("\n3,axial", "\n\naxial"), "line 5 has 5 values for 6 columns"),
    ],
)
def test_what_is_wrong_in_a_table_of_ours_is_named_all_the_same(tmp_path, change, message):
    Design(NUMBERS, POINTS, ("center", "", "axial")).to_csv(tmp_path / "d.csv")
    text = (tmp_path / "d.csv").read_text().replace(*change, 1)
    with pytest.raises(RsmkitError) as caught:
        Design.from_text(text, "d.csv", NUMBERS)
    assert message in str(caught.value)
