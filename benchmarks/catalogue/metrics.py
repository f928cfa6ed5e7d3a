"""Figures of a design for a model: each metric of the catalogue by what rsmkit calls it."""

import math
import re

import numpy as np

import rsmkit as rk
from catalogue.answers import WORKED, Answer, NothingToAskError, NotThereError, finished, reported, worked
from catalogue.designs import REDUCE, DesignModel, DesignModels
from catalogue.formula import as_formula
from catalogue.structures import of_fraction, resolution

FINISH = "reciprocal complement squared percent"


def answer(models: DesignModels, check: dict) -> Answer:
    """The number of a metric at a key."""
    metric, key = check["metric"], check.get("key") or []
    steps = key if isinstance(key, list) else [part for part in str(key).split(".") if part]
    if metric in ("clear_effects", "defining_relation", "minimum_aberration"):
        return of_fraction(check, metric, [str(step) for step in steps])
    if metric not in METRICS:
        raise NotThereError(f"designs: {metric.replace('_', ' ')}")
    if steps and steps[-1] == "len" and metric in ("prediction_variance", "vif"):
        raise NothingToAskError
    found = METRICS[metric](models, models.get(check), check, steps)
    if check.get("times_runs"):
        found = found.changed(lambda x: x * len(models.get(check)))
    return finished(found, check, FINISH)


def _of_quality(name: str):
    def found(models, model: DesignModel, check, steps) -> Answer:
        key = "largest_variance" if check.get("result") == "max_prediction_variance" else name
        return reported(_needed(getattr(model.quality, key)))

    return found


def _needed(value):
    if value is None:
        raise NotThereError("a model that the design cannot estimate")
    return value


def _vif(models, model: DesignModel, check, steps) -> Answer:
    values = model.quality.vif
    if not values:
        raise NotThereError("a model that the design cannot estimate")
    if check.get("terms"):
        chosen = _matching(model, check["terms"])
        return worked(
            REDUCE[check.get("reduce", "mean")]([values[model.names[model.place(n)]] for n in chosen])
        )
    if steps[0] in REDUCE:
        return worked(REDUCE[steps[0]](list(values.values())))
    return reported(values[model.names[model.place(steps[0])]])


def _matching(model: DesignModel, pattern: str) -> list[str]:
    return [n for n in model.columns if n != "Intercept" and re.fullmatch(pattern, n)]


def _power(models, model: DesignModel, check, steps) -> Answer:
    options = check.get("options") or {}
    signal = 2 * options["effect_size"] / options.get("sigma", 1.0)
    powers = rk.power_of_terms(
        model.design, terms=model.model.terms, signal_to_noise=signal, significance=options.get("alpha", 0.05)
    )
    if check.get("terms"):
        values = [powers[model.names[model.place(n)]] for n in _matching(model, check["terms"])]
        found = worked(REDUCE[check.get("reduce", "mean")](values))
    elif steps[0] in REDUCE:
        found = worked(REDUCE[steps[0]]([v for name, v in powers.items() if name != "1"]))
    else:
        found = reported(powers[model.names[model.place(steps[0])]])
    return found


def _alias(models, model: DesignModel, check, steps) -> Answer:
    if steps[0] in ("model_terms", "alias_terms"):
        raise NothingToAskError
    names = list(model.settings.columns)
    if any(model.model.levels):
        raise NotThereError("alias matrices of categories")
    space = rk.Space([rk.Factor(name, -1.0, 1.0) for name in names])
    design = rk.Design(space, model.settings[names].to_numpy(float), ("given",) * len(model))
    inside = [names.index(name) for name in model.model.names]

    def wide(exponents) -> tuple[int, ...]:
        found = [0] * len(names)
        for place, power in zip(inside, exponents, strict=True):
            found[place] = power
        return tuple(found)

    own = rk.Terms(tuple(wide(e) for e in model.model.terms.exponents), (0,) * len(names))
    squares = (check.get("options") or {}).get("alias_terms") == "quadratic"
    more = [
        e
        for e in rk.full_terms(space, 2).exponents
        if sum(e) == 2 and e not in own.exponents and (squares or max(e) == 1)
    ]
    matrix, _, _ = rk.alias_matrix(design, terms=own, potential=rk.Terms((*own.exponents, *more), own.levels))
    if steps[0] == "max_abs":
        return worked(np.abs(matrix).max())
    if steps[0] == "frobenius_norm":
        return worked(np.linalg.norm(matrix))
    if steps[0] != "matrix":
        raise NothingToAskError
    places = [own.exponents.index(wide(model.model.terms.exponents[p])) for p in model.order]
    row = matrix[places[int(steps[1])]]
    return worked(REDUCE[steps[2]](list(row))) if steps[2] in REDUCE else reported(row[int(steps[2])])


def _degrees(models, model: DesignModel, check, steps) -> Answer:
    quality = model.quality
    mean = int(model.model.constant)
    values = {
        "model": quality.rank - mean,
        "residual": quality.runs - quality.rank,
        "total": quality.runs - mean,
        "pure_error": quality.runs - quality.distinct,
        "lack_of_fit": quality.distinct - quality.rank,
    }
    return worked(values[steps[0]])


def _leverage(models, model: DesignModel, check, steps) -> Answer:
    values = model.quality.leverages
    if not values:
        raise NotThereError("a model that the design cannot estimate")
    return worked(REDUCE[steps[0]](values)) if steps[0] in REDUCE else reported(values[int(steps[0])])


def _fraction(models, model: DesignModel, check, steps) -> Answer:
    quality = model.quality
    if steps[0] == "max_prediction_variance" or steps == ["quantiles", "1.0"]:
        return reported(_needed(quality.largest_variance))
    if steps[0] == "average_prediction_variance":
        return reported(_needed(quality.average_variance))
    if steps[0] == "min_prediction_variance":
        return reported(_needed(quality.variance_fractions)[0])
    fractions, variances = rk.design_space_fraction(model.design, terms=model.model.terms)
    if steps[0] == "quantiles":
        return reported(np.interp(float(steps[1]), fractions, variances))
    if steps[0] == "median_prediction_variance":
        return reported(np.median(variances))
    if steps[0] == "scaled_average_prediction_variance":
        return worked(_needed(quality.average_variance) * len(model))
    raise NotThereError("designs: another figure of the fraction of design space")


def _information(models, model: DesignModel, check, steps) -> Answer:
    word = steps[0]
    if word == "coefficient_variances":
        return _variances(models, model, check, steps)
    if word in ("n_runs", "n_parameters", "rank", "residual_df"):
        quality = model.quality
        residual = quality.runs - quality.rank
        values = {
            "n_runs": quality.runs,
            "n_parameters": quality.p,
            "rank": quality.rank,
            "residual_df": residual,
        }
        return (worked if word == "residual_df" else reported)(values[word])
    how = reported if model.same else worked
    own = model.information
    if word == "xtx":
        i, j = int(steps[1]), int(steps[2])
        return how(own.matrix[model.order[i], model.order[j]] if model.same else model.xtx[i, j])
    if word == "inverse":
        return how(model.covariance[_at(model, steps[1]), _at(model, steps[2])])
    if word == "estimate_correlations":
        errors = np.sqrt(np.diag(model.covariance))
        i, j = _at(model, steps[1]), _at(model, steps[2])
        return how(model.covariance[i, j] / errors[i] / errors[j])
    if word == "is_diagonal":
        return worked(float(np.abs(model.xtx - np.diag(np.diag(model.xtx))).max() < 1e-9))
    if not model.same:
        raise NotThereError("a column that rsmkit codes otherwise")
    if word == "eigenvalues":
        values = own.eigenvalues
        return (
            worked(REDUCE[steps[1]](list(values))) if steps[1] in REDUCE else reported(values[int(steps[1])])
        )
    values = {
        "determinant": lambda: reported(own.determinant),
        "d_criterion": lambda: reported(own.d_criterion),
        "a_criterion": lambda: reported(own.a_criterion),
        "a_criterion_per_parameter": lambda: worked(own.a_criterion / len(own.names)),
        "e_criterion": lambda: reported(own.e_criterion),
        "max_abs_estimate_correlation": lambda: reported(own.largest_correlation),
    }
    if word not in values:
        raise NotThereError(f"designs: {word.replace('_', ' ')}")
    return values[word]()


def _at(model: DesignModel, word: str) -> int:
    return int(word) if word.isdigit() else model.columns.index(word)


def _variances(models, model: DesignModel, check, steps) -> Answer:
    other = models.get(check, check["relative_to"]) if check.get("relative_to") else None

    def variance(name: str) -> float:
        value = float(np.diag(model.covariance)[model.columns.index(name)])
        return value / float(np.diag(other.covariance)[other.columns.index(name)]) if other else value

    if check.get("terms"):
        chosen = [
            n for n in model.columns if re.fullmatch(check["terms"], n) and (not other or n in other.columns)
        ]
        values = [math.sqrt(variance(n)) if check.get("root") else variance(n) for n in chosen]
        if check.get("count"):
            (side, limit), *_ = check["count"].items()
            scaled = [v * len(model) for v in values] if check.get("times_runs") else values
            count = sum(v > limit if side == "above" else v < limit for v in scaled)
            return Answer(float(count) / (len(model) if check.get("times_runs") else 1), WORKED)
        return worked(REDUCE[check.get("reduce", "mean")](values))
    name = ".".join(steps[1:])
    if name in REDUCE:
        return worked(REDUCE[name]([variance(n) for n in model.columns]))
    name = next((n for n in model.columns if n == name or as_formula(n) == as_formula(name)), name)
    value = reported(variance(name))
    if check.get("root") and model.same and not other:
        return reported(model.quality.standard_errors[model.names[model.place(name)]])
    value = value if model.same and not other else worked(value.value)
    return finished(value, check, "root")


def _criterion(name: str):
    def found(models, model: DesignModel, check, steps) -> Answer:
        if not model.same:
            raise NotThereError("a column that rsmkit codes otherwise")
        return reported(getattr(model.information, name))

    return found


def _aberration(models, model: DesignModel, check, steps) -> Answer:
    if steps[0] == "n_runs":
        return reported(len(model))
    if steps[0] == "n_factors":
        return reported(len(model.model.space))
    return resolution(models.entry, check, steps[0])


def _correlation(models, model: DesignModel, check, steps) -> Answer:
    matrix, names = rk.term_correlations(model.design, terms=model.model.terms)
    upper = np.abs(matrix[np.triu_indices(len(names), 1)])
    if steps[0] in ("max_abs_r", "mean_abs_r"):
        return worked(upper.max() if steps[0] == "max_abs_r" else upper.mean())
    places = [names.index(model.names[model.place(name)]) for name in model.columns if name != "Intercept"]
    if steps[0] != "matrix":
        raise NotThereError("designs: another figure of correlations")
    return reported(matrix[places[int(steps[1])], places[int(steps[2])]])


METRICS = {
    "moment_aberration": _aberration,
    "correlation": _correlation,
    "alias_matrix": _alias,
    "vif": _vif,
    "power": _power,
    "degrees_of_freedom": _degrees,
    "d_efficiency": _of_quality("d_efficiency"),
    "a_efficiency": _of_quality("a_efficiency"),
    "g_efficiency": _of_quality("g_efficiency"),
    "average_prediction_variance": _of_quality("average_variance"),
    "scaled_condition_number": _of_quality("condition_number"),
    "prediction_variance": _leverage,
    "fds": _fraction,
    "information_matrix": _information,
    "a_optimality": _criterion("a_criterion"),
    "e_optimality": _criterion("e_criterion"),
}
