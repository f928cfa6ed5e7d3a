"""What the laws of service do, as a part of the explorer page: a table, a picture of causes, a map."""

from __future__ import annotations

from html import escape

from rsmkit.report.findings import Findings
from rsmkit.variation.findings_of_laws import DesignSpace, ResponseUncertainty, Uncertainty

__all__ = ["service_html"]

BAR, ROW = 420, 26
"""Width and height of a bar of causes, in pixels."""
SHADES = (0.85, 0.6, 0.42, 0.28, 0.18)
"""Opacity of the causes, largest first; the rest share the last."""
CELL = 12
WORTH_SAYING = 5e-4
"""Smaller shares of the variance are not told in words."""


def service_html(findings: Findings) -> str:
    """Say what the laws do to the responses; nothing where the study has none."""
    found = findings.uncertainty
    if found is None:
        return ""
    place = ", ".join(
        f"{escape(name)} = {f'{value:.5g}' if isinstance(value, float) else escape(str(value))}"
        for name, value in found.at.items()
    )
    laws = "; ".join(f"{escape(name)}: {escape(law)}" for name, law in found.laws.items())
    notes = "".join(f'<p class="fine">Note: {escape(note)}.</p>' for note in found.notes)
    true = found.true or {}
    proof = f"<p>On the simulator: {escape(str(true['sentence']))}.</p>" if "sentence" in true else ""
    space = found.design_space
    return (
        '<section id="service" aria-labelledby="service-title">'
        f'<h2 id="service-title">In service</h2><p>About {escape(found.name)} ({place}).</p>'
        f'{_table(found, findings)}{proof}{_causes(found, findings)}<p class="fine">{laws}.</p>{notes}'
        f"{_map(space) if space else ''}</section>"
    )


def _table(found: Uncertainty, findings: Findings) -> str:
    heads = ("", "mean", "standard deviation", "outside its specification", "Cpk", "true")
    head = "".join(f'<th scope="col">{text}</th>' for text in heads)
    rows = "".join(_row(findings.title(name), own) for name, own in found.responses.items())
    return (
        '<div class="scroller" tabindex="0" role="group" aria-label="Responses in service">'
        f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _row(title: str, own: ResponseUncertainty) -> str:
    outside = "–"
    if own.out_of_specification is not None and own.out_low is not None and own.out_high is not None:
        interval = f"{_percent(own.out_low)} … {_percent(own.out_high)}"
        outside = f"{_percent(own.out_of_specification)} ({interval})"
    true = own.true or {}
    told = "–" if "mean" not in true else f"{true['mean']:.5g} ± {true['sd']:.3g}"
    if "out_of_specification" in true:
        told += f", {_percent(true['out_of_specification'])} outside"
    cells = (
        f"{own.mean:.5g} ({own.mean_low:.5g} … {own.mean_high:.5g})",
        f"{own.sd:.3g} ({own.sd_low:.3g} … {own.sd_high:.3g})",
        outside,
        "–" if own.cpk is None else f"{own.cpk:.2f}",
        told,
    )
    return f'<tr><th scope="row">{escape(title)}</th>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.3g} %"


def _causes(found: Uncertainty, findings: Findings) -> str:
    """Share of each factor in the variance of each response, one bar a response."""
    bars = []
    for number, (name, own) in enumerate(found.responses.items()):
        whole = sum(share.total for share in own.sobol.values())
        if not whole > 0:
            continue
        left, top = 0.0, number * 2 * ROW
        parts = [f'<text x="0" y="{top + 14}" fill="currentColor">{escape(findings.title(name))}</text>']
        ranked = sorted(own.sobol.items(), key=lambda item: -item[1].total)
        for rank, (factor, share) in enumerate(ranked):
            width = BAR * share.total / whole
            shade = SHADES[min(rank, len(SHADES) - 1)]
            said = f"{escape(factor)}: {_percent(share.total)} of the variance"
            parts.append(
                f'<rect x="{left:.1f}" y="{top + 20}" width="{max(width - 1, 0):.1f}" height="{ROW - 8}" '
                f'fill="var(--accent)" fill-opacity="{shade}"><title>{said}</title></rect>'
            )
            left += width
        told = [(factor, share) for factor, share in ranked[:3] if share.total >= WORTH_SAYING]
        words = ", ".join(f"{escape(factor)} {_percent(share.total)}" for factor, share in told)
        parts.append(f'<text x="{BAR + 10}" y="{top + 33}" fill="currentColor">{words}</text>')
        bars.append("".join(parts))
    if not bars:
        return ""
    height = 2 * ROW * len(found.responses)
    return (
        '<div class="scroller"><svg role="img" aria-label="What causes the variance of each response" '
        f'width="{2 * BAR}" height="{height}" font-size="13">{"".join(bars)}</svg></div>'
    )


def _map(space: DesignSpace) -> str:
    """The probability that every specification is kept, folded away."""
    first, second = (escape(name) for name in space.factors)
    across, up = (len(axis) for axis in space.axes)
    cells = "".join(
        f'<rect x="{i * CELL}" y="{(up - 1 - j) * CELL}" width="{CELL}" height="{CELL}" fill="var(--accent)" '
        f'fill-opacity="{0.9 * value:.2f}"><title>{first} {space.axes[0][i]:.5g}, {second} '
        f"{space.axes[1][j]:.5g}: {_percent(value)}</title></rect>"
        for i, row in enumerate(space.probability)
        for j, value in enumerate(row)
    )
    box, told = "", f"nowhere in {_percent(space.level)} of cases"
    if space.box:
        (a_low, a_high), (b_low, b_high) = (space.box[name] for name in space.factors)
        left, right = space.axes[0].index(a_low), space.axes[0].index(a_high)
        bottom, top = space.axes[1].index(b_low), space.axes[1].index(b_high)
        box = (
            f'<rect x="{left * CELL}" y="{(up - 1 - top) * CELL}" width="{(right - left + 1) * CELL}" '
            f'height="{(top - bottom + 1) * CELL}" fill="none" stroke="currentColor" stroke-width="2"/>'
        )
        told = (
            f"in at least {_percent(space.level)} of cases in the box {first} {a_low:.5g} to {a_high:.5g}, "
            f"{second} {b_low:.5g} to {b_high:.5g}"
        )
    whole = ""
    if space.operating_box:
        text = space.sentences[-1]
        whole = f'<p class="fine">{escape(text[0].upper() + text[1:])}.</p>'
    return (
        "<details><summary>Where every specification is kept</summary>"
        f'<svg role="img" aria-label="Chance to keep every specification over {first} and {second}" '
        f'width="{across * CELL + 2}" height="{up * CELL + 2}">{cells}{box}</svg>'
        f'<p class="fine">{first} to the right ({space.axes[0][0]:.5g} to {space.axes[0][-1]:.5g}), {second} '
        f"upwards ({space.axes[1][0]:.5g} to {space.axes[1][-1]:.5g}); darker is likelier; "
        f"kept {told}.</p>{whole}</details>"
    )
