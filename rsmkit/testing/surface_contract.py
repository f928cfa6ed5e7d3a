"""The contract of a kind of surface: honest numbers, the same again from its file, all of it presentable."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Factor, Floats, Space
from rsmkit.language.terms import full_terms
from rsmkit.surfaces.estimation.fit_data import checked_data
from rsmkit.surfaces.fitted_response import FittedResponse
from rsmkit.surfaces.kinds import KINDS, ModelFit, ModelRequest, fit_kind, page_model, read_surface
from rsmkit.surfaces.models.surface import IntervalKind, Surface
from rsmkit.surfaces.options import SurfaceOptions
from rsmkit.surfaces.polynomial_fit import estimate

__all__ = ["check_surface_kind"]

RESPONSE = "y <&>"
"""A name that must not be taken for HTML."""
KINDS_OF_INTERVAL: tuple[IntervalKind, ...] = ("prediction", "mean", "jackknife+")
ROUNDING = 1e-8
"""What a value may be rounded by, in units of the response's spread.

Sums of weights times responses lose the size of the weights times 1e-16, and weights of surfaces through
noisy runs reach 1e6; so much is allowed for, with a factor of a hundred to spare.
"""
STEP = 1e-4
"""Of the differences that a gradient is compared with, as a part of each factor's range."""
SLOPE_ERROR = ROUNDING / STEP
"""What such differences may be off by, in units of the response's spread over the factor's range.

That much from rounding; and ``STEP^2/6`` times the third derivative is less for third derivatives up to 6e4.
"""


def check_surface_kind(
    word: str, *, space: Space | None = None, points: ArrayLike | None = None, y: ArrayLike | None = None
) -> ModelFit:
    """Assert that a kind of surface keeps the contract that the stages of a study build on.

    It is fitted twice to the same runs, by default 30 runs of a smooth positive response over a continuous,
    an integer and a categorical factor. Asserted are the shapes of predictions, ordered intervals that grow
    with the confidence, a gradient that agrees with differences, errors at runs left out that are not those
    at runs seen, a file from which the same surface is read again to the last bit and that is refused when a
    part of it is missing, and reports, texts and page data that can be written.

    Parameters
    ----------
    word : str
        A key of :data:`rsmkit.surfaces.kinds.KINDS`.
    space : Space, optional
        Other factors, with `points` and `y`.
    points : array, shape (n, k), optional
        Natural units.
    y : array, shape (n,), optional

    Returns
    -------
    ModelFit
        The surface and what was found.

    Raises
    ------
    AssertionError
        Saying which part of the contract is broken.
    FitError
        If the kind cannot be fitted to these runs.
    """
    assert word in KINDS, f"no kind '{word}' in rsmkit.surfaces.kinds.KINDS; there are {', '.join(KINDS)}"
    kind = KINDS[word]
    unknown = set(kind.options) - {item.name for item in fields(SurfaceOptions)}
    assert not unknown, f"{word} reads options that there are not: {', '.join(sorted(unknown))}"
    request = _request(space, points, y, grouped=kind.grouped == "only")
    found, again = fit_kind(kind, request), fit_kind(kind, request)
    surface, x, spread = found.surface, _places(request), float(np.ptp(request.data.y))
    assert isinstance(surface, Surface), (
        f"{word} makes a {type(surface).__name__}, which lacks parts of a Surface"
    )
    assert surface.form == kind.makes, f"{word} says it makes '{kind.makes}', its surface is '{surface.form}'"
    assert surface.response == RESPONSE, f"{word} renames the response to {surface.response!r}"
    assert surface.space.names == request.space.names, f"{word} changes the factors"
    _same(surface, again.surface, x, f"{word} gives another surface when it is fitted again")
    _check_predictions(word, surface, x, spread)
    _check_intervals(word, surface, x)
    _check_gradient(word, surface, x, spread)
    _check_press(word, found, request)
    _check_file(word, surface, x, kind.form().newer)
    _check_report(word, surface)
    return found


def _request(
    space: Space | None, points: ArrayLike | None, y: ArrayLike | None, *, grouped: bool
) -> ModelRequest:
    """The runs to fit, in groups of three where that is wanted, and the full second-order polynomial."""
    rng = np.random.default_rng(5)
    if space is None or points is None or y is None:
        assert (space, points, y) == (None, None, None), "give space, points and y together"
        space = Space(
            [Factor("a", 1.0, 3.0), Factor("n", 0, 8, integer=True), Factor("tool", levels=("s", "t"))]
        )
        x = space.snap(space.decode(rng.uniform(-1.0, 1.0, (30, 3))))
        x[:, 2] = np.arange(30) % 2
        z = space.encode(x)
        # steep even when its logarithm is taken, so that every kind finds something to do
        steep = np.exp(0.3 * np.exp(1.5 * z[:, 0]) + z[:, 1] + 0.3 * x[:, 2])
        y = steep * (1.0 + 0.01 * rng.normal(size=30))
        points = x
    labels = {"plot": [str(i // 3) for i in range(len(np.asarray(y)))]} if grouped else None
    data = checked_data(space, points, y, random=labels)
    terms = full_terms(space, 2)
    return ModelRequest(space, RESPONSE, data, terms, estimate(space, RESPONSE, data, terms))


def _places(request: ModelRequest) -> Floats:
    """Points between the runs, at levels that exist for categorical factors, shape (20, k)."""
    space = request.space
    x = np.random.default_rng(6).uniform(space.lows, space.highs, (20, len(space)))
    return np.where(space.numeric, x, np.round(x))


def _same(one: Surface, other: Surface, x: Floats, otherwise: str) -> None:
    for a, b in zip(one.predict(x, 0.9), other.predict(x, 0.9), strict=True):
        assert np.array_equal(a, b, equal_nan=True), otherwise


def _check_predictions(word: str, surface: Surface, x: Floats, spread: float) -> None:
    given = x.copy()
    values = surface.predict(x)
    assert np.array_equal(given, x), f"{word} changes the points it is given"
    assert values.shape == (len(x),), f"{word} predicts shape {values.shape} for {len(x)} points"
    assert np.isfinite(values).all(), f"{word} predicts values that are not finite between the runs"
    alone = np.array([surface.predict(point[None])[0] for point in x])
    assert np.abs(alone - values).max() <= ROUNDING * spread, (
        f"{word} predicts something else for a point alone than among others"
    )
    _refuses(f"{word} predicts although a factor is missing", surface.predict, x[:, :-1])


def _check_intervals(word: str, surface: Surface, x: Floats) -> None:
    for kind in KINDS_OF_INTERVAL:
        mean, low, high = surface.predict(x, 0.8, kind)
        assert np.array_equal(mean, surface.predict(x)), (
            f"{word}: the middle of its {kind} interval is another"
        )
        assert (low <= high).all(), f"{word}: limits of its {kind} interval are in disorder"
        assert kind == "jackknife+" or ((low <= mean) & (mean <= high)).all(), (
            f"{word}: its {kind} interval misses its own prediction"
        )
        _, wider_low, wider_high = surface.predict(x, 0.95, kind)
        assert ((wider_low <= low) & (high <= wider_high)).all(), (
            f"{word}: its {kind} interval shrinks with more confidence"
        )
    (_, low, high), (_, inner_low, inner_high) = surface.predict(x, 0.8), surface.predict(x, 0.8, "mean")
    assert ((low <= inner_low) & (inner_high <= high)).all(), (
        f"{word}: a new run is said to be better known than the expected response"
    )
    for confidence in (0.0, 1.0, 95.0):
        _refuses(f"{word} accepts a confidence of {confidence:g}", surface.predict, x, confidence)


def _check_gradient(word: str, surface: Surface, x: Floats, spread: float) -> None:
    space = surface.space
    slopes = surface.gradient(x)
    assert slopes.shape == x.shape, f"{word}: its gradient has shape {slopes.shape}, not {x.shape}"
    for j, factor in enumerate(space):
        if not space.numeric[j]:
            assert (slopes[:, j] == 0).all(), (
                f"{word}: its gradient by the category {factor.name} is not zero"
            )
            continue
        reach = factor.high - factor.low
        step = STEP * reach * np.eye(len(space))[j]
        difference = (surface.predict(x + step) - surface.predict(x - step)) / (2.0 * STEP * reach)
        error = np.abs(slopes[:, j] - difference).max() * reach / spread
        assert error <= SLOPE_ERROR, f"{word}: its gradient by {factor.name} is off by {error:.1g} spreads"


def _check_press(word: str, found: ModelFit, request: ModelRequest) -> None:
    assert np.isfinite(found.press), f"{word}: its leave-one-out error is not finite"
    seen = float(np.square(request.data.y - found.surface.predict(request.data.points)).sum())
    assert found.press > seen, (
        f"{word}: errors at runs left out ({found.press:.4g}) are not larger than at runs seen ({seen:.4g}), "
        "so the runs were not left out"
    )


def _check_file(word: str, surface: Surface, x: Floats, newer: tuple[str, ...]) -> None:
    document = json.loads(json.dumps(surface.to_json(), allow_nan=False))
    again = read_surface(document)
    _same(surface, again, x, f"{word} predicts something else when it is read from its file")
    assert again.to_json() == surface.to_json(), f"{word} writes another file when it is read from its file"
    for key in document:
        rest = {name: value for name, value in document.items() if name != key}
        if key not in newer:
            _refuses(f"{word} is read from a file without '{key}'", read_surface, rest)
            continue
        try:
            read_surface(rest)
        except RsmkitError as error:
            raise AssertionError(f"{word} cannot be read from an older file, without '{key}'") from error


def _check_report(word: str, surface: Surface) -> None:
    fitted = FittedResponse(surface)
    report = fitted.report()
    json.dumps(report, allow_nan=False)
    assert report.get("response") == RESPONSE, f"{word}: its report does not name its response"
    assert isinstance(report.get("model"), str), f"{word}: its report does not name its model"
    assert RESPONSE in fitted.summary(), f"{word}: its summary does not name its response"
    html = fitted._repr_html_()
    assert RESPONSE not in html, f"{word}: its HTML takes the response's name for HTML"
    assert escape(RESPONSE) in html, f"{word}: its HTML does not name its response"
    page = page_model(surface)
    if page is not None:
        json.dumps(page, allow_nan=False)
        assert isinstance(page.get("kind"), str), f"{word}: its page data do not name their function"


def _refuses(otherwise: str, call: Callable[..., Any], *arguments: Any) -> None:
    try:
        call(*arguments)
    except RsmkitError:
        return
    raise AssertionError(otherwise)
