"""What a report says of service: what arrives of the laws, from which factor, is it good enough."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from rsmkit.report.paper.blocks import Block, Grid, Heading, Picture, Text
from rsmkit.report.paper.surface_chapter import picture
from rsmkit.variation.findings_of_laws import DesignSpace, ResponseUncertainty, Uncertainty

__all__ = ["service_chapter", "service_sentence"]


def service_sentence(found: Uncertainty) -> str:
    """How often specifications are not kept, and what the simulator says of it, for the summary."""
    told = []
    if found.out_of_specification is not None:
        told.append(f"a specification is not kept in {_percent(found.out_of_specification)} of cases")
    if found.true and "sentence" in found.true:
        told.append(str(found.true["sentence"]))
    return "; ".join(told)


def service_chapter(found: Uncertainty, titles: Mapping[str, str]) -> list[Block]:
    """Tell all about service.

    Parameters
    ----------
    found : Uncertainty
    titles : mapping of str to str
        Of the responses, with their units.
    """
    where = ", ".join(f"{name} = {_value(value)}" for name, value in found.at.items())
    blocks: list[Block] = [
        Heading("In service"),
        Text(f"About {found.name} ({where}) the factors vary; intervals hold {100 * found.confidence:g} %."),
        Grid("Laws", ["factor", "law"], list(found.laws.items())),
        _responses(found, titles),
        _kept(found, titles),
    ]
    if found.true and "sentence" in found.true:
        blocks.append(
            Text(f"On the simulator: {found.true['verdict']}. {found.true['sentence']}.", strong=True)
        )
        blocks.append(_true(found, titles))
    blocks.append(_causes(found, titles))
    with suppress(Exception):  # a picture that fails ends no report
        shares = picture(lambda figure: _draw_causes(figure.subplots(), found, titles), (8.5, 3.2))
        blocks.append(Picture(shares, "Share of each factor in the variance of the responses"))
    space = found.design_space
    if space is not None:
        with suppress(Exception):
            drawn = picture(lambda figure: _draw_map(figure, space), (6.0, 4.2))
            blocks.append(
                Picture(drawn, f"Chance to keep every specification over {' and '.join(space.factors)}")
            )
        blocks += [Text(f"{text[0].upper()}{text[1:]}.") for text in space.sentences]
    return blocks + [Text(f"Note: {note}.") for note in found.notes]


def _responses(found: Uncertainty, titles: Mapping[str, str]) -> Grid:
    heads = ["response", "mean", "from", "to", "standard deviation", "from", "to", "5 %", "95 %"]
    rows = [
        [titles[n], r.mean, r.mean_low, r.mean_high, r.sd, r.sd_low, r.sd_high, *_middle(r)]
        for n, r in found.responses.items()
    ]
    return Grid("What arrives", heads, rows)


def _middle(own: ResponseUncertainty) -> list[float | None]:
    return [own.quantiles.get("0.05"), own.quantiles.get("0.95")]


def _kept(found: Uncertainty, titles: Mapping[str, str]) -> Grid:
    heads = ["response", "specification", "outside [%]", "from", "to", "per million", "Cp", "Cpk", "Ppk"]
    rows: list[list[object]] = []
    for name, own in found.responses.items():
        if own.specification is not None:
            outside = [_hundred(value) for value in (own.out_of_specification, own.out_low, own.out_high)]
            capable = [_whole(own.dpm), own.cp, own.cpk, own.ppk]
            rows.append([titles[name], own.specification.text, *outside, *capable])
    whole = found.out_of_specification
    if whole is not None and len(rows) > 1:
        outside = [_hundred(value) for value in (whole.fraction, whole.low, whole.high)]
        rows.append(["any of them", "", *outside, _whole(1e6 * whole.fraction), None, None, None])
    return Grid("Is it good enough", heads, rows)


def _true(found: Uncertainty, titles: Mapping[str, str]) -> Grid:
    heads = ["response", "mean", "from", "to", "standard deviation", "outside [%]", "from", "to", "verdict"]
    rows = []
    for name, own in found.responses.items():
        true: Mapping[str, Any] = own.true or {}
        outside = [_hundred(true.get(key)) for key in ("out_of_specification", "out_low", "out_high")]
        first = [true.get(key) for key in ("mean", "mean_low", "mean_high", "sd")]
        rows.append([titles[name], *first, *outside, true.get("verdict")])
    return Grid("True runs under the laws", heads, rows)


def _causes(found: Uncertainty, titles: Mapping[str, str]) -> Grid:
    heads = ["response", "factor", "share [%]", "from", "to", "alone [%]", "sd without it", "d sd / d sd"]
    rows: list[list[object]] = []
    for name, own in found.responses.items():
        for factor, share in sorted(own.sobol.items(), key=lambda item: -item[1].total):
            parts = [_hundred(value) for value in (share.total, share.low, share.high, share.first)]
            cause = own.causes[factor]
            rows.append([titles[name], factor, *parts, cause.sd_without, cause.tightening])
    return Grid("Which factor causes it", heads, rows)


def _draw_causes(axes: Any, found: Uncertainty, titles: Mapping[str, str]) -> None:
    names = list(found.responses)
    left = np.zeros(len(names))
    for factor in found.laws:
        rows = [found.responses[name].sobol for name in names]
        shares = [100.0 * row[factor].total if factor in row else 0.0 for row in rows]
        axes.barh([titles[name] for name in names], shares, left=left, label=factor)
        left += shares
    axes.invert_yaxis()
    axes.set_xlabel("total Sobol index [%]; more than 100 where factors act together")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))


def _draw_map(figure: Any, space: DesignSpace) -> None:
    axes = figure.subplots()
    values = 100.0 * np.array(space.probability).T
    filled = axes.contourf(*space.axes, values, levels=[0, 10, 25, 50, 75, 90, 95, 99, 100])
    figure.colorbar(filled, label="every specification is kept [%]")
    if space.box:
        (left, right), (bottom, top) = (space.box[name] for name in space.factors)
        axes.plot([left, right, right, left, left], [bottom, bottom, top, top, bottom], color="black")
    axes.set_xlabel(space.factors[0])
    axes.set_ylabel(space.factors[1])


def _hundred(fraction: float | None) -> float | None:
    return None if fraction is None else 100.0 * fraction


def _whole(number: float | None) -> float | None:
    """Without what no reader of a large number wants."""
    return number if number is None or number < 1000.0 else round(number)


def _percent(found: Any) -> str:
    return f"{100 * found.fraction:.3g} % ({100 * found.low:.3g} to {100 * found.high:.3g})"


def _value(value: object) -> str:
    return f"{value:.5g}" if isinstance(value, float) else str(value)
