"""Means and contrasts of categories, Lenth's method, random groups, counts, and textbook tests."""

import json
import math

import numpy as np
import pandas as pd
from scipy import stats

import rsmkit as rk
from catalogue.answers import Answer, NothingToAskError, NotThereError, reported, worked
from catalogue.fits import Fit, Fits
from catalogue.formula import Model
from catalogue.points import best_corner, place_of
from catalogue.runs import coded_runs, runs_to_fit, table_of


def contrast(fits: Fits, check: dict) -> Answer:
    """Of means of levels where the terms are such, else a sum of coefficients."""
    fit, key = fits.get(check), check.get("key", "value")
    model = fit.model
    single = len(model.wanted) >= 1 and not model.constant
    names = {t.split("[")[0].removeprefix("C(").removesuffix(")") for t in check["weights"]}
    if single and len(names) == 1 and abs(sum(check["weights"].values())) < 1e-9 and fit.report["df"]:
        (name,) = names
        if name in model.levels:
            means = rk.estimated_means(fit.surface.surface, name)
            texts = {}
            for term, weight in check["weights"].items():
                level = term.split("[")[1].rstrip("]").removeprefix("S.").removeprefix("T.")
                texts[means.levels[model.level(name, level)]] = weight
            row = rk.contrast_of_means(means, texts)
            keys = {
                "value": "estimate", "std_error": "std_error", "t": "t", "p": "p", "sum_sq": "ss",
                "ci_low": "low", "ci_high": "high",
            }  # fmt: skip
            if key in keys:
                return reported(row[keys[key]])
            return worked(row["t"] ** 2 if key == "f" else (row["high"] - row["low"]) / 2)
    row = sum(w * model.combination(t) for t, w in check["weights"].items())
    if key == "value":
        return worked(row @ fit.surface.coefficients)
    found = fit.functional(row)
    values = {
        "std_error": found["std_error"], "t": found["t"], "p": found["p"], "f": found["t"] ** 2,
        "sum_sq": (found["t"] * fit.report["sigma"]) ** 2, "half_width": (found["high"] - found["low"]) / 2,
        "ci_low": found["low"], "ci_high": found["high"],
    }  # fmt: skip
    return worked(values[key])


def _means_of(fits: Fits, check: dict, model: str):
    fit = fits.get({**check, "model": model})
    return fit, rk.estimated_means(fit.surface.surface, check["factor"])


def tukey(fits: Fits, check: dict) -> Answer:
    """A pair of levels compared with all others in mind."""
    factor, block = check["factor"], check.get("block")
    model = f"C({factor})" + (f" + C({block})" if block else "")
    fit, means = _means_of(fits, check, model)
    return _pair(fit, means, check, check["level"], check["minus"], check["key"], check.get("alpha", 0.05))


def _pair(fit: Fit, means, check, level, minus, key: str, alpha: float) -> Answer:
    i, j = (fit.model.level(check["factor"], x) for x in (level, minus))
    names = means.levels[i], means.levels[j]
    for row in means.report(1 - alpha)["differences"]:
        if set(row["pair"].split(" - ")) == set(names):
            break
    sign = 1.0 if row["pair"].startswith(names[0] + " - ") else -1.0
    difference, error = sign * row["difference"], row["std_error"]
    point = stats.studentized_range.ppf(1 - alpha, len(means.levels), fit.report["df"])
    half = point * error / math.sqrt(2)
    if "low" in row:
        half = (row["high"] - row["low"]) / 2
    bounded = reported if "low" in row else worked
    values = {
        "difference": lambda: reported(difference),
        "p": lambda: reported(row["p"]),
        "p_value": lambda: reported(row["p"]),
        "ci_low": lambda: bounded(difference - half),
        "ci_high": lambda: bounded(difference + half),
        "half_width": lambda: worked(half),
        "std_error": lambda: worked(error / math.sqrt(2)),
        "q_critical": lambda: worked(point),
        "q": lambda: worked(abs(difference) / error * math.sqrt(2)),
        "t": lambda: worked(difference / error),
    }
    return values[key]()


def least_squares_means(fits: Fits, check: dict) -> Answer:
    if check.get("at"):
        raise NotThereError("means with another factor held at one level")
    model = check["model"]
    for name in check.get("categorical") or []:
        model = model.replace(name, f"C({name})")
    fit, means = _means_of(fits, check, model)
    head, _, rest = check["key"].partition(".")
    if not rest and check.get("comparisons", "tukey") != "tukey":
        raise NotThereError("Dunnett's comparisons with a control")
    if not rest:
        count, df = len(means.levels), fit.report["df"]
        point = stats.studentized_range.ppf(0.95, count, df)
        values = {
            "studentized_range": point,
            "critical_value": point / math.sqrt(2),
            "individual_confidence": 1 - 2 * stats.t.sf(point / math.sqrt(2), df),
            "family_confidence": 0.95,
        }
        return worked(values[head])
    item, _, field = rest.rpartition(".")
    if head == "by_level":
        row = means.report(check.get("confidence", 0.95))["levels"][fit.model.level(check["factor"], item)]
        return reported(row[{"ci_low": "low", "ci_high": "high"}.get(field, field)])
    level, minus = item.split(" - ")
    kind = check.get("comparisons", "tukey")
    if kind == "tukey" or field in ("difference", "t"):
        answer = _pair(fit, means, check, level, minus, field, 0.05)
        if field == "std_error":
            return answer.changed(lambda x: x * math.sqrt(2))
        return answer
    if kind == "dunnett":
        raise NotThereError("Dunnett's comparisons with a control")
    row = rk.contrast_of_means(
        means, {means.levels[fit.model.level(check["factor"], level)]: 1.0,
                means.levels[fit.model.level(check["factor"], minus)]: -1.0},
    )  # fmt: skip
    if field == "half_width":
        return worked((row["high"] - row["low"]) / 2)
    return reported(row[{"ci_low": "low", "ci_high": "high", "p_value": "p"}.get(field, field)])


def lenth(fits: Fits, check: dict) -> Answer:
    fit, kind = fits.get(check), check["kind"]
    found = rk.screen_effects(fit.surface.surface)
    scale = 0.5 if check.get("scale") == "coefficient" else 1.0
    if kind in ("lenth_pse", "lenth_me", "lenth_sme"):
        answer = reported(getattr(found, kind.removeprefix("lenth_")))
        return answer.changed(lambda x: x * scale) if scale < 1 else answer
    if kind == "lenth_s0":
        return worked(1.5 * float(np.median(np.abs(found.effects))) * scale)
    if kind == "active_effects":
        margin = found.me if check["margin"] == "ME" else found.sme
        mine = {n for n, e in zip(found.names, found.effects, strict=True) if abs(e) > margin}
        wanted = {"*".join(n for n in fit.model.names if n in t.split("·")) for t in check["terms"]}
        return Answer(", ".join(sorted(mine)), worked(0).how, mine == wanted)
    rows = {row["name"]: row for row in fit.report["screening"].get("effects", [])}
    if kind == "normal_plot":
        rank = check.get("rank")
        if rank is None:
            size = np.abs(found.effects).max()
            ranks = pd.Series((found.effects / size).round(9)).rank()
            rank = ranks[found.names.index(fit.term_name(check["term"]))]
        return worked(rank if check["key"] == "rank" else 100 * (float(rank) - 0.5) / len(found.names))
    name = fit.term_name(check["term"].replace("[S.-1.0]", "").replace("[S.1.0]", ""))
    if name not in rows:
        raise NotThereError("Lenth's method where runs are repeated")
    row = rows[name]
    sign = -1.0 if "[S.-1.0]" in check["term"] and name.count("*") % 2 == 0 else 1.0
    if kind == "lenth_t":
        return reported(sign * row["t"]) if sign > 0 else worked(sign * row["t"])
    return reported(row["p_by_t"])


def curvature(fits: Fits, check: dict) -> Answer:
    fit = fits.get(check)
    found = rk.curvature_test(fit.surface.surface)
    values = {
        "ss_curvature": lambda: reported(found.ss),
        "F": lambda: reported(found.f),
        "f_statistic": lambda: reported(found.f),
        "p_value": lambda: reported(found.p),
        "difference": lambda: reported(found.difference),
        "t_statistic": lambda: worked(math.copysign(math.sqrt(found.f), found.difference)),
        "std_error": lambda: reported(found.std_error),
        "ms_pure_error": lambda: reported(fit.table["pure error"]["ms"]),
    }
    if str(check.get("key")).endswith("_mean"):
        raise NothingToAskError
    return values[check.get("key", "difference")]()


def _mixed(fits: Fits, check: dict, model: str, groups: dict, degrees: str):
    key = json.dumps(["mixed", model, sorted(groups), degrees, check.get("runs"), check.get("response"),
                      check.get("summary")])  # fmt: skip
    if key not in fits.made:
        settings, y = runs_to_fit(fits.entry, check)
        made = Model(settings, model)
        try:
            surface = rk.fit_surface(
                made.space, made.points, y.to_numpy(float), terms=made.terms, random=groups, degrees=degrees,
                deterministic=False,
            )  # fmt: skip
            fits.made[key] = made, surface, surface.report()
        except Exception as error:
            fits.made[key] = error
    if isinstance(fits.made[key], Exception):
        raise fits.made[key]
    return fits.made[key]


def split_plot(fits: Fits, check: dict) -> Answer:
    table, columns = table_of(fits.entry, check.get("runs")), check["whole_plot"]
    if check.get("crossed"):
        groups = {name: table[name].astype(str).tolist() for name in columns}
    else:
        groups = {"plot": table[columns].astype(str).agg(":".join, axis=1).tolist()}
    degrees = "satterthwaite" if check.get("df_method") == "satterthwaite" else "kenward-roger"
    if degrees == "kenward-roger" and check.get("information") == "observed":  # as JMP does
        degrees = "kenward-roger-observed"
    model, surface, report = _mixed(fits, check, check["model"], groups, degrees)
    kind, _, term = check["key"].partition(".")
    return _of_mixed(fits, check, model, surface, report, kind, term)


def _of_mixed(fits, check, model, surface, report, kind, term) -> Answer:
    components = {row["name"]: row for row in report["variance_components"]}
    if kind in ("whole_plot", "residual") or kind in components:
        return reported(components["plot" if kind == "whole_plot" else kind]["variance"])
    if kind == "eta":
        return worked(components["plot"]["variance"] / components["residual"]["variance"])
    if kind == "blup":
        name, _, level = term.partition(".")
        if level in report["blups"].get(name, {}):
            return reported(report["blups"][name][level])
        raise NotThereError(f"no group {level}")
    if kind in ("coefficient", "std_error", "t_value", "p_value", "df_t"):
        row = model.combination(term)
        place = np.flatnonzero(np.abs(row) > 1e-9)
        if place.size != 1 or abs(row[place[0]] - 1) > 1e-9:
            if kind == "coefficient":
                return worked(row @ surface.coefficients)
            value, error, df = surface.judged(_in_rows(surface, row))
            p = 2 * stats.t.sf(abs(value / error), df)
            return worked({"std_error": error, "t_value": value / error, "p_value": p, "df_t": df}[kind])
        key = {"coefficient": "estimate", "std_error": "std_error_adjusted", "t_value": "t", "p_value": "p"}
        line = report["terms"][place[0]]
        return reported(line[{**key, "df_t": "df"}[kind]])
    if kind in ("prediction", "best_corner"):
        holder = Fits(fits.entry)
        fit = Fit.__new__(Fit)
        fit.model, fit.surface = model, surface
        holder.get = lambda *_, **__: fit
        if kind == "prediction":
            return reported(surface.predict(place_of(fit, check["point"]))[0])
        return best_corner(holder, {**check, "factor": term})
    if kind.endswith("_error_df"):
        raise NotThereError("degrees of freedom of the error of a stratum")
    exponents = model.exponents(term)
    name = "*".join(n if e == 1 else f"{n}^{e}" for n, e in zip(model.names, exponents, strict=True) if e)
    row = next((r for r in report["anova_terms"] if r["term"] == name), None)
    if row is None:
        raise NotThereError("a term that the model has not")
    return reported(row[{"f": "F", "p": "p", "df": "numerator_df", "df_den": "denominator_df"}[kind]])


def _in_rows(surface, row):
    return row @ np.linalg.pinv(surface.into_coded).T if hasattr(surface, "into_coded") else row


def variance_component(fits: Fits, check: dict) -> Answer:
    if check.get("bounded") is False:
        raise NotThereError("variances that may be negative")
    table = table_of(fits.entry, check.get("runs"))
    groups = {
        name.replace(":", "*"): table[name.split(":")].astype(str).agg(":".join, axis=1).tolist()
        for name in check["groups"]
    }
    fixed, y = check.get("fixed", []), table[check.get("response") or fits.entry["responses"][0]["name"]]
    factors = list(dict.fromkeys(f for term in fixed for f in term.split(":")))
    settings = (
        table[factors].astype(str) if factors else pd.DataFrame({"one": np.arange(len(table), dtype=float)})
    )
    text = " + ".join(":".join(f"C({f}, Sum)" for f in term.split(":")) for term in fixed) or "1"
    key = json.dumps(["components", text, sorted(groups), check.get("response")])
    if key not in fits.made:
        model = Model(settings, text)
        surface = rk.fit_surface(
            model.space, model.points, y.to_numpy(float), terms=model.terms, random=groups,
            degrees="satterthwaite", deterministic=False,
        )  # fmt: skip
        fits.made[key] = model, surface, surface.report()
    model, surface, report = fits.made[key]
    parts = {row["name"].replace("*", ":"): row for row in report["variance_components"]}
    kind, _, name = check["key"].partition(".")
    if check["key"] in parts:
        return reported(parts[check["key"]]["variance"])
    values = {part: row["variance"] for part, row in parts.items()}
    if kind in ("total", "ratio", "percent", "rmse"):
        total = sum(values.values())
        found = {
            "total": lambda: total,
            "ratio": lambda: values[name] / values["residual"],
            "percent": lambda: 100 * parts[name]["share"],
            "rmse": lambda: math.sqrt(values["residual"]),
        }
        return worked(found[kind]()) if kind != "rmse" else reported(report["sigma"])
    if kind in ("mean", "mean_std_error", "mean_t", "mean_df"):
        line = report["terms"][0]
        key = {"mean": "estimate", "mean_std_error": "std_error", "mean_t": "t", "mean_df": "df"}[kind]
        return reported(line[key])
    if kind in ("f", "f_df", "f_p"):
        wanted = name.replace(":", "*")
        row = next(
            (r for r in report["anova_terms"] if set(r["term"].split("*")) == set(wanted.split("*"))), None
        )
        return reported(row[{"f": "F", "f_df": "denominator_df", "f_p": "p"}[kind]])
    if kind == "effect":
        factor, _, level = name.partition(".")
        return worked(model.combination(f"{factor}[{level}]") @ surface.coefficients)
    if kind.startswith("wald") and check.get("z"):  # a rounded quantile of the normal distribution
        side = -1.0 if kind == "wald_low" else 1.0
        return worked(parts[name]["variance"] + side * check["z"] * parts[name]["std_error"])
    if kind in ("std_error", "wald_low", "wald_high"):
        return reported(parts[name][kind])
    if kind == "covariance":
        first, _, second = name.partition(".")
        places = list(parts)
        return reported(report["variance_covariance"][places.index(first)][places.index(second)])
    words = {"reml_criterion": "reml_deviance", "r_squared": "r2_in_groups"}
    words |= {"r_squared_adj": "r2_in_groups_adjusted"}
    if kind in words:
        return reported(report[words[kind]])
    raise NotThereError(kind)


def mean_squares(fits: Fits, check: dict) -> Answer:
    """Sums of mean squares, and their ratios by Satterthwaite's degrees of freedom."""
    fit, key = fits.get(check), check.get("key", "value")

    def added(asked: dict):
        names = {
            "residual" if term == "Residual" else " + ".join(fit.parts(term)): float(weight)
            for term, weight in asked["terms"].items()
        }
        return rk.mean_square_sum(fit.surface.surface, names, divisor=float(asked.get("divisor", 1)))

    found = added(check)
    if "denominator" in check:
        ratio = found.over(added({"terms": check["denominator"]}))
        words = {"f": ratio.f, "p": ratio.p, "df_num": ratio.numerator_df, "df_den": ratio.denominator_df}
        return reported(words[key])
    if key.startswith("wald") and check.get("z"):  # a rounded quantile of the normal distribution
        side = -1.0 if key == "wald_low" else 1.0
        return worked(found.value + side * check["z"] * found.std_error)
    values = {
        "value": lambda: reported(found.value),
        "root": lambda: worked(math.sqrt(found.value)),
        "df": lambda: reported(found.df),
        "chi2_low": lambda: reported(found.limits(check.get("confidence", 0.95))[0]),
        "chi2_high": lambda: reported(found.limits(check.get("confidence", 0.95))[1]),
        "std_error": lambda: reported(found.std_error),
        "wald_low": lambda: reported(found.wald_limits()[0]),
        "wald_high": lambda: reported(found.wald_limits()[1]),
        "covariance": lambda: reported(found.covariance(added(check["with"]))),
    }
    if key not in values:
        raise NotThereError("modified large-sample limits of variances")
    return values[key]()


def nonadditivity(fits: Fits, check: dict) -> Answer:
    """Tukey's single degree of freedom, as one more column: the square of the fitted values."""
    additive = fits.get(check)
    square = np.square(additive.report["diagnostics"]["fitted"])
    key = json.dumps(["nonadditivity", check["model"], check.get("response"), check.get("runs")])
    if key not in fits.made:
        settings = additive.settings.assign(square=square / np.abs(square).max())
        model = Model(settings, f"{additive.model.text} + square")
        fits.made[key] = rk.fit_surface(
            model.space, model.points, additive.y, terms=model.terms, deterministic=False
        ).report()
    report = fits.made[key]
    row = next(r for r in report["anova_terms"] if r["term"] == "square")["type2"]
    error = report["anova"]["residual"]
    word, _, term = check["key"].partition(".")
    if term:
        line = additive.term_row(term)
        f = line["ms"] / error["ms"]
        return worked(f if word == "f" else stats.f.sf(f, line["df"], error["df"]))
    found = {"ss": row["ss"], "f": row["F"], "p": row["p"], "ss_error": error["ss"], "df_error": error["df"]}
    return worked({**found, "ms_error": error["ms"]}[word])


def glm(fits: Fits, check: dict) -> Answer:
    if check["family"] not in ("binomial", "poisson") or check.get("link") not in (None, "logit", "log"):
        raise NotThereError(
            f"generalised linear models: {check['family']}, {check.get('link') or 'usual link'}"
        )
    settings, y = runs_to_fit(fits.entry, check)
    key = json.dumps(["glm", check["model"], check.get("trials"), check.get("runs"), y.name])
    if key not in fits.made:
        from rsmkit.surfaces.models.glm import checked_sizes, fit_glm

        model = Model(settings, check["model"])
        plain = rk.fit_surface(
            model.space, model.points, y.to_numpy(float), terms=model.terms, deterministic=False
        )
        size = None if check.get("trials") is None else np.full(len(y), float(check["trials"]))
        sizes = checked_sizes("y", check["family"], y.to_numpy(float), size)
        surface = rk.FittedResponse(fit_glm(plain.surface, check["family"], sizes))
        fits.made[key] = model, surface, surface.report()
    model, surface, report = fits.made[key]
    if check.get("term"):
        place = int(np.argmax(np.abs(model.combination(check["term"]))))
        row, word = report["terms"][place], check["key"]
        names = {"coefficient": "estimate", "std_error": "std_error", "z_value": "z", "p_value": "p",
                 "ci_low": "low", "ci_high": "high"}  # fmt: skip
        if word in names:
            answer = reported(row.get(names[word], row.get("t")))
        elif word.startswith("exp_"):
            answer = worked(math.exp(row[names[word.removeprefix("exp_")]]))
        else:
            raise NotThereError(f"generalised linear models: {word}")
        return answer.changed(lambda x: x**2) if check.get("squared") else answer
    head, *rest = check["key"].split(".")
    if head == "fitted":
        place = int(rest[0])
        point = model.points[place : place + 1]
        value, low, high = surface.predict(point, interval=0.95, kind="mean")
        values = {
            "fitted": value,
            "mean": value,
            "predicted": value,
            "ci_low": low,
            "ci_high": high,
            "ci_length": high - low,
        }
        return reported(values[rest[1]][0])
    words = {
        "deviance": "deviance",
        "null_deviance": "null_deviance",
        "log_likelihood": "log_likelihood",
        "aic": "aic",
    }
    if head in words and not rest:
        return reported(report[words[head]])
    if head == "goodness_of_fit" and rest[0] in ("pearson", "deviance"):
        spread = report["dispersion"]
        statistic = spread["pearson"] if rest[0] == "pearson" else report["deviance"]
        if rest[1] == "p_value" and rest[0] == "deviance":
            return worked(stats.chi2.sf(statistic, spread["df"]))
        return reported({"statistic": statistic, "df": spread["df"], "p_value": spread["p"]}[rest[1]])
    raise NotThereError(f"generalised linear models: {head.replace('_', ' ')}")


def one_sample(fits: Fits, check: dict) -> Answer:
    """Student's test of one group against a given mean, as the constant of what is left of it."""
    if check["function"] != "ttest_one_sample" or check.get("y"):
        raise NotThereError("classical tests of one or two samples")
    table, (column, *_) = table_of(fits.entry, check.get("runs")), fits.entry["responses"]
    for name, level in (check.get("x") or {}).items():
        table = table[table[name] == level]
    y = table[check.get("response") or column["name"]].to_numpy(float) - check["kwargs"]["mu"]
    found = rk.fit_surface(
        rk.Space([rk.Factor("one", -1.0, 1.0)]), np.arange(len(y), dtype=float)[:, None], y,
        terms=rk.Terms(((0,),), (0,)), deterministic=False,
    ).report()["terms"][0]  # fmt: skip
    if check["key"] in ("t_value", "p_value"):
        return reported(found[check["key"][0]])
    up = found["estimate"] > 0
    return worked(found["p"] / 2 if up == check["key"].endswith("greater") else 1 - found["p"] / 2)


def two_samples(fits: Fits, check: dict) -> Answer:
    """Student's test of two groups, as the contrast of a factor of two levels."""
    after, before = (coded_runs(fits.entry, {"runs": check[k]})[1] for k in ("runs", "minus"))
    column = check.get("response") or after.columns[0]
    a, b = after[column].to_numpy(float), before[column].to_numpy(float)
    kind, key, confidence = check.get("test", "pooled"), check["key"], check.get("confidence", 0.95)
    if kind == "welch":
        raise NotThereError("tests of two groups of unequal variances")
    if kind == "paired":
        space = rk.Space([rk.Factor("one", -1.0, 1.0)])
        terms = rk.Terms(((0,),), (0,))
        found = rk.fit_surface(
            space, np.arange(len(a), dtype=float)[:, None], a - b, terms=terms, deterministic=False
        )
        row = found.report()["terms"][0] | {"std_dev": found.report()["sigma"], "df": found.report()["df"]}
    else:
        space = rk.Space([rk.Factor("group", levels=("before", "after"))])
        where = np.r_[np.ones(len(a)), np.zeros(len(b))][:, None]
        found = rk.fit_surface(space, where, np.r_[a, b], order=1, deterministic=False)
        row = found.report()["terms"][1] | {
            "pooled_std_dev": found.report()["sigma"],
            "df": found.report()["df"],
        }
    if key in ("ci_low", "ci_high", "half_width"):
        half = stats.t.ppf(0.5 + confidence / 2, row["df"]) * row["std_error"]
        side = {"ci_low": row["estimate"] - half, "ci_high": row["estimate"] + half, "half_width": half}[key]
        return reported(side) if confidence == 0.95 and key != "half_width" else worked(side)
    if key == "p" and check.get("alternative"):
        p, up = row["p"] / 2, row["estimate"] > 0
        return worked(p if up == (check["alternative"] == "greater") else 1 - p)
    return reported(row["estimate" if key == "difference" else key])
