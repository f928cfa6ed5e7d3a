"""What the laws do to the responses, as data and as JSON (``uncertainty.json``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

from rsmkit.io.json_codec import Document, from_json, left_out_if_none
from rsmkit.language.space import Value
from rsmkit.variation.options import Specification

__all__ = ["Cause", "DesignSpace", "FactorShare", "OutOfSpecification", "ResponseUncertainty", "Uncertainty"]


@dataclass(frozen=True)
class FactorShare:
    """Sobol indices of one factor: shares of the variance of a response.

    Parameters
    ----------
    first : float
        What the factor causes alone.
    total : float
        What it has a part in.
    low, high : float
        Interval of `total`.
    first_low, first_high : float
        Interval of `first`.
    """

    first: float
    total: float
    low: float
    high: float
    first_low: float
    first_high: float


@dataclass(frozen=True)
class Cause:
    """What one law does to a response.

    Parameters
    ----------
    sd : float
        Standard deviation of the response that the factor has a part in.
    sd_without : float
        Standard deviation that would be left if the factor did not vary.
    tightening : float
        Change of the standard deviation of the response per unit of that of the factor.
    """

    sd: float
    sd_without: float
    tightening: float


@dataclass(frozen=True)
class OutOfSpecification:
    """How often something is outside its specification, with its interval."""

    fraction: float
    low: float
    high: float


@dataclass(frozen=True)
class ResponseUncertainty:
    """One response under the laws.

    Parameters
    ----------
    mean, sd : float
        Of the response in service, the noise of a run included.
    mean_low, mean_high, sd_low, sd_high : float
        Their intervals: what the surface leaves open.
    noise_sd : float
        Standard deviation of a repeated run; 0 for a deterministic simulator.
    quantiles : dict of str to float
        By probability, ``"0.05"``.
    quantile_intervals : dict of str to pair of float
    sobol : dict of str to FactorShare
        By factor, under the laws.
    sobol_box : dict of str to FactorShare
        By factor, every value within the bounds alike.
    pairs : dict of str to float
        Share that exactly two factors cause together, ``"a*b"``, under the laws.
    causes : dict of str to Cause
        By factor.
    exact : bool
        Whether mean, deviation and indices are in closed form.
    specification : Specification, optional
    out_of_specification, out_low, out_high : float, optional
        Fraction outside the specification, and its interval.
    dpm : float, optional
        Defects per million.
    cp, cpk : float, optional
        Capability, of the mean and the standard deviation.
    ppk : float, optional
        The same with the standard deviation that the surface's own uncertainty adds.
    true : dict, optional
        What runs of the simulator say; see ``docs/uncertainty.md``.
    pair_intervals : dict of str to pair of float
        Intervals of `pairs`.
    pairs_box, pair_intervals_box : dict
        The same, every value within the bounds alike.
    """

    mean: float
    sd: float
    mean_low: float
    mean_high: float
    sd_low: float
    sd_high: float
    noise_sd: float
    quantiles: dict[str, float]
    quantile_intervals: dict[str, tuple[float, float]]
    sobol: dict[str, FactorShare]
    sobol_box: dict[str, FactorShare]
    pairs: dict[str, float]
    causes: dict[str, Cause]
    exact: bool
    specification: Specification | None = left_out_if_none()
    out_of_specification: float | None = left_out_if_none()
    out_low: float | None = left_out_if_none()
    out_high: float | None = left_out_if_none()
    dpm: float | None = left_out_if_none()
    cp: float | None = left_out_if_none()
    cpk: float | None = left_out_if_none()
    ppk: float | None = left_out_if_none()
    true: dict[str, Any] | None = left_out_if_none()
    pair_intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    pairs_box: dict[str, float] = field(default_factory=dict)
    pair_intervals_box: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class DesignSpace:
    """Probability that every specification is kept, over two factors, and the largest box where it is high.

    Parameters
    ----------
    factors : pair of str
    axes : pair of tuple of float
        Nodes of each, natural units.
    probability : tuple of tuple of float
        Row by row: at each node of the first factor, all of the second.
    level : float
        What counts as high.
    box : dict of str to pair of float, optional
        The largest box of nodes in which the probability is at least `level`; none where there is no such.
    operating_box : dict of str to pair of float, optional
        A large box of all continuous factors in which it is, where more than two can move.
    """

    factors: tuple[str, str]
    axes: tuple[tuple[float, ...], tuple[float, ...]]
    probability: tuple[tuple[float, ...], ...]
    level: float
    box: dict[str, tuple[float, float]] | None = left_out_if_none()
    operating_box: dict[str, tuple[float, float]] | None = left_out_if_none()

    @property
    def sentences(self) -> list[str]:
        """Both boxes in words, as far as there are any."""
        often = f"every specification is kept in {100 * self.level:g} % of cases"
        found = []
        if self.box:
            found.append(f"{often} for {_box_text(self.box)}")
        if self.operating_box:
            found.append(f"{often} while all factors stay in {_box_text(self.operating_box)}")
        return found


@dataclass(frozen=True)
class Uncertainty(Document):
    """What the laws do to all responses about one design.

    Parameters
    ----------
    name : str
        The search whose optimum it is; ``centre`` of the space without one, ``point`` for one that was given.
    at : dict of str to value
        The design.
    laws : dict of str to str
        By factor, in words.
    confidence : float
        Of all intervals.
    responses : dict of str to ResponseUncertainty
    out_of_specification : OutOfSpecification, optional
        Any specification that is not kept.
    design_space : DesignSpace, optional
    notes : tuple of str
        What to know.
    true : dict, optional
        What runs of the simulator say of any specification; see ``docs/uncertainty.md``.
    """

    name: str
    at: dict[str, Value]
    laws: dict[str, str]
    confidence: float
    responses: dict[str, ResponseUncertainty]
    out_of_specification: OutOfSpecification | None = left_out_if_none()
    design_space: DesignSpace | None = left_out_if_none()
    notes: tuple[str, ...] = field(default=())
    true: dict[str, Any] | None = left_out_if_none()

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Uncertainty:
        """Read a document made by :meth:`to_json`; anything else raises RsmkitError."""
        return from_json(cls, document, "uncertainty.json", "Run: rsmkit fit --force")

    def summary(self) -> str:
        """Everything as text."""
        where = ", ".join(f"{name} = {_text(value)}" for name, value in self.at.items())
        lines = [f"At {where} ({self.name}), in service:"]
        lines += [f"  {name}: {law}" for name, law in self.laws.items()]
        for name, own in self.responses.items():
            lines += ["", *_response_lines(name, own)]
        if self.out_of_specification and len([r for r in self.responses.values() if r.specification]) > 1:
            lines += ["", f"Any specification not kept: {_fraction(self.out_of_specification)}"]
        if self.design_space:
            lines += [text[0].upper() + text[1:] for text in self.design_space.sentences]
        lines += [f"note: {note}" for note in self.notes]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        head = "".join(
            f"<th>{text}</th>" for text in ("response", "mean", "sd", "outside", "Cpk", "mostly from")
        )
        rows = ""
        for name, own in self.responses.items():
            out = "-" if own.out_of_specification is None else f"{own.out_of_specification:.3g}"
            cpk = "-" if own.cpk is None else f"{own.cpk:.3g}"
            most = max(own.sobol, key=lambda factor, own=own: own.sobol[factor].total, default="-")  # type: ignore[misc]
            cells = (escape(name), f"{own.mean:.6g}", f"{own.sd:.4g}", out, cpk, escape(most))
            rows += f"<tr>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"
        return f"<table><tr>{head}</tr>{rows}</table>"


def _response_lines(name: str, own: ResponseUncertainty) -> list[str]:
    lines = [
        f"{name}: mean {own.mean:.6g} ({own.mean_low:.6g} to {own.mean_high:.6g}), "
        f"sd {own.sd:.4g} ({own.sd_low:.4g} to {own.sd_high:.4g})"
    ]
    if own.specification is not None and own.out_of_specification is not None:
        found = OutOfSpecification(own.out_of_specification, own.out_low or 0.0, own.out_high or 0.0)
        cpk = "" if own.cpk is None else f", Cpk {own.cpk:.3g}"
        ppk = "" if own.ppk is None else f", Ppk {own.ppk:.3g}"
        lines.append(f"  outside {own.specification.text}: {_fraction(found)}{cpk}{ppk}")
    for factor, share in sorted(own.sobol.items(), key=lambda item: -item[1].total):
        cause = own.causes[factor]
        lines.append(
            f"  {factor}: {100 * share.total:.3g} % of the variance ({100 * share.low:.3g} to "
            f"{100 * share.high:.3g}), alone {100 * share.first:.3g} %; "
            f"without it sd {cause.sd_without:.4g}; "
            f"d sd / d sd {cause.tightening:.4g}"
        )
    return lines


def _fraction(found: OutOfSpecification) -> str:
    return (
        f"{100 * found.fraction:.3g} % ({100 * found.low:.3g} to {100 * found.high:.3g}), "
        f"{1e6 * found.fraction:.3g} per million"
    )


def _box_text(box: Mapping[str, tuple[float, float]]) -> str:
    if all(low == high for low, high in box.values()):
        return " and ".join(f"{name} = {low:.5g}" for name, (low, _) in box.items()) + " alone"
    return " and ".join(f"{name} from {low:.5g} to {high:.5g}" for name, (low, high) in box.items())


def _text(value: Value) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
