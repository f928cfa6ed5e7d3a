"""The part of a report that only a model of a mixture has, as JSON values and in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rsmkit.surfaces.models.polynomial import PolynomialSurface
from rsmkit.surfaces.reading import number
from rsmkit.surfaces.statistics.equations.equations import equation_in, terms_in
from rsmkit.surfaces.statistics.mixtures.components import (
    mixture_of,
    places_of,
    pseudo_components,
    pseudo_coordinates,
)
from rsmkit.surfaces.statistics.mixtures.directions import component_effects, reference_point
from rsmkit.surfaces.statistics.mixtures.sequence import sequence_words, sequential_models
from rsmkit.surfaces.statistics.texts import columns_of, pairs

__all__ = [
    "blending_report",
    "equations_of_mixture",
    "mixture_report",
    "mixture_title",
    "mixture_units",
    "mixture_words",
]


def mixture_report(surface: PolynomialSurface) -> dict[str, Any]:
    """What only a mixture has: its total, pseudo-components, effects along Cox's directions."""
    mixture, pseudo = mixture_of(surface), pseudo_components(surface)
    found: dict[str, Any] = {
        "mixture": {
            "components": list(mixture.components),
            "total": mixture.total,
            "pseudo": None
            if pseudo is None
            else {
                "kind": pseudo.kind,
                "bounds": dict(zip(mixture.components, pseudo.bounds.tolist(), strict=True)),
                "length": pseudo.length,
            },
        },
        "terms_pseudo": None,
        "component_effects": _effects(surface),
    }
    coordinates = None if pseudo is None else pseudo_coordinates(surface, pseudo)
    if coordinates is not None:
        found["terms_pseudo"] = terms_in(surface, coordinates)
    elif pseudo is not None:
        found["mixture"]["pseudo_note"] = "these terms would be another model in pseudo-components"
    return found


def blending_report(surface: PolynomialSurface) -> dict[str, Any]:
    """The models from linear to full cubic blending, for least squares on independent runs."""
    return {"blending_models": sequential_models(surface)}


def _effects(surface: PolynomialSurface) -> dict[str, Any]:
    point = reference_point(surface.space, None)
    return {
        "direction": "cox",
        "reference": surface.space.values(point),
        "effects": [
            {key: value if isinstance(value, str) else number(value) for key, value in asdict(effect).items()}
            for effect in component_effects(surface)
        ],
    }


def mixture_title(surface: PolynomialSurface, report: Mapping[str, Any]) -> str:
    """Kind of model, and numbers of coefficients and of runs."""
    parts = [
        name
        for name in ("linear", "quadratic", "special cubic", "full cubic")
        if any(group.startswith(f"{name} blending") for group in surface.groups)
    ]
    process = " with process factors" if len(places_of(surface)) < len(surface.space) else ""
    text = f"Scheffe model, {parts[-1]} blending{process}, {len(report['terms'])} coefficients, "
    text += f"{surface.fit.n} runs"
    if surface.data.duplicates:
        text += f" ({surface.data.duplicates} exact repetitions counted once)"
    return text


def mixture_units(report: Mapping[str, Any]) -> str:
    """What the coefficients are coefficients of."""
    mixture = report["mixture"]
    text = f"components: {', '.join(mixture['components'])}, as proportions of {mixture['total']:.10g}"
    inside = set(mixture["components"])
    codes = [
        f"({name} - {x['center']:.6g})/{x['half_range']:.6g}"
        for name, x in report["coding"].items()
        if isinstance(x, dict) and name not in inside
    ]
    return text + (f"; coded units: {', '.join(codes)}" if codes else "")


def mixture_words(report: Mapping[str, Any]) -> list[str]:
    """Pseudo-components, effects of the components, and the models from linear to full cubic blending."""
    lines, mixture = [], report["mixture"]
    if rows := report["terms_pseudo"]:
        pseudo = mixture["pseudo"]
        text = ", ".join(
            f"({name} - {bound:.6g})/{pseudo['length']:.6g}" for name, bound in pseudo["bounds"].items()
        )
        keys = {"estimate": "estimate", "std. error": "std_error", "t": "t", "p": "p"}
        lines += ["", f"{pseudo['kind']}-pseudo-components: {text}"]
        lines += columns_of(rows, {"term": "name", **keys})
    elif "pseudo_note" in mixture:
        lines += ["", f"No coefficients in pseudo-components: {mixture['pseudo_note']}."]
    effects = report["component_effects"]
    reference = pairs({k: v for k, v in effects["reference"].items() if not isinstance(v, str)})
    lines += ["", f"Along the Cox directions through {reference}"]
    lines += columns_of(
        effects["effects"],
        {
            "component": "component", "from": "low", "to": "high", "effect": "effect", "gradient": "gradient",
            "std. error": "std_error", "t": "t", "p": "p",
        },
    )  # fmt: skip
    if "blending_models" in report:
        lines += ["", *sequence_words(report["blending_models"])]
    return lines


def equations_of_mixture(surface: PolynomialSurface) -> dict[str, str]:
    """The equation in pseudo-components, where there are any."""
    pseudo = pseudo_components(surface)
    coordinates = None if pseudo is None else pseudo_coordinates(surface, pseudo)
    return {} if coordinates is None else {"pseudo": equation_in(surface, coordinates)}
