"""The ``[surface]`` table of a study file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rsmkit.io.option_fields import doc, idle_options

__all__ = ["SurfaceOptions"]

STRETCHES = ("exp", "power", "natpower", "twosided", "roberts", "roberts_interior", "kumaraswamy", "beta")
STRETCHING = ("stretched", "stretched box-cox", "auto")
USED_BY = {"stretch": STRETCHING, "stretch_factors": STRETCHING, "reduction": ("reduced", "auto")}
"""Options that only some models read."""


@dataclass(frozen=True)
class SurfaceOptions:
    """Which model each response gets."""

    model: Literal[
        "polynomial", "reduced", "stretched", "box-cox", "stretched box-cox", "gaussian process", "auto"
    ] = doc(
        "polynomial: the terms below; reduced: only those that earn their place; stretched: factors mapped "
        "monotonically where that predicts clearly better; box-cox: the response transformed; auto: the one "
        "with the least leave-one-out error of all these and a cubic, the polynomial kept beside it",
        "polynomial",
    )
    order: Literal[1, 2, 3] = doc("1 linear, 2 full second order, 3 full third order", 2)
    terms: tuple[str, ...] = doc(
        "instead of all terms of that order: groups FO, TWI, PQ, SO, cubic and single terms like 'x1*x2^2'",
        (),
    )
    stretch: str = doc(
        f"family of stretched factors: {', '.join(STRETCHES)}; or a rising or falling formula of x",
        "exp",
    )
    stretch_factors: dict[str, str] = doc(
        "family or formula factor by factor; those not named stay as they are", factory=dict
    )
    reduction: Literal["aicc", "backward", "forward", "all"] = doc(
        "how terms are chosen: stepwise AICc, F tests backward or forward, or the best AICc of all subsets",
        "aicc",
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = idle_options(self, "model", USED_BY)
        pairs = [
            ("stretch", self.stretch),
            *((f"stretch_factors.{k}", v) for k, v in self.stretch_factors.items()),
        ]
        for key, word in pairs:
            if word not in (*STRETCHES, "identity") and "x" not in word:
                found.append((key, f"'{word}' is no family ({', '.join(STRETCHES)}) and no formula of x"))
        return found
