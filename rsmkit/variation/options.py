"""The tables ``[uncertainty]``, ``[correlation]``, ``[specifications]`` and ``[propagation]``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rsmkit.errors import RsmkitError, did_you_mean, listed
from rsmkit.io.option_fields import doc, given

if TYPE_CHECKING:
    from rsmkit.language.joint_law import LawMaker
    from rsmkit.language.laws import Law

__all__ = ["LAW_KEYS", "CorrelationOptions", "LawOptions", "PropagationOptions", "Specification"]

_SPREAD = ("mean", "sd", "sd_pct")
_WIDTH = ("half_width", "half_width_pct", "low", "high")
LAW_KEYS: dict[str, tuple[str, ...]] = {
    "normal": _SPREAD,
    "uniform": _WIDTH,
    "triangular": (*_WIDTH, "mode"),
    "lognormal": _SPREAD,
    "truncated": (*_SPREAD, *_WIDTH),
    "sample": ("file", "column", "deviations"),
}
"""The laws by word, and the keys that each reads."""


@dataclass(frozen=True)
class LawOptions:
    """How a factor, or a setting of the simulator, varies in service about the design's value."""

    law: str = doc("its law; truncated: a normal law cut at limits", "normal", words=lambda: tuple(LAW_KEYS))
    mean: float | None = doc("its mean, natural units; the design's value when left out", None)
    sd: float | None = doc("standard deviation, natural units", None)
    sd_pct: float | None = doc("standard deviation in percent of the mean", None)
    half_width: float | None = doc("limits lie so far on both sides of the design's value", None)
    half_width_pct: float | None = doc("the same in percent of the design's value", None)
    low: float | None = doc("lower limit, natural units", None)
    high: float | None = doc("upper limit, natural units", None)
    mode: float | None = doc("likeliest value of triangular; the design's value when left out", None)
    file: str = doc("CSV table of measured values, of the law sample", "")
    column: str = doc("its column; the factor's name when left out", "")
    deviations: bool = doc("whether the measured values are deviations from the design's value", False)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        if self.law not in LAW_KEYS:
            hint = did_you_mean(self.law, LAW_KEYS)
            return [("law", f"must be one of {', '.join(LAW_KEYS)}, got '{self.law}'{hint}")]
        chosen = [key for key in given(self) if key != "law"]
        found = []
        for key in chosen:
            if key not in LAW_KEYS[self.law]:
                takers = listed([f"'{word}'" for word, keys in LAW_KEYS.items() if key in keys])
                found.append((key, f"has no effect on law = '{self.law}'; leave it out, or take {takers}"))
        found += [
            (key, f"must be positive, got {value:g}")
            for key in ("sd", "sd_pct", "half_width", "half_width_pct")
            if (value := getattr(self, key)) is not None and value <= 0
        ]
        return found or self._incomplete()

    def _incomplete(self) -> list[tuple[str, str]]:
        keys, found = LAW_KEYS[self.law], []
        if "sd" in keys and (self.sd is None) == (self.sd_pct is None):
            found.append(("sd", "or sd_pct must be given, one of the two"))
        if "low" in keys:
            about, limits = (self.half_width, self.half_width_pct), (self.low, self.high)
            ways = sum(value is not None for value in about) + (None not in limits)
            one_sided = self.law != "truncated" and (self.low is None) != (self.high is None)
            one_of_two = self.law == "truncated" and limits.count(None) == 1 and about == (None, None)
            if one_sided or (ways != 1 and not one_of_two):
                found.append(("half_width", "(or half_width_pct), or low and high must be given"))
            elif self.low is not None and self.high is not None and not self.low < self.high:
                found.append(("low", f"({self.low:g}) must be less than high ({self.high:g})"))
        if self.law == "sample" and not self.file:
            found.append(("file", "must name the CSV table of the sample"))
        return found

    @property
    def follows(self) -> bool:
        """Whether the law lies about the design's value, wherever that is."""
        return self.deviations or (self.mean is None and self.low is None and self.law != "sample")

    def maker(self, name: str, folder: Path) -> LawMaker:
        """Give what makes the law about a value; a sample is read from `folder` now.

        Raises
        ------
        RsmkitError
            If the sample cannot be read.
        """
        import numpy as np

        from rsmkit.language.laws import Sample

        if self.law != "sample":
            return self._about
        measured = np.array(_column(folder / self.file, self.column or name))
        fixed = Sample(measured)
        return (lambda value: Sample(value + measured)) if self.deviations else (lambda value: fixed)

    def _about(self, value: float) -> Law:
        from rsmkit.language import laws as kinds

        mean = value if self.mean is None else self.mean
        if self.law in ("normal", "lognormal"):
            made = {"normal": kinds.Normal, "lognormal": kinds.Lognormal}[self.law]
            return made(mean, self._sd(mean))
        low, high = self._limits(value)
        if self.law == "truncated":
            return kinds.Truncated(mean, self._sd(mean), low, high)
        if self.law == "uniform":
            return kinds.Uniform(low, high)
        return kinds.Triangular(low, value if self.mode is None else self.mode, high)

    def _sd(self, mean: float) -> float:
        if self.sd is not None:
            return self.sd
        assert self.sd_pct is not None
        if mean == 0:
            raise RsmkitError("sd_pct is a percentage of a mean of 0; give sd")
        return self.sd_pct / 100.0 * abs(mean)

    def _limits(self, value: float) -> tuple[float, float]:
        """Ends of the law; one that a truncated law does not have lies 40 standard deviations away."""
        if self.half_width is None and self.half_width_pct is None:
            far = 40.0 * self._sd(value if self.mean is None else self.mean) if self.law == "truncated" else 0
            middle = value if self.mean is None else self.mean
            low = middle - far if self.low is None else self.low
            return low, middle + far if self.high is None else self.high
        if self.half_width_pct is not None and value == 0:
            raise RsmkitError("half_width_pct is a percentage of a value of 0; give half_width")
        half = self.half_width or (self.half_width_pct or 0.0) / 100.0 * abs(value)
        return value - half, value + half


@dataclass(frozen=True)
class CorrelationOptions:
    """How the laws of ``[uncertainty]`` are correlated; independent when left out."""

    factors: tuple[str, ...] = doc("factors with a law, in the order of the matrix", ())
    matrix: tuple[tuple[float, ...], ...] = doc("the correlation matrix, row by row", ())

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        m = len(self.factors)
        if len(set(self.factors)) != m:
            return [("factors", "names a factor twice")]
        if len(self.matrix) != m or any(len(row) != m for row in self.matrix):
            return [("matrix", f"must have {m} rows of {m} numbers, one for each of factors")]
        return []


@dataclass(frozen=True)
class Specification:
    """What a response must keep to in service."""

    low: float | None = doc("least acceptable value, natural units", None)
    high: float | None = doc("largest acceptable value, natural units", None)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        if self.low is None and self.high is None:
            return [("", "must have low, high or both")]
        if self.low is not None and self.high is not None and not self.low < self.high:
            return [("low", f"({self.low:g}) must be less than high ({self.high:g})")]
        return []

    @property
    def text(self) -> str:
        """The limits in words."""
        if self.low is None:
            return f"at most {self.high:g}"
        return f"at least {self.low:g}" if self.high is None else f"{self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class PropagationOptions:
    """How the laws of ``[uncertainty]`` are carried through the surfaces."""

    search: str = doc("the search whose optimum the laws lie about; the first when left out", "")
    map: tuple[str, ...] = doc(
        "the two factors over which the probability of keeping to every specification is mapped; those with "
        "the largest part in them when left out",
        (),
    )
    confidence: float = doc("confidence of the intervals", 0.95)
    draws: int = doc("surfaces drawn from what the runs leave open", 400)
    samples: int = doc("points at which surfaces are asked where there is no closed form, a power of 2", 4096)
    seed: int = doc("seed of every random choice", 1)

    def problems(self) -> list[tuple[str, str]]:
        """Report what is wrong beyond types."""
        found = []
        if self.map and (len(self.map) != 2 or self.map[0] == self.map[1]):
            found.append(("map", "must name two factors"))
        if not 0 < self.confidence < 1:
            found.append(("confidence", f"must lie between 0 and 1, got {self.confidence:g}"))
        if not 20 <= self.draws <= 100_000:
            found.append(("draws", f"must be 20 to 100000, got {self.draws}"))
        if self.samples < 64 or self.samples & (self.samples - 1) or self.samples > 1 << 20:
            found.append(("samples", f"must be a power of 2 from 64 to 1048576, got {self.samples}"))
        if self.seed < 0:
            found.append(("seed", f"must be at least 0, got {self.seed}"))
        return found


def _column(path: Path, name: str) -> list[float]:
    """Read a column of finite numbers."""
    from rsmkit.io.tables.csv_tables import read_table

    table = read_table(path)
    column = table.names[0] if len(table.names) == 1 else name
    values = []
    for row, text in enumerate(table.texts(column)):
        value = table.number(text)
        if value is None:
            raise RsmkitError(f"{path}, line {table.lines[row]}: '{text}' in {column} is no finite number")
        values.append(value)
    return values
