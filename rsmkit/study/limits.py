"""What a study says of sums: its mixtures and equalities, and who else may not move their factors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rsmkit.errors import RsmkitError
from rsmkit.language.conditions import parse_conditions
from rsmkit.language.equalities import Equality, Mixture
from rsmkit.language.space import Space

if TYPE_CHECKING:
    from rsmkit.study.file import StudyFile

__all__ = ["limited_space"]


def limited_space(file: StudyFile, space: Space) -> tuple[Space, list[str]]:
    """Put the mixtures of a study, and the equalities of its design, on the space of its factors.

    Parameters
    ----------
    file : StudyFile
        Its conditions are known to be in order, each by itself.
    space : Space
        The factors alone.

    Returns
    -------
    space : Space
    problems : list of str
        One line per mistake, beginning with the key.
    """
    problems: list[str] = []
    for index, mixture in enumerate(file.mixture):
        key = "mixture" if len(file.mixture) == 1 else f"mixture[{index}]"
        try:
            space = space.limited([*space.limits, Mixture(mixture.components, mixture.total)])
        except RsmkitError as error:
            problems.append(f"{key}: {str(error).removeprefix('mixture: ')}")
    space, found = _held(space, file.design.subject_to, "design.subject_to:")
    problems += found
    for search in file.search:
        whole, found = _held(space, search.subject_to, f"search {search.name}: subject_to:")
        problems += found
        noise = search.robust.noise if search.robust else {}
        problems += _refused(whole.equalities, noise, f"search {search.name}: robust.noise")
        if search.service is not None:
            new = [equality for equality in whole.equalities if equality not in space.equalities]
            problems += _refused(new, file.uncertainty, f"search {search.name}: service and uncertainty")
    problems += _refused(space.equalities, file.uncertainty, "uncertainty")
    hard = {name: None for name, options in file.factors.items() if options.change == "hard"}
    for equality in space.equalities:
        problems += [
            f"factors.{name}.change: {name} takes part in '{equality.text}', and plots within which only "
            "some of a sum keep their setting cannot be planned; leave change, or the sum, out"
            for name in hard
            if name in equality.names
        ]
    return space, problems


def _held(space: Space, texts: tuple[str, ...], key: str) -> tuple[Space, list[str]]:
    """The space under the equalities among conditions."""
    try:
        return space.holding(parse_conditions(texts, categories=space.categories).equalities), []
    except RsmkitError as error:
        return space, [f"{key} {error}"]


def _refused(equalities: tuple[Equality, ...] | list[Equality], laws: object, key: str) -> list[str]:
    """Refuse what would move a factor of a sum by itself."""
    names = list(laws) if isinstance(laws, dict) else []
    return [
        f"{key}.{name}: {name} takes part in '{equality.text}', which it would break if it varied by itself; "
        "vary factors outside the sum, or a setting of the simulator"
        for equality in equalities
        for name in names
        if name in equality.names
    ]
