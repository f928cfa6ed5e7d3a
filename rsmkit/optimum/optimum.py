"""What a search found, as data and as JSON (``optimum.json``)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from html import escape
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.desirability import Desire
from rsmkit.optimum.feasible import FeasibleRegion
from rsmkit.optimum.pareto_front import REFERENCE, hypervolume

__all__ = ["Candidate", "Optimum"]


@dataclass(frozen=True)
class Candidate:
    """One point worth running.

    Parameters
    ----------
    point : ndarray, shape (k,)
        Natural units, inside the bounds.
    objectives : tuple of float
        Predicted, in the order of the search.
    responses : dict of str to float
        Predicted.
    margins : tuple of float
        Of the constraints, in order; satisfied when >= 0.
    label : str
        ``"optimum"``; on a front ``"knee"``, ``"lowest <objective>"`` or empty.
    """

    point: Floats
    objectives: tuple[float, ...]
    responses: dict[str, float]
    margins: tuple[float, ...] = ()
    label: str = ""


@dataclass(frozen=True)
class Optimum:
    """Result of one search.

    Parameters
    ----------
    name : str
        The search's name in the study file.
    space : Space
        The factors.
    minimize, subject_to : tuple of str
        Objectives and constraints as written.
    settings : dict
        Method, preset, population, generations, polish.
    seed, evaluations : int
        Seed of the search, points evaluated by it (polish included).
    best : Candidate
        The optimum; of a front its knee.
    history : dict of str to list
        One entry per generation: ``generation``, ``evaluations``, ``mean_distance`` and, for one objective,
        ``best``, ``mean``, ``worst`` of the feasible individuals (None if there is none); for several,
        ``hypervolume`` and ``front_size`` of the archive.
    front : tuple of Candidate
        All non-dominated points evaluated, by rising first objective; empty for one objective.
    region : FeasibleRegion or None
        What the constraints leave of the box; None without constraints, or on a simulator.
    """

    name: str
    space: Space
    minimize: tuple[str, ...]
    subject_to: tuple[str, ...]
    settings: dict[str, Any]
    seed: int
    evaluations: int
    best: Candidate
    history: dict[str, list[Any]] = field(default_factory=dict)
    front: tuple[Candidate, ...] = ()
    region: FeasibleRegion | None = None

    @property
    def point(self) -> Floats:
        """The best point in natural units, shape (k,)."""
        return self.best.point

    @property
    def factors(self) -> dict[str, float | int | str]:
        """The best point as the simulator receives it."""
        return self.space.values(self.best.point)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """What a verification runs: the optimum; of a front the knee and each objective's lowest point."""
        marked = [c for c in self.front if c.label and c.label != self.best.label]
        return (self.best, *marked)

    @property
    def hypervolume(self) -> dict[str, Any]:
        """Volume the front dominates, with the scale and the reference point that make the number one."""
        values = np.array([candidate.objectives for candidate in self.front])
        ideal, nadir = values.min(axis=0), values.max(axis=0)
        return {
            "value": hypervolume(values, ideal, nadir),
            "ideal": ideal.tolist(),
            "nadir": nadir.tolist(),
            "reference_point": (ideal + REFERENCE * (nadir - ideal)).tolist(),
        }

    @property
    def aim(self) -> str:
        """What was searched for, in words short enough for a line."""
        if "desirability" in self.settings:
            goal = f"the greatest desirability of {', '.join(self.settings['desirability'])}"
        else:
            texts = self.settings.get("minimize", self.minimize)
            goal = f"minimise {texts if isinstance(texts, str) else '; '.join(texts)}"
        if "robust" not in self.settings:
            return goal
        robust = self.settings["robust"]
        over = ", ".join(robust["noise"])
        return f"{goal}; mean + {robust['deviations']:g} standard deviations over {over}"

    @property
    def desirabilities(self) -> dict[str, float]:
        """Predicted desirability of each response that is wished for, 0..1; empty without wishes."""
        found = {}
        for name, wish in self.settings.get("desirability", {}).items():
            if name in self.best.responses:
                expression = parse_expression(Desire(**wish).text(name))
                found[name] = float(expression({name: np.array(self.best.responses[name])}))
        return found

    def completed(self, space: Space, values: Mapping[str, float]) -> Optimum:
        """The same optimum in a larger space, with the further factors at given natural values."""

        def complete(candidate: Candidate) -> Candidate:
            known = dict(zip(self.space.names, candidate.point.tolist(), strict=True)) | dict(values)
            return replace(candidate, point=np.array([known[name] for name in space.names]))

        front = tuple(map(complete, self.front))
        return replace(self, space=space, best=complete(self.best), front=front)

    def to_json(self) -> dict[str, Any]:
        """Make a document of plain lists, dicts, texts and finite numbers."""
        return {
            "name": self.name,
            "minimize": list(self.minimize),
            "subject_to": list(self.subject_to),
            "settings": dict(self.settings),
            "seed": self.seed,
            "evaluations": self.evaluations,
            **self._candidate_json(self.best),
            "history": {key: list(column) for key, column in self.history.items()},
            "front": [self._candidate_json(candidate) for candidate in self.front],
            **({"hypervolume": self.hypervolume} if self.front else {}),
            **({"feasible_region": self.region.to_json()} if self.region else {}),
        }

    def _candidate_json(self, candidate: Candidate) -> dict[str, Any]:
        coded = self.space.encode(candidate.point)
        return {
            "label": candidate.label,
            "factors": self.space.values(candidate.point),
            "coded": dict(zip(self.space.names, coded.tolist(), strict=True)),
            "objectives": list(candidate.objectives),
            "responses": dict(candidate.responses),
            "margins": list(candidate.margins),
        }

    @classmethod
    def from_json(cls, document: Mapping[str, Any], space: Space) -> Optimum:
        """Read a document made by :meth:`to_json` for the same space.

        Raises
        ------
        RsmkitError
            When anything is missing, of the wrong type, not finite, or outside the factor bounds.
        """
        read = _Reader(space)
        name = read.get(document, "name", str)
        minimize = tuple(read.all_of(document, "minimize", str))
        front = tuple(read.candidate(item, len(minimize)) for item in read.all_of(document, "front", dict))
        if not minimize:
            raise RsmkitError(f"optimum.json: search {name!r} has no objective; run: rsmkit fit")
        return cls(
            name=name,
            space=space,
            minimize=minimize,
            subject_to=tuple(read.all_of(document, "subject_to", str)),
            settings=read.get(document, "settings", dict),
            seed=read.get(document, "seed", int),
            evaluations=read.get(document, "evaluations", int),
            best=read.candidate(document, len(minimize)),
            history=read.history(read.get(document, "history", dict)),
            front=front,
            region=read.region(document.get("feasible_region")),
        )

    def _repr_html_(self) -> str:
        cells = list(zip((factor.title for factor in self.space), self.factors.values(), strict=True))
        cells += list(zip(self.minimize, self.best.objectives, strict=True))
        texts = [(head, value if isinstance(value, str) else f"{value:.6g}") for head, value in cells]
        rows = [f"<tr><th>{escape(head)}</th><td>{escape(text)}</td></tr>" for head, text in texts]
        return (
            f"<table><caption>{escape(self.name)}: {escape(self.best.label)}</caption>{''.join(rows)}</table>"
        )


class _Reader:
    """Typed access to a document that may come from anywhere."""

    def __init__(self, space: Space) -> None:
        self._space = space

    def get(self, document: Mapping[str, Any], key: str, kind: type) -> Any:
        value = document.get(key) if isinstance(document, Mapping) else None
        if not isinstance(value, kind) or isinstance(value, bool):
            found = "nothing" if value is None else type(value).__name__
            raise RsmkitError(
                f"optimum.json: {key} must be a {kind.__name__}, found {found}; run: rsmkit fit"
            )
        return value

    def all_of(self, document: Mapping[str, Any], key: str, kind: type) -> list[Any]:
        items = self.get(document, key, list)
        if not all(isinstance(item, kind) for item in items):
            raise RsmkitError(
                f"optimum.json: every entry of {key} must be a {kind.__name__}; run: rsmkit fit"
            )
        return list(items)

    def number(self, value: Any, what: str) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise RsmkitError(
                f"optimum.json: {what} must be a finite number, found {value!r}; run: rsmkit fit"
            )
        return float(value)

    def candidate(self, document: Mapping[str, Any], objectives: int) -> Candidate:
        factors = self.get(document, "factors", dict)
        if not all(isinstance(value, int | float | str) for value in factors.values()):
            raise RsmkitError("optimum.json: a factor is neither a number nor a text; run: rsmkit fit")
        point = self._space.point(factors)
        if not np.isfinite(point).all() or not self._space.contains(point):
            raise RsmkitError(
                f"optimum.json: {document['factors']} lies outside the factor bounds; run: rsmkit fit"
            )
        values = tuple(self.number(v, "an objective") for v in self.get(document, "objectives", list))
        if len(values) != objectives:
            raise RsmkitError(
                f"optimum.json: {len(values)} objective values for {objectives} objectives; run: rsmkit fit"
            )
        responses = self.get(document, "responses", dict)
        return Candidate(
            point,
            values,
            {key: self.number(value, f"response {key}") for key, value in responses.items()},
            tuple(self.number(v, "a margin") for v in self.get(document, "margins", list)),
            self.get(document, "label", str),
        )

    def region(self, document: Any) -> FeasibleRegion | None:
        if document is None:
            return None
        share = self.number(self.get(document, "share", float), "feasible_region.share")
        low, high = (
            tuple(self.number(v, f"feasible_region.{key}") for v in self.get(document, key, list))
            for key in ("low", "high")
        )
        return FeasibleRegion(share, low, high)

    def history(self, document: Mapping[str, Any]) -> dict[str, list[Any]]:
        columns = {key: self.get(document, key, list) for key in document}
        if len({len(column) for column in columns.values()}) > 1:
            raise RsmkitError("optimum.json: history columns differ in length; run: rsmkit fit")
        return {
            key: [None if v is None else self.number(v, f"history.{key}") for v in column]
            for key, column in columns.items()
        }
