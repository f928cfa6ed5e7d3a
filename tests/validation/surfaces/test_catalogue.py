"""A catalogue of published examples: every printed number to its last digit, or why it disagrees."""

import json
import re
from decimal import Decimal

import pytest
from surfaces_data import DATA

from rsmkit.surfaces.tables.coding import parse_coding
from rsmkit.surfaces.tables.table_fit import fit_table

CATALOGUE = json.loads((DATA / "catalogue.json").read_text())


def name(example):
    return f"{example['source']}: {example['locator']}"


def lookup(report, path):
    """Follow ``anova.FO.ss`` or ``terms.x1.estimate`` through a report."""
    value = report
    for key in path.split("."):
        if isinstance(value, list):
            value = value[int(key)] if key.isdigit() and not has_names(value) else by_name(value, key)
        else:
            value = value[key]
    return value


def has_names(items):
    return isinstance(items[0], dict) and "name" in items[0]


def by_name(terms, name):
    return next(term for term in terms if term["name"] == name)


@pytest.mark.parametrize("example", CATALOGUE, ids=name)
def test_every_example_says_where_it_is_printed(example):
    assert all(example[field].strip() for field in ("source", "edition", "locator"))
    has_page = re.search(r"\bpp?\. \d", example["locator"])
    assert has_page or example.get("url", "").startswith("https://")


def test_no_example_is_listed_twice():
    assert len({name(example) for example in CATALOGUE}) == len(CATALOGUE)


def test_the_documentation_counts_the_catalogue():
    numbers = sum(len(example["printed"]) for example in CATALOGUE)
    disagree = sum(len(example.get("disagrees", {})) for example in CATALOGUE)
    page = (DATA.parents[2] / "docs/validation/surfaces-published.md").read_text()
    assert f"{len(CATALOGUE)} examples, {numbers:,} printed numbers, {disagree} of which disagree" in page


@pytest.mark.parametrize("example", CATALOGUE, ids=name)
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
    assert set(example.get("disagrees", {})) <= set(example["printed"])
    wrong = []
    for path, text in example["printed"].items():
        half_unit = 0.5 * 10.0 ** Decimal(text).as_tuple().exponent
        # Where the source codes nothing, its coefficients are those of the columns as they are.
        value = lookup(report, path if "coding" in example else path.replace("terms.", "terms_natural."))
        # A tie (503.30345) may be printed either way, and rounding errors decide on which side it falls.
        agrees = abs(value - float(text)) <= half_unit + 1e-12 * abs(value)
        if agrees == (path in example.get("disagrees", {})):
            wrong.append((path, text, value))
    assert not wrong
