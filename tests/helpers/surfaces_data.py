"""Published data sets and what R makes of them; see tests/data/surfaces/README.md."""

import csv
from collections import defaultdict
from functools import cache
from pathlib import Path

import numpy as np

from rsmkit.language.space import Space
from rsmkit.surfaces.polynomial_fit import fit_surface

DATA = Path(__file__).parents[1] / "data" / "surfaces"

# name: (file, response column, order, number of factors)
DATASETS = {
    "derringer_suich_NISTFILE_y1": ("derringer_suich_nist_file", "y1", 2, 3),
    **{f"derringer_suich_y{i}": ("derringer_suich", f"y{i}", 2, 3) for i in (1, 2, 3, 4)},
    **{f"montgomery_ccd_y{i}": ("montgomery_ccd", f"y{i}", 2, 2) for i in (1, 2, 3)},
    "montgomery_ccd_y1_WLS": ("montgomery_ccd", "y1", 2, 2),
    "montgomery_first_order": ("montgomery_first_order", "y", 1, 2),
    "nist_5311_FO": ("nist_5311", "Y", 1, 2),
    "nist_5313_FO": ("nist_5313", "Y", 1, 2),
    "nist_5314_SO": ("nist_5314", "Y", 2, 2),
    "nist_cvd_stress": ("nist_cvd", "stress", 2, 2),
    "nist_cvd_unif": ("nist_cvd", "unif", 2, 2),
    "printing_ink_mean": ("printing_ink", "ym", 2, 3),
    "printing_ink_sd": ("printing_ink", "ys", 2, 3),
}


@cache
def columns(name):
    """Columns of a data file as float arrays."""
    with open(DATA / f"{name}.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    return {key: np.array([float(row[key]) for row in rows]) for key in rows[0]}


@cache
def r_results():
    """Results of R: dataset -> quantity -> index -> value."""
    found = defaultdict(lambda: defaultdict(dict))
    with open(DATA / "r_results.csv", newline="") as file:
        for row in csv.DictReader(file):
            if row["value"] != "NA":
                found[row["dataset"]][row["quantity"]][row["index"]] = float(row["value"])
    return found


def runs(name):
    """Points, response and weights of a data set."""
    file, response, _, k = DATASETS[name]
    table = columns(file)
    points = np.column_stack([table[f"x{j + 1}"] for j in range(k)])
    weights = np.resize([1.0, 2.0, 4.0], len(points)) if name.endswith("WLS") else None
    return points, table[response], weights


@cache
def surface(name):
    """Surface of a data set whose columns are coded units already."""
    points, y, weights = runs(name)
    space = Space(**{f"x{j + 1}": (-1.0, 1.0) for j in range(points.shape[1])})
    return fit_surface(
        space, points, y, response=name, order=DATASETS[name][2], weights=weights, deterministic=False
    )


def our_name(r_name):
    """Name of a coefficient: R's ``I(x1^2)`` and ``x1:x2`` are ``x1^2`` and ``x1*x2`` here."""
    if r_name == "(Intercept)":
        return "1"
    return r_name.removeprefix("I(").removesuffix(")").replace(":", "*")
