"""What a study says of service: laws of its factors and settings, and whether they can be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Floats, Space
from rsmkit.variation.options import CorrelationOptions, LawOptions

if TYPE_CHECKING:
    from rsmkit.language.joint_law import LawMaker, Laws

__all__ = ["Service", "numbers_of"]

RARE = 1e-6
"""Tail of the law of a setting beyond which its range in a larger space ends."""


def numbers_of(settings: Mapping[str, Any]) -> dict[str, float]:
    """Settings of a simulator that are numbers, which a law may vary."""
    return {
        name: float(value)
        for name, value in settings.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


@dataclass(frozen=True)
class Service:
    """Laws of factors and settings.

    Parameters
    ----------
    space : Space
        Factors of the study.
    folder : Path
        Where tables of measured values lie.
    laws : mapping of str to LawOptions
        By factor or setting.
    correlation : CorrelationOptions, optional
    settings : mapping of str to float
        Those that are numbers.
    """

    space: Space
    folder: Path
    laws: Mapping[str, LawOptions]
    correlation: CorrelationOptions | None
    settings: Mapping[str, float]

    @property
    def varied_settings(self) -> tuple[str, ...]:
        """Settings with a law."""
        return tuple(name for name in self.laws if name in self.settings)

    def problems(self) -> list[str]:
        """Try every law at the centre of the space: one that cannot be there cannot be anywhere.

        A law that lies about the design's value may still leave the bounds at an optimum near one.
        """
        if not self.laws:
            return []
        from rsmkit.language.joint_law import check_law

        found = []
        for name in self.laws:
            try:
                if name in self.space.names:
                    law = self._laws(self.space, (name,), correlated=False).at(self._middle).laws[name]
                    check_law(self.space, name, law)
                else:
                    self._setting(name)
            except RsmkitError as error:
                found.append(str(error))
        try:
            self._matrix(tuple(self.laws))
        except RsmkitError as error:
            found.append(str(error))
        return found

    def of_factors(self) -> Laws | None:
        """Laws of the factors, which surfaces know; None where no factor has one."""
        names = tuple(name for name in self.laws if name in self.space.names)
        return self._laws(self.space, names) if names else None

    def of_runs(self) -> tuple[Laws, Floats]:
        """Laws of factors and settings in the space of both, and the values of the settings with a law."""
        import numpy as np

        names = self.varied_settings
        space = Space([*self.space, *map(self._setting, names)])
        return self._laws(space, tuple(self.laws)), np.array([self.settings[name] for name in names])

    @property
    def _middle(self) -> Floats:
        return self.space.clip([factor.domain.middle for factor in self.space])

    def _setting(self, name: str) -> Factor:
        """A setting as a factor: it has no bounds of its own, so these lie where its law is rare."""
        import numpy as np

        value = self.settings[name]
        try:
            law = self._maker(name)(value)
        except RsmkitError as error:
            raise RsmkitError(
                f"uncertainty.{name}: {str(error).removeprefix(f'uncertainty.{name}: ')}"
            ) from None
        low, high = law.quantile(np.array([RARE, 1.0 - RARE])).tolist()
        return Factor(name, min(low, value), max(high, value))

    def _laws(self, space: Space, names: tuple[str, ...], *, correlated: bool = True) -> Laws:
        from rsmkit.language.joint_law import Laws

        makers = {name: self._maker(name) for name in names}
        return Laws(space, makers, self._matrix(names) if correlated else None)

    def _maker(self, name: str) -> LawMaker:
        try:
            return self.laws[name].maker(name, self.folder)
        except RsmkitError as error:
            raise RsmkitError(f"uncertainty.{name}: {error}") from None

    def _matrix(self, names: tuple[str, ...]) -> Floats | None:
        """The correlation matrix of so many laws; those that the table does not name are independent."""
        if self.correlation is None or not self.correlation.factors:
            return None
        import numpy as np

        from rsmkit.language.joint_law import check_correlation

        given = np.array(self.correlation.matrix, float)
        check_correlation(given, self.correlation.factors)
        matrix, place = np.eye(len(names)), {name: i for i, name in enumerate(names)}
        for i, one in enumerate(self.correlation.factors):
            for j, other in enumerate(self.correlation.factors):
                if one in place and other in place:
                    matrix[place[one], place[other]] = given[i, j]
        return matrix
