"""Reading the flight simulator's reference numbers."""

import csv
from pathlib import Path

import numpy as np

DATA = Path(__file__).parents[1] / "data" / "flight"


def rows(name):
    """Rows of a reference table as dictionaries of text."""
    with (DATA / name).open() as file:
        return list(csv.DictReader(file))


def column(table, name):
    """One column of such rows as floats."""
    return np.array([float(row[name]) for row in table])


def closed_form(case, quantity):
    """The value of one row of closed_forms.csv; both arguments are prefixes."""
    found = [
        float(row["value"])
        for row in rows("closed_forms.csv")
        if row["case"].startswith(case) and row["quantity"].startswith(quantity)
    ]
    assert len(found) == 1, (case, quantity, len(found))
    return found[0]
