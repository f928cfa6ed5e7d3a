"""The settings of greatest desirability, searched for as a study does."""

import json

import numpy as np

import rsmkit as rk
from catalogue.answers import Answer, NotThereError, reported
from catalogue.fits import Fits


def desirability_optimum(fits: Fits, check: dict) -> Answer:
    """A number at the best setting of several fitted responses."""
    key = json.dumps(["best", check["goals"], check.get("importance"), check.get("bounds")], sort_keys=True)
    if key not in fits.made:
        fits.made[key] = _searched(fits, check)
    surfaces, desires, best = fits.made[key]
    head, *rest = check["key"].split(".")
    predicted = {name: float(surface.predict(best.point[None])[0]) for name, surface in surfaces.items()}
    if head == "optimal_actual":
        return reported(best.factors[rest[0]])
    if head == "predicted_responses":
        return reported(predicted[rest[0]])
    if head == "response_intervals":
        kind = {"confidence_interval": "mean", "prediction_interval": "prediction"}[rest[1]]
        limits = surfaces[rest[0]].predict(best.point[None], 0.95, kind)
        return reported(limits[1 + int(rest[2])][0])
    if head == "individual_desirability":
        values = {
            n: rk.parse_expression(d.text(n), known=(n,))({n: predicted[n]}) for n, d in desires.items()
        }
        return reported(values[rest[0]])
    if head == "composite_desirability":
        text = rk.desirability(desires)
        return reported(rk.parse_expression(text, known=tuple(predicted))(predicted))
    raise NotThereError(f"desirability: {head}")


def _searched(fits: Fits, check: dict):
    surfaces, desires, weights = {}, {}, check.get("importance") or [1.0] * len(check["goals"])
    for i, goal in enumerate(check["goals"]):
        name = goal.get("response") or f"y{i}"
        fit = fits.get({**check, **goal}, natural=True)
        space = fit.model.space
        surfaces[name] = rk.fit_surface(
            space, fit.model.points, fit.y, terms=fit.model.terms, deterministic=False, response=name
        )
        words = {w: goal[w] for w in ("goal", "low", "high", "target", "weight") if goal.get(w) is not None}
        desires[name] = rk.Desire(**words, importance=float(weights[i]))
        bounds = {n: (np.min(c), np.max(c)) for n, c in zip(space.names, fit.model.points.T, strict=True)}
    inside = [f"{n} >= {low:.17g}" for n, (low, _) in bounds.items()]
    inside += [f"{n} <= {high:.17g}" for n, (_, high) in bounds.items()]
    best = rk.search(surfaces, minimize=f"1 - ({rk.desirability(desires)})", subject_to=inside)
    return surfaces, desires, best
