"""Predictions, optima, paths, desirability: what a fitted surface says at points, and where to go."""

import itertools
import json
import math
from functools import cache

import numpy as np
from patsy import ModelDesc

import rsmkit as rk
from catalogue.answers import Answer, NothingToAskError, NotThereError, finished, reported, worked
from catalogue.fits import Fit, Fits
from catalogue.formula import as_formula
from catalogue.runs import table_of
from rsmkit.design.families.composite import star_distance
from rsmkit.errors import RsmkitError

DISTRIBUTIONS = {
    "f_value", "t_value", "chi2_value", "t_value_cdf", "z_value", "dunnett_value", "composite_desirability",
}  # fmt: skip


def place_of(fit: Fit, point: dict) -> np.ndarray:
    """A point of the catalogue, what it leaves out at zero, in the order of the fit's factors."""
    model, found = fit.model, []
    for name in model.names:
        if name in model.levels:
            found.append(float(model.level(name, point.get(name))))
        elif name in model.settings:
            found.append(float(point.get(name) or 0.0))
        else:
            inside = {n: np.array([float(point.get(n) or 0.0)]) for n in model.settings if n in name}
            from patsy import dmatrix

            found.append(float(np.asarray(dmatrix(f"0 + {name}", inside))[0, 0]))
    return np.array([found])


def prediction(fits: Fits, check: dict) -> Answer:
    fit = fits.get(check)
    point, bound = place_of(fit, check["point"]), check.get("bound", "predicted")
    if "error" in check:
        column = check.get("observed") or check.get("response") or fits.entry["responses"][0]["name"]
        observed = float(table_of(fits.entry)[column][check["run"] - 1])
        error = float(fit.surface.predict(point)[0]) - observed
        return worked(100 * error / observed if check["error"] == "percent" else error)
    if bound == "predicted":
        return reported(fit.surface.predict(point)[0])
    if bound == "leverage":
        return reported(fit.surface.leverage(point)[0])
    if bound == "std_error":
        return worked(fit.report["sigma"] * math.sqrt(fit.surface.leverage(point)[0]))
    kind = "mean" if bound.startswith("ci") else "prediction"
    _, low, high = fit.surface.predict(point, interval=0.95, kind=kind)
    if bound.endswith("half_width"):
        return worked((high[0] - low[0]) / 2)
    return reported(low[0] if bound.endswith("low") else high[0])


def best_corner(fits: Fits, check: dict) -> Answer:
    fit, chosen = fits.get(check), check["factors"]
    corners = list(itertools.product([-1.0, 1.0], repeat=len(chosen)))
    points = np.vstack([place_of(fit, dict(zip(chosen, c, strict=True))) for c in corners])
    values = fit.surface.predict(points)
    best = int(np.argmin(values) if check.get("goal") == "minimize" else np.argmax(values))
    return worked(corners[best][chosen.index(check["factor"])])


def target_setting(fits: Fits, check: dict) -> Answer:
    """Where a line or parabola along one factor reaches a target; the root nearer the centre."""
    fit = fits.get(check)
    at = [place_of(fit, {**check.get("point", {}), check["solve"]: x}) for x in (-1.0, 0.0, 1.0)]
    low, middle, high = fit.surface.predict(np.vstack(at))
    roots = np.roots(
        [*_without_zero((high + low) / 2 - middle, middle), (high - low) / 2, middle - check["target"]]
    )
    real = roots[np.isreal(roots)].real
    if not real.size:
        raise RsmkitError("no setting reaches the target")
    coded = float(real[np.argmin(np.abs(real))])
    if check.get("units") != "actual":
        return worked(coded)
    factor = next(f for f in fits.entry["factors"] if f["name"] == check["solve"])
    return worked((factor["high"] + factor["low"]) / 2 + coded * (factor["high"] - factor["low"]) / 2)


def _without_zero(curvature: float, scale: float) -> list[float]:
    return [] if abs(curvature) <= 1e-9 * max(1.0, abs(scale)) else [curvature]


def canonical_number(report: dict, names, key: str) -> Answer:
    """A number of the stationary point or the canonical analysis of a report."""
    _, what, *rest = key.split(".")
    point = report["stationary_point"]
    values, vectors = report["eigenvalues"], report["eigenvectors"]
    if "reason" in point and what in ("stationary_point_coded", "predicted_response", "canonical_axes"):
        raise RsmkitError(point["reason"])
    if what == "stationary_point_coded":
        return reported(point["coded"][rest[0]])
    if what == "stationary_point_actual":
        return reported(point["natural"][rest[0]])
    if what == "predicted_response":
        return reported(point["predicted"])
    if values is None:
        raise RsmkitError(point.get("reason", "no canonical analysis"))
    order = sorted(range(len(values)), key=lambda i: -abs(values[i]))
    if what == "eigenvalues" and not rest[0].isdigit():
        return worked({"sum": sum, "prod": math.prod, "max": max, "min": min}[rest[0]](values))
    if what == "eigenvalues":
        return reported(values[order[int(rest[0])]])
    vector = [row[order[int(rest[0])]] for row in vectors] if rest and rest[0].isdigit() else []
    if what == "eigenvectors":
        return reported(vector[int(rest[1])])
    if what == "canonical_axes" and rest[1] == "constant":
        return worked(-sum(v * point["coded"][n] for v, n in zip(vector, names, strict=True)))
    if what == "canonical_axes":
        return reported(vector[list(names).index(rest[2])])
    raise NotThereError("canonical analysis: forms other than A and B of the stationary point")


def optimum(fits: Fits, check: dict) -> Answer:
    fit = fits.get(check, natural="actual" in check["key"])
    found = canonical_number(fit.report, fit.model.names, check["key"])
    if check.get("sign_of"):
        sign = canonical_number(fit.report, fit.model.names, check["sign_of"]).value
        found = Answer(found.value * math.copysign(1.0, sign), found.how)
    return Answer(abs(found.value), found.how) if check.get("abs") else found


def steepest(fits: Fits, check: dict) -> Answer:
    fit = fits.get(check, natural=True)
    names, steps = fit.model.names, check.get("steps", 1)
    start, unit = rk.steepest_path(fit.surface.surface, [0.0, 1.0]).coded
    how, place = reported, names.index(check["key"])
    if "radius" in check:
        radius = float(check["radius"]) * steps
    else:
        along = names.index(check["per"])
        change = (unit - start)[along]
        if change * check["change"] < 0:
            raise RsmkitError("the path goes the other way")
        radius = abs(check["change"]) / fit.model.space.factors[along].half_range / abs(change) * steps
        how = worked
    path = rk.steepest_path(fit.surface.surface, [0.0, radius])
    values = path.natural if check.get("units", "actual") == "actual" else path.coded
    if check.get("from_centre"):
        return worked(values[1][place] - values[0][place])
    return how(values[1][place])


def box_cox(fits: Fits, check: dict) -> Answer:
    fit, (word, _, power) = fits.get(check), check["key"].partition(".")
    found = fit.report["box_cox"]
    if "reason" in found:
        raise RsmkitError(found["reason"])
    if word in ("sse", "ln_sse"):
        wanted = float(power) if power else found["power"]
        listed = {round(x, 9): s for x, s in zip(found["curve"]["power"], found["curve"]["sse"], strict=True)}
        if round(wanted, 9) in listed:
            sse = reported(listed[round(wanted, 9)])
        else:
            sse = worked(_scaled_sse(fit, wanted))
        return sse.changed(math.log) if word == "ln_sse" else sse
    key = {"lambda": "power", "lambda_ci.0": "low", "lambda_ci.1": "high"}
    return reported(found[key[check["key"]]])


def _scaled_sse(fit: Fit, power: float) -> float:
    mean = np.log(fit.y).mean()
    scaled = (
        np.log(fit.y) * np.exp(mean)
        if power == 0
        else (fit.y**power - 1) / (power * np.exp(mean * (power - 1)))
    )
    other = rk.fit_surface(
        fit.model.space, fit.model.points, scaled, terms=fit.model.terms, deterministic=False
    )
    return float(other.report()["anova"]["residual"]["ss"])


def _desires(check: dict) -> list:
    words = ("goal", "low", "high", "target", "weight")
    return [rk.Desire(**{w: g[w] for w in words if g.get(w) is not None}) for g in check["goals"]]


def _value_of(text: str, **quantities) -> float:
    return float(rk.parse_expression(text, known=tuple(quantities))(quantities))


def desirability(fits: Fits, check: dict) -> Answer:
    desires, predicted = _desires(check), []
    for goal in check["goals"]:
        predicted.append(prediction(fits, {**goal, "point": check["point"]}).value)
    word, _, which = check.get("key", "composite").partition(".")
    quantities = {f"y{i}": value for i, value in enumerate(predicted)}
    if word == "composite":
        return reported(_value_of(rk.desirability(dict(zip(quantities, desires, strict=True))), **quantities))
    return reported(_value_of(desires[int(which)].text(f"y{which}"), **quantities))


def transmitted(fits: Fits, check: dict) -> Answer:
    """Variance that noise factors of variance one pass on, as a polynomial of the others or at a point."""
    fit, noise = fits.get(check), check["noise"]
    spread = {z: float((check.get("sigma_z") or {}).get(z, 1.0)) for z in noise}
    terms = {frozenset(row["name"].split("*")): row["estimate"] for row in fit.report["terms"]}
    controls = [f["name"] for f in fits.entry["factors"] if f["name"] not in noise]
    error = fit.report["sigma"] ** 2 if check.get("error", True) else 0.0
    slopes = {z: {x: terms.get(frozenset((x, z)), 0.0) for x in controls} for z in noise}
    base = {z: terms.get(frozenset((z,)), 0.0) for z in noise}
    key = check["key"]
    if key in ("variance", "poe"):
        point = check.get("point", {})
        passed = (
            spread[z] * (base[z] + sum(s * point.get(x, 0.0) for x, s in slopes[z].items())) ** 2
            for z in noise
        )
        total = error + sum(passed)
        return worked(math.sqrt(total) if key == "poe" else total)
    if key == "Intercept":
        return worked(error + sum(spread[z] * base[z] ** 2 for z in noise))
    if "·" in key:
        a, b = key.split("·")
        return worked(sum(2 * spread[z] * slopes[z][a] * slopes[z][b] for z in noise))
    if key.endswith("²"):
        return worked(sum(spread[z] * slopes[z][key[:-1]] ** 2 for z in noise))
    return worked(sum(2 * spread[z] * base[z] * slopes[z][key] for z in noise))


@cache
def surface_of(text: str):
    """The surface of printed coefficients, through exact runs made from them."""
    spec = json.loads(text)
    names = spec["factor_names"]
    exponents, values = [], []
    for row in spec["coefficients"]:
        powers = dict.fromkeys(names, 0)
        if row["term"] != "Intercept":
            for factor in ModelDesc.from_formula("0 + " + as_formula(row["term"])).rhs_termlist[-1].factors:
                base, _, power = factor.code.removeprefix("I(").removesuffix(")").partition("**")
                powers[base.strip()] += int(power or 1)
        exponents.append(tuple(powers.values()))
        values.append(float(row["coefficient"]))
    space = rk.Space([rk.Factor(name, -1.0, 1.0) for name in names])
    given = rk.Terms(tuple(exponents), (0,) * len(names))
    whole = rk.Terms(tuple(dict.fromkeys([*rk.full_terms(space, 2).exponents, *exponents])), given.levels)
    points = np.random.default_rng(1).choice([-1.0, 0.0, 1.0], (4 * len(whole) + 20, len(names)))
    y = given.matrix(points) @ np.array(values)
    return rk.fit_surface(space, points, y, terms=whole, deterministic=False)


def library_value(check: dict) -> Answer:
    """A number of one of process-improve's functions, where rsmkit has one that answers the same."""
    function, args, words = check["function"], check.get("args") or [], check.get("kwargs") or {}
    if function in DISTRIBUTIONS:
        raise NothingToAskError
    if function == "blocking_alpha":
        order = ("n_cube_runs", "n_center_cube", "n_factors", "n_center_axial", "n_axial_replicates")
        values = {**dict(zip(order, args, strict=False)), **{k: v for k, v in words.items() if k in order}}
        cube, center, k, axial = (values[name] for name in order[:4])
        repeats = values.get("n_axial_replicates", 1)
        found = reported(star_distance(k, cube, center, axial, "orthogonal", star_replicates=repeats))
        return finished(found, check, "squared")
    if function == "individual_desirability":
        return reported(_value_of(_desires({"goals": [args[1]]})[0].text("y"), y=float(args[0])))
    if function == "allocate_runs":
        return finished(_allocation(words, check["key"]), check, "root squared")
    if function != "optimize_responses":
        raise NotThereError("OMARS designs" if "omars" in function else function.replace("_", " "))
    models = args[0] if args else words.get("fitted_models")
    if len(models) != 1 or words.get("method") == "desirability":
        raise NotThereError("desirability of printed equations")
    spec = {k: models[0][k] for k in ("factor_names", "coefficients")}
    surface, names = surface_of(json.dumps(spec, sort_keys=True)), spec["factor_names"]
    found = _of_equation(surface, names, words, check["key"])
    if check.get("sign_of"):
        sign = _of_equation(surface, names, words, check["sign_of"]).value
        found = Answer(found.value * math.copysign(1.0, sign), found.how)
    if check.get("abs"):
        found = Answer(abs(found.value), found.how)
    return finished(found, check, "root squared")


def _allocation(words: dict, key: str) -> Answer:
    sides = ("a", "b")
    splits = rk.allocate_runs(
        float(words["budget"]),
        tuple(float(words[f"variance_{x}"]) for x in sides),
        tuple(float(words.get(f"cost_{x}", 1.0)) for x in sides),
    )
    if key == "splits.len":
        return worked(len(splits))
    which, what = key.removeprefix("splits.").split(".")
    split = max(splits, key=lambda s: s.efficiency) if which == "best" else splits[int(which)]
    if what.startswith("runs_"):
        return reported(split.runs[sides.index(what[-1])])
    return reported(getattr(split, what))


def _of_equation(surface, names, words, key: str) -> Answer:
    head, *rest = key.split(".")
    if head == "ridge_analysis" and rest[0] == "eigenvalues":
        return reported(sorted(surface.report()["eigenvalues"])[int(rest[1])])
    if head == "ridge_analysis":
        goal = "minimize" if words.get("ridge_direction") == "minimize" else "maximize"
        radius = np.linspace(0.0, _farthest(words.get("search_bounds")), words.get("n_steps", 10) + 1)[
            int(rest[1])
        ]
        path = rk.ridge_path(surface.surface, [0.0, radius], goal)
        if rest[2] == "coded":
            return reported(path.coded[1][names.index(rest[3])])
        if rest[2] == "actual":
            span = words["factor_ranges"][rest[3]]
            middle, half = (span["high"] + span["low"]) / 2, (span["high"] - span["low"]) / 2
            return worked(middle + half * path.coded[1][names.index(rest[3])])
        column = {"radius": path.radii, "predicted_response": path.predicted, "mu": path.multipliers}
        return reported(column[rest[2]][1])
    if head == "steepest_path":
        step, unit = words.get("step_size", 0.5) * int(rest[1]), rest[2]
        path = rk.steepest_path(surface.surface, [0.0, step])
        if unit not in ("coded", "actual"):
            return reported(path.predicted[1])
        value = path.coded[1][names.index(rest[3])]
        if unit == "coded":
            return reported(value)
        span = words["factor_ranges"][rest[3]]
        return worked((span["high"] + span["low"]) / 2 + value * (span["high"] - span["low"]) / 2)
    return canonical_number(surface.report(), names, key)


def _farthest(bounds) -> float:
    if bounds is None:
        return 1.0
    sides = itertools.chain(*bounds.values()) if isinstance(bounds, dict) else bounds
    return max(abs(x) for x in sides)


def library_text(check: dict, printed: str) -> Answer:
    """How a printed equation's stationary point is called."""
    words, args = check.get("kwargs") or {}, check.get("args") or []
    if check["function"] != "optimize_responses" or not check["key"].endswith("classification"):
        raise NotThereError("OMARS designs" if "omars" in check["function"] else "texts of another program")
    if words.get("flat_tolerance"):
        raise NotThereError("a tolerance for flat axes")
    model = (args[0] if args else words["fitted_models"])[0]
    spec = json.dumps({k: model[k] for k in ("factor_names", "coefficients")}, sort_keys=True)
    kind = rk.canonical_analysis(surface_of(spec).surface).kind
    return Answer(
        kind,
        reported(0).how,
        printed.replace("_point", "") == kind or ("ridge" in printed and kind == "ridge"),
    )
