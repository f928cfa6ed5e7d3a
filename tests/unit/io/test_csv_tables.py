import os

import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.io.tables import csv_tables
from rsmkit.io.tables.csv_tables import (
    csv_text,
    parse_table,
    read_matrix,
    read_table,
    read_table_text,
    split_line,
    write_table,
)


def columns(table):
    return dict(zip(table.names, table.cells, strict=True))


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n1.5,x\n-2e3,y z\n",
        "a;b\r\n1,5;x\r\n-2e3;y z\r\n",
        "sep=;\na;b\n1,5;x\n-2d3;y z\n",
        "a\tb\n1,5\tx\n\u22122E3\ty z\n",
        'a b\n1.5 x\n-2e+3 "y z"\n',
        'a,b,\n"1.5" , x,\n-2D+3, "y z",\n',
        "# by hand\n\na,b\n\n1.5,x\n# and\n-2e3,y z\n,\n",
        "# a, b\n1.5,x\n-2e3,y z",
        "a,b\n1,1.5,x\n2,-2e3,y z\n",
    ],
)
def test_one_table_in_many_dialects(text):
    table = parse_table(text, "t.csv", ["a", "b"])
    assert [table.number(cell) for cell in table.texts("a")] == [1.5, -2000.0]
    assert table.texts("b") == ("x", "y z")
    assert len(table) == 2


def test_rows_know_their_line_in_the_file():
    table = parse_table('a,b\n\n1,"two\nlines"\n\n2,c\n', "t.csv")
    assert table.lines == (4, 6)
    assert table.texts("b") == ("two\nlines", "c")
    assert table.rows([False, True]).lines == (6,)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "cp1252"])
def test_encodings(tmp_path, encoding):
    path = tmp_path / "t.csv"
    mark = b"\xfe\xff" if encoding == "utf-16-be" else b""
    path.write_bytes(mark + "größe;µ\n1,5;é\n".encode(encoding))
    assert columns(read_table(path)) == {"größe": ("1,5",), "µ": ("é",)}


@pytest.mark.parametrize("data", [b"a,b\n\x81,1\n", b"\xff\xfea", b"\xef\xbb\xbfa\xff"])
def test_what_is_no_text_is_refused(tmp_path, data):
    path = tmp_path / "t.csv"
    path.write_bytes(data)
    with pytest.raises(RsmkitError, match=r"t\.csv: is not UTF-8 text; save it as CSV UTF-8"):
        read_table(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n3\n", "line 3 has 1 values for 2 columns"),
        ("a,b\n1,2,3,4\n", "line 2 has 4 values for 2 columns"),
        ('a,b\n1,"2\n', "line 2: not a CSV table"),
        ("a,b\n1," + "2" * 200_000, "line 2: not a CSV table"),
    ],
)
def test_what_is_no_table_is_refused_with_its_line(text, message):
    with pytest.raises(RsmkitError, match=rf"^t\.csv: {message}"):
        parse_table(text, "t.csv")


def test_short_rows_are_filled_on_request():
    assert columns(parse_table("a,b\n1\n2,3,4\n", "t.csv", fill=True)) == {"a": ("1", "2"), "b": ("", "3")}


def test_what_a_program_printed_has_no_comments_and_no_blanks_between_values():
    table = parse_table('# time s,"drag\n1,2\n', "out", by_program=True)
    assert table.names == ("# time s", "drag\n1,2".replace("\n1,2", " 1,2"))
    assert parse_table("a line of chatter\n1\n", "out", by_program=True).names == ("a line of chatter",)


def test_an_empty_table():
    table = parse_table("\n \n", "t.csv")
    assert (table.names, len(table)) == ((), 0)
    with pytest.raises(RsmkitError, match="has no column a"):
        table.texts("a")


def test_columns_are_found_by_their_name():
    table = parse_table("mass,mass,Speed\n1,2,3\n", "t.csv")
    with pytest.raises(RsmkitError, match="two columns are named mass"):
        table.texts("mass")
    with pytest.raises(RsmkitError, match=r"no column speed; did you mean Speed\?"):
        table.texts("speed")


@pytest.mark.parametrize("text", ["", "x", "1_000", "nan", "inf", "1e999", "1 2", "1.2.3", "0x10", "--1"])
def test_what_is_no_number(text):
    table = parse_table("a;b\n1;2\n", "t.csv")
    assert table.number(text) is None
    assert table.value(text, str) == text


def test_a_comma_that_may_mean_two_things_is_refused():
    table = parse_table('a,b\n"1,500",2\n', "t.csv")
    with pytest.raises(RsmkitError, match=r"t\.csv: '1,500' in a comma-separated file may mean"):
        table.number("1,500")


def test_the_wanted_columns_tell_the_separator():
    assert parse_table("a;b;c,d\n1,2\n", "t.csv", ["d"]).names == ("a;b;c", "d")


def test_pipes_and_huge_files_are_not_read(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(RsmkitError, match="pipe: is not a file"):
        read_table_text(tmp_path / "pipe")
    with pytest.raises(RsmkitError, match="cannot be read: Is a directory"):
        read_table_text(tmp_path)
    with pytest.raises(RsmkitError, match="cannot be read: No such file"):
        read_table_text(tmp_path / "none")
    (tmp_path / "big").write_bytes(b"a\n1\n")
    monkeypatch.setattr(csv_tables, "LARGEST_FILE_BYTES", 3)
    with pytest.raises(RsmkitError, match="big: has 0 MB; tables are read up to 0 MB"):
        read_table_text(tmp_path / "big")


@pytest.mark.parametrize(
    "text",
    ["1,2\n3,4.5\n", "1;2\n3;4,5\n", "1 2\n3 4.5\n", "1\t2\n3\t4,5\n", "# s\n1,2 # one\n\n3, 4.5\n"],
)
def test_a_matrix(tmp_path, text):
    (tmp_path / "m.csv").write_text(text)
    np.testing.assert_array_equal(read_matrix(tmp_path / "m.csv"), [[1, 2], [3, 4.5]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("1,2\n3\n", "line 2 has 1 values, the first line 2"),
        ("a,b\n1,2\n", "line 1: 'a' is not a number"),
        ("1,nan\n", "line 1: 'nan' is not a number"),
    ],
)
def test_what_is_no_matrix_is_refused(tmp_path, text, message):
    (tmp_path / "m.csv").write_text(text)
    with pytest.raises(RsmkitError, match=rf"m\.csv: {message}"):
        read_matrix(tmp_path / "m.csv")


def test_writing(tmp_path):
    write_table(tmp_path / "t.csv", [["a", "b,c"], [0.1 + 0.2, 'say "x"'], ["", "\ud800"]])
    text = 'a,"b,c"\n0.30000000000000004,"say ""x"""\n,\\ud800\n'
    assert (tmp_path / "t.csv").read_bytes() == text.encode()
    assert csv_text([]) == ""
    assert split_line('a, "b, c",d') == ["a", "b, c", "d"]
