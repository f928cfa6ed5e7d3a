"""The part of the explorer page about service."""

from xml.etree import ElementTree

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.report.explorer.service_html import service_html
from rsmkit.report.findings import Findings
from rsmkit.runs.record.run_table import Runs
from rsmkit.variation.conformity.judgement import with_truth
from rsmkit.variation.conformity.proof import Estimate, Proof, ResponseProof

SPACE = rk.Space(a=(-1.0, 1.0), b=(-1.0, 1.0))


@pytest.fixture(scope="module")
def found():
    points = np.array([[a, b] for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0)])
    surfaces = {"y": rk.fit_surface(SPACE, points, points @ [2.0, 1.0], response="y", order=1)}
    laws = {"a": {"sd": 0.1}, "b": {"sd": 0.1}}
    return rk.uncertainty(surfaces, laws, specifications={"y": {"low": -0.5, "high": 0.5}}, draws=20)


def section(found):
    findings = Findings(
        "<i>", Runs(SPACE, np.empty((0, 2)), (), ("y",)), {}, {}, {"y": "a < b"}, uncertainty=found
    )
    text = service_html(findings)
    return text, ElementTree.fromstring(text)  # what is not well formed is refused


def test_it_tells_what_arrives_and_from_what(found):
    text, tree = section(found)
    bars = [rect for svg in tree.iter("svg") for rect in svg.iter("rect") if rect.find("title") is not None]
    # a causes 4/5 and b 1/5 of the variance
    assert bars[0].find("title").text == "a: 80 % of the variance"
    assert float(bars[0].get("width")) == pytest.approx(0.8 * 420 - 1, abs=0.1)
    assert len(bars) == 2 + 21 * 21
    assert "a &lt; b" in text
    # sd sqrt(0.04 + 0.01) = 0.2236, of which 0.5 is 2.236
    assert [td.text for td in tree.iter("td")][3] == "0.75"


def test_the_truth_stands_beside_the_promise(found):
    guess = Estimate(0.01, 0.0, 0.02, 0.005, 3.0)
    proof = Proof({"y": ResponseProof(guess, Estimate(0.22, 0.2, 0.24, 0.01, 2.0), {}, guess)}, guess, 20, 0)
    text, _ = section(with_truth(found, proof))
    assert "0.01 ± 0.22, 1 % outside" in text
    assert "20 runs under the laws" in text


def test_a_study_without_laws_says_nothing():
    findings = Findings("x", Runs(SPACE, np.empty((0, 2)), (), ("y",)), {})
    assert service_html(findings) == ""
