"""What surfaces promise of service beside what runs of the simulator say of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rsmkit.variation.conformity.proof import Estimate, Proof, ResponseProof
from rsmkit.variation.findings_of_laws import ResponseUncertainty, Uncertainty

__all__ = ["CONFIRMED", "with_truth"]

CONFIRMED, REFUTED, OPEN = "CONFIRMED", "NOT CONFIRMED", "NOT COMPARED"


def with_truth(found: Uncertainty, proof: Proof, settings: tuple[str, ...] = ()) -> Uncertainty:
    """Put the truth beside what surfaces promise.

    Parameters
    ----------
    found : Uncertainty
        From the surfaces.
    proof : Proof
        From runs.
    settings : tuple of str
        Settings that the runs varied and surfaces know nothing of: then there is nothing to compare.
    """
    responses = {
        name: replace(own, true=_response(own, proof.responses[name], settings))
        if name in proof.responses
        else replace(own, true=None)
        for name, own in found.responses.items()
    }
    verdicts = [own.true["verdict"] for own in responses.values() if own.true]
    true: dict[str, Any] = {"runs": proof.runs, "failed": proof.failed, "verdict": _worst(verdicts)}
    if proof.outside is not None:
        true |= _outside(proof.outside)
    true["sentence"] = _sentence(true, responses, settings)
    return replace(found, responses=responses, true=true)


def _worst(verdicts: list[str]) -> str:
    return next((word for word in (REFUTED, OPEN, CONFIRMED) if word in verdicts), "FAILED")


def _response(own: ResponseUncertainty, proof: ResponseProof, settings: tuple[str, ...]) -> dict[str, Any]:
    """The truth of one response; it confirms what was promised where the intervals of both meet."""
    wrong = [
        what
        for what, low, high, true in (
            ("mean", own.mean_low, own.mean_high, proof.mean),
            ("sd", own.sd_low, own.sd_high, proof.sd),
            ("out_of_specification", own.out_low, own.out_high, proof.outside),
        )
        if true is not None and low is not None and high is not None and not _meet(low, high, true)
    ]
    document: dict[str, Any] = {
        "verdict": OPEN if settings else REFUTED if wrong else CONFIRMED,
        "wrong": [] if settings else wrong,
        **_estimate("mean", proof.mean),
        **_estimate("sd", proof.sd),
        "quantiles": dict(proof.quantiles),
    }
    return document | (_outside(proof.outside) if proof.outside else {})


def _meet(low: float, high: float, true: Estimate) -> bool:
    room = 1e-9 * max(abs(low), abs(high))  # of two intervals without width, rounding
    return true.low - room <= high and true.high + room >= low


def _estimate(key: str, found: Estimate) -> dict[str, float]:
    return {key: found.value, f"{key}_low": found.low, f"{key}_high": found.high, f"{key}_gain": found.gain}


def _outside(found: Estimate) -> dict[str, Any]:
    return {
        "out_of_specification": found.value,
        "out_low": found.low,
        "out_high": found.high,
        "out_gain": found.gain,
    }


def _sentence(
    true: dict[str, Any], responses: dict[str, ResponseUncertainty], settings: tuple[str, ...]
) -> str:
    failed = f", {true['failed']} of which failed" if true["failed"] else ""
    told = f"{true['runs']} runs under the laws{failed}"
    if true["verdict"] == "FAILED":
        return f"{told}: too few succeeded to say anything"
    if settings:
        return f"{told}, which vary {', '.join(settings)} too: surfaces know nothing of settings"
    wrong = [
        f"the {what.replace('_', ' ')} of {name}"
        for name, own in responses.items()
        for what in (own.true or {}).get("wrong", ())
    ]
    if wrong:
        return f"{told} contradict the surfaces in {', '.join(wrong)}"
    return f"{told} agree with the surfaces"
