"""Uncertainty from Python: :func:`uncertainty`, without a study file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import checked
from rsmkit.io.toml_tables import read_options
from rsmkit.language.joint_law import Laws
from rsmkit.language.laws import Law, Sample
from rsmkit.language.space import Floats, Space
from rsmkit.optimum.optimum import Optimum
from rsmkit.surfaces.models.surface import Surface
from rsmkit.variation.conformity.judgement import with_truth
from rsmkit.variation.conformity.proof import Trial, prove
from rsmkit.variation.findings_of_laws import Uncertainty
from rsmkit.variation.options import LawOptions, PropagationOptions, Specification
from rsmkit.variation.propagation import Question, posteriors_of, propagate

__all__ = ["make_laws", "prove_uncertainty", "uncertainty"]


@checked
def uncertainty(
    surfaces: Mapping[str, Surface],
    laws: Mapping[str, Any],
    *,
    at: Any = None,
    specifications: Mapping[str, Any] | None = None,
    correlation: Any = None,
    deterministic: bool = True,
    **options: Any,
) -> Uncertainty:
    """Say what responses do when factors vary about a design: how much arrives, from what, how often.

    Parameters
    ----------
    surfaces : mapping of str to Surface
        From :func:`rsmkit.fit`.
    laws : mapping of str to law
        By factor: the keys of ``[uncertainty]`` in a study file (``{"law": "normal", "sd": 0.2}``), a law of
        :mod:`rsmkit.language.laws`, or measured values.
    at : Optimum, or mapping of str to value, optional
        The design; the centre of the space when left out.
    specifications : mapping of str to mapping, optional
        By response: ``{"low": 30, "high": 36}``, one of them at least.
    correlation : array, shape (m, m), optional
        Correlation matrix of the laws in their order; independent when left out.
    deterministic : bool
        Whether runs repeat without noise; else the noise of a run is part of what the responses do.
    **options
        Fields of :class:`rsmkit.variation.options.PropagationOptions`: `confidence`, `draws`, `samples`,
        `seed`, `map`.

    Returns
    -------
    Uncertainty
        ``found.summary()``; ``found.responses["sag_mm"]`` has ``sd``, ``sobol``, ``cpk``, ...

    Raises
    ------
    RsmkitError
        For a law, a correlation or a specification that cannot be, by name.
    """
    return propagate(_question(surfaces, laws, at, specifications, correlation, deterministic, options))


@checked
def prove_uncertainty(
    fly: Callable[[Floats], Mapping[str, Floats]],
    surfaces: Mapping[str, Surface],
    laws: Mapping[str, Any],
    *,
    runs: int,
    at: Any = None,
    specifications: Mapping[str, Any] | None = None,
    correlation: Any = None,
    deterministic: bool = True,
    **options: Any,
) -> Uncertainty:
    """Ask the simulator under the laws, and put what is true beside what :func:`uncertainty` promises.

    Parameters
    ----------
    fly : callable
        The true responses at points (n, k), natural units, by name, shape (n,) each; nan where a run fails.
    runs : int
        How many points it may be asked at, in waves of 20.
    surfaces, laws, at, specifications, correlation, deterministic, **options
        As for :func:`uncertainty`.

    Returns
    -------
    Uncertainty
        With ``true`` for every response, as ``docs/uncertainty.md`` describes it.
    """
    if runs < 3:
        raise RsmkitError(f"runs must be at least 3, got {runs}")
    question = _question(surfaces, laws, at, specifications, correlation, deterministic, options)
    found = propagate(question)
    trial = Trial(
        question.law()[0],
        posteriors_of(question),
        list(range(len(question.laws.space))),
        {name: (own.mean, own.sd**2 - own.noise_sd**2) for name, own in found.responses.items()},
        question.specifications,
        runs,
        question.options.confidence,
        question.options.seed,
    )
    return with_truth(found, prove(trial, fly))


def _question(
    surfaces: Mapping[str, Surface],
    laws: Mapping[str, Any],
    at: Any,
    specifications: Mapping[str, Any] | None,
    correlation: Any,
    deterministic: bool,
    options: Mapping[str, Any],
) -> Question:
    if not surfaces:
        raise RsmkitError("there is no surface to carry the laws; fit some first")
    space = next(iter(surfaces.values())).space
    name, point = _design(space, at)
    limits = {
        key: _read(Specification, f"specifications.{key}", value)
        for key, value in (specifications or {}).items()
    }
    made = make_laws(space, laws, correlation)
    chosen = read_options(PropagationOptions, options)
    return Question(surfaces, made, point, name, limits, deterministic, chosen)


def make_laws(space: Space, laws: Mapping[str, Any], correlation: Any = None) -> Laws:
    """Make laws of factors from what people write.

    Raises
    ------
    RsmkitError
        For a law that cannot be, naming the factor.
    """
    makers = {}
    for name, given in laws.items():
        key = f"uncertainty.{name}"
        if isinstance(given, Law):
            makers[name] = _always(given)
        elif isinstance(given, Mapping | LawOptions):
            options = _read(LawOptions, key, given)
            try:
                makers[name] = options.maker(name, Path.cwd())
            except RsmkitError as error:  # a sample that cannot be read
                raise RsmkitError(f"{key}: {error}") from None
        elif isinstance(given, Sequence | np.ndarray) and not isinstance(given, str):
            try:
                makers[name] = _always(Sample(_numbers(key, given)))
            except RsmkitError as error:
                raise RsmkitError(f"{key}: {str(error).removeprefix(f'{key}: ')}") from None
        else:
            raise RsmkitError(
                f"{key}: must be a table such as {{'law': 'normal', 'sd': 0.2}}, got {given!r:.60}"
            )
    matrix = None if correlation is None else _numbers("correlation", correlation)
    return Laws(space, makers, matrix)


def _numbers(key: str, given: Any) -> Floats:
    try:
        return np.asarray(given, float)
    except (TypeError, ValueError):
        raise RsmkitError(f"{key}: must be numbers, as many in each row, got {given!r:.60}") from None


def _always(law: Law) -> Any:
    return lambda _: law


def _read(kind: Any, key: str, given: Any) -> Any:
    if not isinstance(given, kind | Mapping):
        raise RsmkitError(f"{key}: must be a table of keys and values, got {given!r:.60}")
    try:
        return given if isinstance(given, kind) else read_options(kind, given)
    except RsmkitError as error:
        raise RsmkitError(f"{key}: {error}") from None


def _design(space: Space, at: Any) -> tuple[str, Floats]:
    if at is None:
        return "centre", space.clip([factor.domain.middle for factor in space])
    if isinstance(at, Optimum):
        return "optimum", at.space.point(at.factors)
    if isinstance(at, Mapping):
        point = space.point(at)
        for factor, value in zip(space, point.tolist(), strict=True):
            if not math.isfinite(value):
                raise RsmkitError(f"at: {factor.name} must be a finite number, got {value:g}")
        return "point", point
    raise RsmkitError(f"at: must be an Optimum or a mapping of factors to values, got {at!r:.60}")
