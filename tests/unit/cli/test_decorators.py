"""What commands read from their options."""

import click
import pytest

from rsmkit.cli.decorators import Rows


@pytest.mark.parametrize(("text", "rows"), [("3", (3,)), ("3,7-9", (3, 7, 8, 9)), ("2-2", (2,))])
def test_rows(text, rows):
    assert Rows().convert(text, None, None) == rows


@pytest.mark.parametrize("text", ["", "a", "3-1", "1-2-3"])
def test_rows_that_are_none(text):
    with pytest.raises(click.BadParameter, match="not a list of rows"):
        Rows().convert(text, None, None)
