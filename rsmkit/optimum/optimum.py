"""What a search found, as data and as JSON (``optimum.json``)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from html import escape
from typing import Any

import numpy as np

from rsmkit.errors import DamagedError, RsmkitError
from rsmkit.io.json_codec import Document, from_json, left_out_if_none
from rsmkit.language.expression import parse_expression
from rsmkit.language.space import Floats, Space, Value
from rsmkit.optimum.desirability import Desire
from rsmkit.optimum.feasible import FeasibleRegion
from rsmkit.optimum.pareto_front import REFERENCE, hypervolume, spread_rows

__all__ = ["Candidate", "Optimum", "OptimumForm", "missed_words"]

REDO = "Run: rsmkit fit"


def missed_words(missed: Mapping[str, float]) -> str:
    """Constraints and by how much each is missed, in words."""
    return " and ".join(f"'{text}' by {amount:.4g}" for text, amount in missed.items())


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
        ``"optimum"``; on a front ``"knee"``, ``"lowest <objective>"`` or empty; ``"least violation"`` where
        no point satisfies every constraint.
    """

    point: Floats
    objectives: tuple[float, ...]
    responses: dict[str, float]
    margins: tuple[float, ...] = ()
    label: str = ""


@dataclass(frozen=True)
class Optimum(Document):
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
    missed : dict of str to float or None
        Where no point satisfies every constraint: those that the best point, the one of least violation,
        misses, and by how much; None for an optimum that satisfies all.
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
    missed: dict[str, float] | None = None

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

    def with_spread(self, count: int) -> Optimum:
        """The same with so many points of the front to be run: knee and ends, then the farthest from them."""
        marked = [row for row, candidate in enumerate(self.front) if candidate.label]
        if not self.front or count <= len(marked):
            return self
        values = np.array([candidate.objectives for candidate in self.front])
        rows = spread_rows(values, min(count, len(values)), marked)
        labels = {row: f"front {number}" for number, row in enumerate(rows[len(marked) :], 1)}
        front = (replace(c, label=labels.get(row, c.label)) for row, c in enumerate(self.front))
        return replace(self, front=tuple(front))

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
        if "service" in self.settings:
            return f"{goal}, in service"
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

    @property
    def overall_desirability(self) -> float | None:
        """Predicted overall desirability, 0..1; None without wishes."""
        return self.as_desirability(self.best.objectives[0])

    def as_desirability(self, objective: float) -> float | None:
        """Overall desirability, 0..1, of an objective; None without wishes."""
        return min(1.0, max(0.0, -objective)) if "desirability" in self.settings else None

    @property
    def obstacles(self) -> str:
        """Why there is nothing worth having at the best point, in words; empty where there is.

        The constraints that it misses, or the responses whose desirability is 0.
        """
        if self.missed:
            nearest = f"the nearest misses {missed_words(self.missed)}"
            return f"no point of the surfaces satisfies every constraint; {nearest}"
        wishes = self.settings.get("desirability", {})
        zero = [name for name, value in self.desirabilities.items() if value == 0.0]
        if not zero:
            return ""
        told = [Desire(**wishes[name]).obstacle(name, self.best.responses[name]) for name in zero]
        return f"no point of the surfaces reaches any desirability: at the nearest, {' and '.join(told)}"

    def completed(self, space: Space, values: Mapping[str, float]) -> Optimum:
        """The same optimum in a larger space, with the further factors at given natural values."""

        def complete(candidate: Candidate) -> Candidate:
            known = dict(zip(self.space.names, candidate.point.tolist(), strict=True)) | dict(values)
            return replace(candidate, point=np.array([known[name] for name in space.names]))

        front = tuple(map(complete, self.front))
        return replace(self, space=space, best=complete(self.best), front=front)

    @classmethod
    def from_json(cls, document: Mapping[str, Any], space: Space) -> Optimum:
        """Read a document made by :meth:`to_json` for the same space.

        Raises
        ------
        RsmkitError
            When anything is missing, of the wrong type, not finite, or outside the factor bounds.
        """
        form = from_json(OptimumForm, document, "optimum.json", REDO)
        if problems := form.problems(space):
            raise DamagedError("optimum.json", problems, REDO)
        return form.optimum(space)

    def to_form(self) -> OptimumForm:
        """Give what the file shows of it."""
        return OptimumForm(
            name=self.name,
            minimize=self.minimize,
            subject_to=self.subject_to,
            settings=self.settings,
            seed=self.seed,
            evaluations=self.evaluations,
            history=self.history,
            front=tuple(CandidateForm(**_shown(candidate, self.space)) for candidate in self.front),
            hypervolume=self.hypervolume if self.front else None,
            feasible_region=self.region,
            missed=self.missed,
            **_shown(self.best, self.space),
        )

    def _repr_html_(self) -> str:
        cells = list(zip((factor.title for factor in self.space), self.factors.values(), strict=True))
        cells += list(zip(self.minimize, self.best.objectives, strict=True))
        texts = [(head, value if isinstance(value, str) else f"{value:.6g}") for head, value in cells]
        rows = [f"<tr><th>{escape(head)}</th><td>{escape(text)}</td></tr>" for head, text in texts]
        return (
            f"<table><caption>{escape(self.name)}: {escape(self.best.label)}</caption>{''.join(rows)}</table>"
        )


@dataclass(frozen=True, kw_only=True)
class CandidateForm:
    """How the file shows a candidate; `coded` is for people and not read back."""

    label: str
    factors: dict[str, Value]
    coded: dict[str, float] = field(default_factory=dict)
    objectives: tuple[float, ...]
    responses: dict[str, float]
    margins: tuple[float, ...]

    def candidate(self, space: Space) -> Candidate:
        """The candidate itself."""
        return Candidate(space.point(self.factors), self.objectives, self.responses, self.margins, self.label)

    def problems(self, space: Space, objectives: int) -> list[str]:
        """Say what is wrong with it for these factors and so many objectives."""
        found = []
        try:
            point = space.point(self.factors)
            if not space.contains(point):
                found.append(f"{self.factors} lies outside the factor bounds")
        except RsmkitError as error:
            found.append(str(error))
        if len(self.objectives) != objectives:
            found.append(f"{len(self.objectives)} objective values for {objectives} objectives")
        return found


@dataclass(frozen=True, kw_only=True)
class OptimumForm:
    """How the file shows an optimum; `hypervolume` is for people and not read back."""

    name: str
    minimize: tuple[str, ...]
    subject_to: tuple[str, ...]
    settings: dict[str, Any]
    seed: int
    evaluations: int
    label: str
    factors: dict[str, Value]
    coded: dict[str, float] = field(default_factory=dict)
    objectives: tuple[float, ...]
    responses: dict[str, float]
    margins: tuple[float, ...]
    history: dict[str, list[float | None]]
    front: tuple[CandidateForm, ...]
    hypervolume: dict[str, Any] | None = left_out_if_none()
    feasible_region: FeasibleRegion | None = left_out_if_none()
    missed: dict[str, float] | None = left_out_if_none()

    def problems(self, space: Space) -> list[str]:
        """Say what is wrong with it for these factors."""
        count = len(self.minimize)
        found = [] if count else ["minimize names no objective"]
        found += self.best.problems(space, count)
        for index, candidate in enumerate(self.front):
            found += [f"front[{index}] {problem}" for problem in candidate.problems(space, count)]
        if len({len(column) for column in self.history.values()}) > 1:
            found.append("history columns differ in length")
        return found

    @property
    def best(self) -> CandidateForm:
        """The best point, whose keys stand among those of the optimum."""
        return CandidateForm(**{item.name: getattr(self, item.name) for item in fields(CandidateForm)})

    def optimum(self, space: Space) -> Optimum:
        """The optimum itself."""
        return Optimum(
            name=self.name,
            space=space,
            minimize=self.minimize,
            subject_to=self.subject_to,
            settings=self.settings,
            seed=self.seed,
            evaluations=self.evaluations,
            best=self.best.candidate(space),
            history=self.history,
            front=tuple(item.candidate(space) for item in self.front),
            region=self.feasible_region,
            missed=self.missed,
        )


def _shown(candidate: Candidate, space: Space) -> dict[str, Any]:
    return {
        "label": candidate.label,
        "factors": space.values(candidate.point),
        "coded": dict(zip(space.names, space.encode(candidate.point).tolist(), strict=True)),
        "objectives": candidate.objectives,
        "responses": candidate.responses,
        "margins": candidate.margins,
    }
