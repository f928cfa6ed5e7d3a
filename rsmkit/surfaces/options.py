"""The ``[surface]`` table of a study file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Literal

from rsmkit.errors import RsmkitError, one_of
from rsmkit.io.option_fields import doc, idle_options
from rsmkit.io.shown import Shown
from rsmkit.surfaces.kinds import AUTO, KINDS, words

__all__ = ["SurfaceOptions"]

STRETCHES = ("exp", "power", "natpower", "twosided", "roberts", "roberts_interior", "kumaraswamy", "beta")


@dataclass(frozen=True)
class SurfaceOptions(Shown):
    """Which model each response gets."""

    model: str = doc(
        "".join(f"{word}: {kind.help}; " for word, kind in KINDS.items() if kind.is_word and kind.help)
        + "auto: the one of all these and a cubic that predicts runs it has not seen clearly better than a "
        "polynomial, which is kept beside it",
        "polynomial",
        words=words,
    )
    order: Literal[1, 2, 3] = doc("1 linear, 2 full second order, 3 full third order", 2)
    terms: tuple[str, ...] = doc(
        "instead of all terms of that order: groups FO, TWI, PQ, SO, cubic and single terms like 'x1*x2^2'; "
        "what these contain is added, unless 'exact' is among them",
        (),
    )
    stretch: str = doc(
        f"family of stretched factors: {', '.join(STRETCHES)}; or a rising or falling formula of x",
        "exp",
    )
    stretch_factors: dict[str, str] = doc(
        "family or formula factor by factor; those not named stay as they are", factory=dict
    )
    reduction: Literal["aicc", "aic", "bic", "backward", "forward", "all"] = doc(
        "how terms are chosen: stepwise by AICc, AIC or BIC, by tests backward or forward, or the best AICc "
        "of all subsets",
        "aicc",
    )

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        wrong = self.wrong_words()
        known = all(key != "model" for key, _ in wrong)
        return [*(idle_options(self, "model", dict(_takers())) if known else []), *wrong]

    def wrong_words(self) -> list[tuple[str, str]]:
        """Report words that mean nothing."""
        found = []
        try:
            one_of("model", self.model, words())
        except RsmkitError as error:
            found.append(("model", str(error).removeprefix("model ")))
        pairs = [
            ("stretch", self.stretch),
            *((f"stretch_factors.{k}", v) for k, v in self.stretch_factors.items()),
        ]
        for key, word in pairs:
            if word not in (*STRETCHES, "identity") and "x" not in word:
                found.append((key, f"'{word}' is no family ({', '.join(STRETCHES)}) and no formula of x"))
        return found


def _takers() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Options that only some models read, with these models."""
    kinds = {word: kind for word, kind in KINDS.items() if kind.is_word}
    always = kinds["polynomial"].options  # it is fitted beside every other
    for item in fields(SurfaceOptions):
        readers = tuple(word for word, kind in kinds.items() if item.name in kind.options)
        if readers and item.name not in always:
            yield item.name, (*readers, AUTO)
