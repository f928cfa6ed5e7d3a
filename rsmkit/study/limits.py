"""What a study says of sums: its mixtures and equalities, and who else may not move their factors."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Protocol

from rsmkit.errors import RsmkitError
from rsmkit.language.conditions import parse_conditions
from rsmkit.language.equalities import Equality, Mixture
from rsmkit.language.space import Space
from rsmkit.optimum.options import SearchOptions

__all__ = ["limited_space"]


class Sum(Protocol):
    """What a study says of a mixture."""

    @property
    def components(self) -> tuple[str, ...]:
        """Factors."""
        ...

    @property
    def total(self) -> float:
        """Their sum."""
        ...


def limited_space(
    space: Space,
    *,
    mixtures: Sequence[Sum],
    subject_to: Sequence[str],
    searches: Sequence[SearchOptions],
    uncertain: Collection[str],
    hard: Collection[str],
) -> tuple[Space, list[str]]:
    """Put the mixtures of a study, and the equalities of its design, on the space of its factors.

    Parameters
    ----------
    space : Space
        The factors alone.
    mixtures : sequence
        The tables of mixtures.
    subject_to : sequence of str
        Conditions of the design, each in order by itself, as are those of the searches.
    searches : sequence of SearchOptions
    uncertain, hard : collection of str
        Names with a law of their own, and factors that are hard to change.

    Returns
    -------
    space : Space
    problems : list of str
        One line per mistake, beginning with the key.
    """
    problems: list[str] = []
    for index, mixture in enumerate(mixtures):
        key = "mixture" if len(mixtures) == 1 else f"mixture[{index}]"
        try:
            space = space.limited([*space.limits, Mixture(mixture.components, mixture.total)])
        except RsmkitError as error:
            problems.append(f"{key}: {str(error).removeprefix('mixture: ')}")
    space, found = _held(space, subject_to, "design.subject_to:")
    problems += found
    for search in searches:
        whole, found = _held(space, search.subject_to, f"search {search.name}: subject_to:")
        problems += found
        noise = tuple(search.robust.noise) if search.robust else ()
        problems += _refused(whole.equalities, noise, f"search {search.name}: robust.noise")
        if search.service is not None:
            new = [equality for equality in whole.equalities if equality not in space.equalities]
            problems += _refused(new, uncertain, f"search {search.name}: service and uncertainty")
    problems += _refused(space.equalities, uncertain, "uncertainty")
    for equality in space.equalities:
        problems += [
            f"factors.{name}.change: {name} takes part in '{equality.text}', and plots within which only "
            "some of a sum keep their setting cannot be planned; give change = 'hard' to all of its factors, "
            "or to none"
            for name in hard
            if name in equality.names and not set(equality.names) <= set(hard)
        ]
    return space, problems


def _held(space: Space, texts: Sequence[str], key: str) -> tuple[Space, list[str]]:
    """The space under the equalities among conditions."""
    try:
        return space.holding(parse_conditions(texts, categories=space.categories).equalities), []
    except RsmkitError as error:
        return space, [f"{key} {error}"]


def _refused(equalities: Sequence[Equality], names: Collection[str], key: str) -> list[str]:
    """Refuse what would move a factor of a sum by itself."""
    return [
        f"{key}.{name}: {name} takes part in '{equality.text}', which it would break if it varied by itself; "
        "vary factors outside the sum, or a setting of the simulator"
        for equality in equalities
        for name in names
        if name in equality.names
    ]
