"""A catalogue of published examples: every printed number to its last digit, or why it disagrees."""

import json

import pytest
from surfaces_data import DATA

from rsmkit.surfaces.table import fit_table, parse_coding

CATALOGUE = json.loads((DATA / "catalogue.json").read_text())


def lookup(report, path):
    """Follow ``anova.FO.ss`` or ``terms.x1.estimate`` through a report."""
    value = report
    for key in path.split("."):
        if isinstance(value, list):
            value = by_name(value, key) if isinstance(value[0], dict) else value[int(key)]
        else:
            value = value[key]
    return value


def by_name(terms, name):
    return next(term for term in terms if term["name"] == name)


@pytest.mark.parametrize("example", CATALOGUE, ids=[e["source"] for e in CATALOGUE])
def test_published_numbers(example):
    fitted = fit_table(
        DATA / f"{example['data']}.csv",
        example["factors"],
        [example["response"]],
        coding=parse_coding(example.get("coding", "")),
        blocks=example.get("blocks"),
        order=example.get("order", 2),
        terms=example.get("terms", ()),
    )
    report = fitted.report()["responses"][example["response"]]
    wrong = []
    for path, text in example["printed"].items():
        half_unit = 0.5 * 10.0 ** -len(text.partition(".")[2])
        agrees = abs(lookup(report, path) - float(text)) <= half_unit * (1 + 1e-9)
        if agrees == (path in example.get("disagrees", {})):
            wrong.append((path, text, lookup(report, path)))
    assert not wrong
