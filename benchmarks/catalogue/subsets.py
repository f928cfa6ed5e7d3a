"""A design on some of its factors, and correlations of its columns."""

from itertools import combinations, product

import numpy as np

import rsmkit as rk
from catalogue.answers import Answer, NotThereError, worked
from catalogue.designs import settings_of
from catalogue.formula import Model, spelled_out
from rsmkit.errors import RsmkitError

MOST = 600
"""Projections that are asked for one by one."""
QUALITY = {
    "d_efficiency": "d_efficiency",
    "a_efficiency": "a_efficiency",
    "g_efficiency": "g_efficiency",
    "average_prediction_variance": "average_variance",
}


def projections(entry: dict, check: dict) -> Answer:
    """Over all choices of so many factors: how many can be fitted, and averages of their figures."""
    settings = settings_of(entry, check)
    chosen = check.get("factors") or check.get("columns") or list(settings.columns)
    text = check.get("model") or "quadratic"
    if check["kind"] == "estimable_projections":
        text = "quadratic" if check.get("squares") else "interactions"
    parts = list(_choices(chosen, check.get("size") or check["order"], check.get("groups")))
    key = check.get("key", "n_failing")
    if key == "n_projections":
        return worked(len(parts))
    if len(parts) > MOST:
        raise NotThereError("projections of a design: too many to ask for one by one")
    figures, fitted, total = [], 0, {}
    for part in parts:
        # projections with the same runs, whatever their order, have the same figures
        own = settings[list(part)]
        same = (own.columns.size, tuple(sorted(map(tuple, own.to_numpy(float).round(9).tolist()))))
        if same not in total:
            words = _text(own, text, check.get("groups"))
            total[same] = _figure(own, words, QUALITY.get(key.removeprefix("averages.")))
        fitted += total[same] is not None
        if total[same] is not None and key.startswith("averages."):
            figures.append(total[same])
    if figures:
        return worked(float(np.mean(figures)))
    counts = {
        "n_estimable": fitted,
        "fraction_estimable": fitted / len(parts),
        "n_failing": len(parts) - fitted,
    }
    return worked(counts[key])


def _choices(names, size, groups):
    if not isinstance(size, dict):
        return combinations(names, size)
    parts = [combinations(groups[group], count) for group, count in size.items()]
    return (tuple(name for part in chosen for name in part) for chosen in product(*parts))


def _text(settings, text: str, groups) -> str:
    """Two-level factors have no squares."""
    words = spelled_out(text, settings.columns)
    for name in settings if groups else ():
        if settings[name].nunique() < 3:
            words = words.replace(f" + I({name} ** 2)", "")
    return words


def _figure(settings, text: str, name: str | None) -> float | None:
    """A figure of the design for the model, any number if none is asked for, None if it cannot be fitted."""
    model = Model(settings, text)
    design = rk.Design(model.space, model.points, ("given",) * len(settings))
    try:
        criterion = rk.information_matrix(design, terms=model.terms).a_criterion
        if name:
            return getattr(rk.assess(design, terms=model.terms, deterministic=False), name)
        return criterion
    except RsmkitError:
        return None


def interaction_columns(entry: dict, check: dict) -> Answer:
    """Correlations of main effects, products of two, and squares."""
    settings = settings_of(entry, check)
    settings = settings[check["columns"]] if check.get("columns") else settings
    squares = check["key"].endswith("square")
    model = Model(settings, spelled_out("quadratic" if squares else "interactions", settings.columns))
    design = rk.Design(model.space, model.points, ("given",) * len(settings))
    matrix, names = rk.term_correlations(design, terms=model.terms)
    k, own = len(settings.columns), np.abs(matrix)
    upper = own[np.triu_indices(len(names), 1)]
    square = [i for i, name in enumerate(names) if name.endswith("^2")]
    columns = model.terms.matrix(model.space.encode(model.points))[:, 1:]
    values = {
        "e_s2": lambda: float(np.mean((columns.T @ columns)[np.triu_indices(len(names), 1)] ** 2)),
        "confounded_pairs": lambda: float(np.sum(np.isclose(upper, 1.0))),
        "max_abs_r": lambda: float(upper.max()),
        "max_abs_r_main_interaction": lambda: float(own[:k, k:].max()),
        "max_abs_r_main_square": lambda: float(own[:k][:, square].max()),
    }
    return worked(values[check["key"]]())
