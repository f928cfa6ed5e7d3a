"""Least-squares fits, kept while an entry's questions last, and questions about them."""

import json
import math
import re
from functools import cached_property

import numpy as np
from scipy import stats

import rsmkit as rk
from catalogue.answers import Answer, NotThereError, reported, worked
from catalogue.formula import Model
from catalogue.runs import runs_to_fit

UNIT = 1e-9
"""Below this a number that should be 0 or 1 is."""


class Fit:
    """A fitted formula and its report."""

    def __init__(self, entry: dict, check: dict, text: str, natural: bool = False):
        settings, y = runs_to_fit(entry, check)
        words = set(re.findall(r"[A-Za-z_]\w*", text))
        used = [c for c in settings if c in words or text.strip().isidentifier()]
        self.kept = (~y.isna() & ~settings[used].isna().any(axis=1)).to_numpy()
        self.y = y[self.kept].to_numpy(float)
        self.settings = settings[self.kept].reset_index(drop=True)
        ranges = natural_ranges(entry) if natural else {}
        self.model = Model(self.settings, text, ranges)
        self.surface = rk.fit_surface(
            self.model.space, self.model.points, self.y, terms=self.model.terms, deterministic=False
        )

    @cached_property
    def report(self) -> dict:
        """The fit's report."""
        return self.surface.report()

    @property
    def table(self) -> dict:
        """Rows of the analysis of variance by source."""
        return {row["source"]: row for row in self.report["anova_table"]}

    def place(self, run: int) -> int:
        """Place of a run (from 1) among those that were fitted."""
        if not self.kept[run - 1]:
            raise NotThereError("a run that was left out")
        return int(self.kept[: run - 1].sum())

    def coefficient(self, term: str, key: str = "estimate") -> Answer:
        """A coefficient, or something of its row; by arithmetic where rsmkit's columns are others."""
        row = self.model.combination(term)
        if (ones := np.flatnonzero(np.abs(row) > UNIT)).size == 1 and abs(row[ones[0]] - 1.0) < UNIT:
            return reported(self.report["terms"][ones[0]][key])
        if key == "estimate":
            return worked(row @ self.surface.coefficients)
        return worked(self.functional(row)[key])

    def functional(self, row: np.ndarray) -> dict:
        """Estimate, standard error, t and p of a combination of coefficients."""
        value, df = float(row @ self.surface.coefficients), self.report["df"]
        if not df or self.surface.fit.exact:
            raise NotThereError("no error left to test by")
        error = math.sqrt(row @ self.surface.covariance @ row)
        half = stats.t.ppf(0.975, df) * error
        p = 2 * stats.t.sf(abs(value / error), df)
        values = {"estimate": value, "std_error": error, "t": value / error, "p": p}
        return values | {"low": value - half, "high": value + half}

    def term_row(self, term: str) -> dict:
        """A row of the tests by term."""
        if term == "Residual":
            return self.table["residual"]
        parts = self.parts(term)
        if len(parts) == 1:
            for row in self.report["anova_terms"]:
                if row["term"] == parts[0]:
                    return {"df": row["df"], **row["type2"]}
            raise NotThereError("a term that the model has not")
        test = rk.extra_sum_of_squares(self.surface.surface, parts)
        return {"df": test.df, "ss": test.ss, "ms": test.ms, "F": test.f, "p": test.p}

    def parts(self, term: str) -> list[str]:
        """The term, and the margins that were added for its sake: one term of nested or level means."""
        model, own = self.model, self.model.exponents(term)
        asked = {model.exponents(t) for t in model.wanted}
        added = [e for e in model.with_margins if e not in asked and any(e)]
        smaller = [w for w in asked if w != own and _inside(w, own)]
        mine = [e for e in added if _inside(e, own) and not any(_inside(e, w) for w in smaller)]
        for e in mine:  # a margin of two terms, neither within the other, belongs to none
            if any(_inside(e, w) and not _inside(own, w) for w in asked):
                raise NotThereError("tests by term where nested terms share a margin")
        return [self._written(e) for e in [*mine, own]]

    def _written(self, exponents) -> str:
        parts = zip(self.model.names, exponents, strict=True)
        return "*".join(n if e == 1 else f"{n}^{e}" for n, e in parts if e)

    def term_name(self, term: str) -> str:
        """A term as rsmkit writes it."""
        exponents = self.model.exponents(term)
        if exponents not in self.model.terms.exponents:
            raise NotThereError("a term that the model has not")
        return self._written(exponents)


def _inside(margin, term) -> bool:
    return all(a in (0, b) for a, b in zip(margin, term, strict=True))


class Fits:
    """Fits of one entry."""

    def __init__(self, entry: dict):
        self.entry, self.made = entry, {}

    def get(self, check: dict, text: str | None = None, natural: bool = False) -> Fit:
        """The fit that a check asks for, or of another formula to the same runs."""
        text = text or check["model"]
        asked = [check.get(k) for k in ("runs", "response", "summary", "transform", "settings")]
        key = json.dumps([text, natural, *asked], sort_keys=True)
        if key not in self.made:
            try:
                self.made[key] = Fit(self.entry, check, text, natural)
            except Exception as error:
                self.made[key] = error
        if isinstance(self.made[key], Exception):
            raise self.made[key]
        return self.made[key]


def natural_ranges(entry: dict) -> dict:
    """Bounds of the numeric factors that a source codes by them."""
    return {
        f["name"]: (f["low"], f["high"])
        for f in entry["factors"]
        if f["type"] == "numeric" and not f.get("coding") and f["low"] < f["high"]
    }


def p_value(fit: Fit, check: dict) -> Answer:
    answer, side = fit.coefficient(check["term"], "p"), check.get("alternative")
    if side is None:
        return answer
    up = fit.coefficient(check["term"]).value > 0
    return answer.changed(lambda p: p / 2 if up == (side == "greater") else 1 - p / 2)


def limits(key: str):
    def found(fit: Fit, check: dict) -> Answer:
        low, high = (fit.coefficient(check["term"], side) for side in ("low", "high"))
        if key == "half":
            answer = worked((high.value - low.value) / 2)
        else:
            answer = low if key == "low" else high
        return answer.changed(lambda x: 2 * x) if check.get("scale") == "effect" else answer

    return found


def effect(fit: Fit, check: dict) -> Answer:
    row = fit.model.combination(check["term"])
    ones = np.flatnonzero(np.abs(row) > UNIT)
    if ones.size == 1 and abs(row[ones[0]] - 1.0) < UNIT:
        line = fit.report["terms"][ones[0]]
        if line["effect"] is not None and abs(line["effect"] - 2 * line["estimate"]) <= UNIT * abs(
            line["effect"]
        ):
            return reported(line["effect"])
    return worked(2 * float(row @ fit.surface.coefficients))


def effect_error(fit: Fit, check: dict) -> Answer:
    """Where the effect is twice the coefficient, its standard error stands beside it."""
    row = fit.model.combination(check["term"])
    ones = np.flatnonzero(np.abs(row) > UNIT)
    if ones.size == 1 and abs(row[ones[0]] - 1.0) < UNIT:
        line = fit.report["terms"][ones[0]]
        twice = line["effect_std_error"]
        if twice is not None and abs(twice - 2 * line["std_error"]) <= UNIT * twice:
            return reported(twice)
    return fit.coefficient(check["term"], "std_error").changed(lambda x: 2 * x)


def by_run(name: str):
    return lambda fit, check: reported(fit.report["diagnostics"][name][fit.place(int(check["run"]))])


def left_out(fit: Fit, check: dict) -> Answer:
    listed, place = fit.report["diagnostics"], fit.place(int(check["run"]))
    return worked(listed["observed"][place] - listed["loo_residual"][place])


def from_table(source: str, key: str):
    def found(fit: Fit, check: dict) -> Answer:
        if source not in fit.table:
            raise NotThereError("no repeated runs in the model's factors")
        return reported(fit.table[source][key])

    return found


def from_term(key: str):
    def found(fit: Fit, check: dict) -> Answer:
        if check["term"] == "Total":
            return reported(fit.table["total"][key])
        return reported(fit.term_row(check["term"])[key])

    return found


def pooled(fit: Fit, check: dict) -> Answer:
    rows = [fit.term_row(term) for term in check["terms"]]
    ss, df = math.fsum(r["ss"] for r in rows), sum(r["df"] for r in rows)
    return worked({"sum_sq": ss, "df": df, "mean_sq": ss / df}[check.get("key", "sum_sq")])


def share_of_total(fit: Fit, check: dict) -> Answer:
    row = fit.term_row(check["term"])
    return worked(100 * row.get("share", row["ss"] / fit.table["total"]["ss"]))


def contribution(fit: Fit, check: dict) -> Answer:
    total, row, noise = fit.table["total"]["ss"], fit.term_row(check["term"]), fit.table["residual"]["ms"]
    if check["term"] != "Residual":
        return worked(100 * (row["ss"] - row["df"] * noise) / total)
    rest = sum(r["type2"]["ss"] - r["df"] * noise for r in fit.report["anova_terms"])
    return worked(100 * (total - rest) / total)


def about_zero(fit: Fit, check: dict) -> Answer:
    found = fit.report["about_zero"]
    places = {
        "ss_mean": ("mean", "ss"),
        "ss_total_uncorrected": ("total", "ss"),
        "ss_regression_uncorrected": ("model", "ss"),
        "df_model_uncorrected": ("model", "df"),
        "ms_regression_uncorrected": ("model", "ms"),
    }
    row, key = places[check["kind"]]
    return reported(found[row][key])


def uncorrected_test(key: str):
    def found(fit: Fit, check: dict) -> Answer:
        if not fit.model.constant and not fit.surface.fit.has_constant:
            return reported(fit.report["model_test"][key])
        df = len(fit.y) - fit.report["df"]
        squares = float(np.square(fit.report["diagnostics"]["fitted"]).sum())
        f = squares / df / fit.report["sigma"] ** 2
        return worked(f if key == "F" else stats.f.sf(f, df, fit.report["df"]))

    return found


def standardised(fit: Fit, check: dict) -> Answer:
    row = fit.model.combination(check["term"])
    return reported(fit.report["terms"][int(np.argmax(np.abs(row)))]["standardised"])


def step_aic(fit: Fit, check: dict) -> Answer:
    n = len(fit.y)
    return worked(n * math.log(fit.table["residual"]["ss"] / n) + 2 * (n - fit.report["df"]))


def spread_at(fit: Fit, runs, digits=None) -> float:
    residual = np.array(fit.report["diagnostics"]["residual"])[[fit.place(int(r)) for r in runs]]
    return float(np.std(residual if digits is None else residual.round(digits), ddof=1))


def dispersion(fit: Fit, check: dict) -> Answer:
    """A row of the dispersion effects where the runs are the levels of one; else from the residuals."""
    chosen = {fit.place(int(r)) for r in check["at"]}
    digits, versus = check.get("round"), check.get("versus")
    if digits is None and (row := _dispersion_row(fit, chosen)) is not None:
        side, line = row
        if versus is None:
            return reported(line["std_dev_high" if side > 0 else "std_dev_low"])
        if len(versus) + len(chosen) == len(fit.y):
            return reported(side * line["log_ratio"]) if side > 0 else worked(side * line["log_ratio"])
    own = spread_at(fit, check["at"], digits)
    if versus is None:
        return worked(own)
    return worked(2 * math.log(own / spread_at(fit, versus, digits)))


def _dispersion_row(fit: Fit, chosen: set) -> tuple[int, dict] | None:
    listed = fit.report["dispersion"].get("effects", [])
    points = fit.surface.data.points
    middles, halves = (points.max(axis=0) + points.min(axis=0)) / 2, np.ptp(points, axis=0) / 2
    signs = (points - middles) / np.where(halves > 0, halves, 1.0)
    for line in listed:
        first = line["name"].split(" = ")[0].split("*")
        column = np.prod([signs[:, fit.model.names.index(n)] for n in first], axis=0)
        for side in (1, -1):
            if set(np.flatnonzero(np.sign(column) == side).tolist()) == chosen:
                return side, line
    return None


def term_key(words: str):
    return lambda fit, check: fit.coefficient(check["term"], words)


def from_report(*path: str):
    def found(fit: Fit, check: dict) -> Answer:
        value = fit.report
        for key in path:
            value = value[key]
        return reported(value)

    return found


KINDS = {
    "coefficient": term_key("estimate"),
    "std_error": term_key("std_error"),
    "t_value": term_key("t"),
    "p_value": p_value,
    "effect": effect,
    "effect_std_error": effect_error,
    "ci_low": limits("low"),
    "ci_high": limits("high"),
    "ci_half_width": limits("half"),
    "standardised_coefficient": standardised,
    "fitted": by_run("fitted"),
    "residual": by_run("residual"),
    "leverage": by_run("leverage"),
    "cooks_distance": by_run("cooks_distance"),
    "studentized_residual": by_run("studentised"),
    "externally_studentized_residual": by_run("deleted"),
    "left_out_prediction": left_out,
    "residual_quantile": lambda f, c: worked(np.quantile(f.report["diagnostics"]["residual"], c["q"])),
    "r_squared": from_report("r2"),
    "r_squared_adj": from_report("r2_adjusted"),
    "r_squared_pred": from_report("r2_predicted"),
    "multiple_r": lambda f, c: worked(math.sqrt(f.report["r2"])),
    "max_r_squared": from_report("lack_of_fit", "largest_r2"),
    "press": from_report("press"),
    "residual_df": from_report("df"),
    "residual_std_error": from_report("sigma"),
    "log_likelihood": from_report("log_likelihood"),
    "aic": from_report("aic"),
    "aicc": from_report("aicc"),
    "bic": from_report("bic"),
    "aic_step": step_aic,
    "f_regression": from_table("model", "F"),
    "f_statistic": from_table("model", "F"),
    "f_regression_p": from_table("model", "p"),
    "f_p_value": from_table("model", "p"),
    "f_uncorrected": uncorrected_test("F"),
    "f_uncorrected_p": uncorrected_test("p"),
    "ms_residual": from_table("residual", "ms"),
    "ss_residual": from_table("residual", "ss"),
    "ss_regression": from_table("model", "ss"),
    "ms_regression": from_table("model", "ms"),
    "df_model": from_table("model", "df"),
    "ss_total": from_table("total", "ss"),
    "anova_sum_sq": from_term("ss"),
    "anova_mean_sq": from_term("ms"),
    "anova_f": from_term("F"),
    "anova_p": from_term("p"),
    "anova_df": from_term("df"),
    "anova_pooled": pooled,
    "percent_of_total": share_of_total,
    "percent_contribution": contribution,
    "adequate_precision": from_report("adequate_precision"),
    "durbin_watson": from_report("durbin_watson"),
    "residual_std_dev": dispersion,
    "residual_log_variance_ratio": dispersion,
}
for _row in ("lack_of_fit", "pure_error"):
    for _key in ("ss", "df", "ms", "f", "p"):
        KINDS[f"{_row}_{_key}"] = from_table(_row.replace("_", " "), "F" if _key == "f" else _key)
for _kind in ["ss_mean", "ss_total_uncorrected", "ss_regression_uncorrected", "df_model_uncorrected"]:
    KINDS[_kind] = about_zero
KINDS["ms_regression_uncorrected"] = about_zero


def nested(fits: Fits, check: dict) -> Answer:
    """The larger model against the smaller: an extra sum of squares where terms leave it, else by hand."""
    full, small = fits.get(check, check["full"]), fits.get(check, check["model"])
    error = fits.get(check, check["error"]) if check.get("error") else full
    return _between(full, small, error, check["key"])


def extra(key: str):
    """``part`` (the whole model by default) less what ``after`` explains."""

    def found(fits: Fits, check: dict) -> Answer:
        error, part = fits.get(check), fits.get(check, check.get("part", check["model"]))
        if not check.get("after"):
            row = part.table["model"]
            if key in ("ss", "ms"):
                return reported(row[key])
            f = row["ms"] / error.report["sigma"] ** 2
            return worked(f if key == "f" else stats.f.sf(f, row["df"], error.report["df"]))
        return _between(part, fits.get(check, check["after"]), error, key)

    return found


def _between(full: Fit, small: Fit, error: Fit, key: str) -> Answer:
    leaving = [t for t in full.model.wanted if t not in small.model.wanted]
    inside = (
        all(t in full.model.wanted for t in small.model.wanted)
        and full.model.constant == small.model.constant
    )
    if inside and leaving and full.model.whole and small.model.whole:
        names = [":".join(sorted(t)) for t in leaving]
        row = rk.extra_sum_of_squares(
            full.surface.surface, [full.term_name(n) for n in names], error.surface.surface
        )
        return reported({"ss": row.ss, "df": row.df, "ms": row.ms, "f": row.f, "p": row.p}[key])
    df = small.report["df"] - full.report["df"]
    ss = small.table["residual"]["ss"] - full.table["residual"]["ss"]
    if key in ("ss", "df", "ms"):
        return worked({"ss": ss, "df": df, "ms": ss / df}[key])
    f = ss / df / error.report["sigma"] ** 2
    return worked(f if key == "f" else stats.f.sf(f, df, error.report["df"]))


def half_units(y: np.ndarray, rounding: dict) -> np.ndarray:
    """Half a unit of the last printed digit of every response."""
    if "decimals" in rounding:
        return np.full(len(y), 0.5 * 10.0 ** -float(rounding["decimals"]))
    return 0.5 * 10.0 ** (np.floor(np.log10(np.abs(y))) - rounding["significant"] + 1)


def carried(fits: Fits, check: dict) -> float:
    """How far rounded responses can move a number: its gradient times half a unit of each."""
    fit = fits.get(check)
    half = half_units(fit.y, check["data_rounding"])
    residual = np.array(fit.report["diagnostics"]["residual"])
    if check["kind"] == "coefficient":
        columns = fit.model.terms.matrix(fit.model.space.encode(fit.model.points))
        gradient = fit.model.combination(check["term"]) @ np.linalg.pinv(columns)
    elif check["kind"] != "nested_test":
        gradient = 2 * residual / (1.0 if check["kind"] == "ss_residual" else fit.report["df"])
    else:
        full = fits.get(check, check["full"])
        rest, df = np.array(full.report["diagnostics"]["residual"]), fit.report["df"] - full.report["df"]
        noise = float(rest @ rest) / full.report["df"]
        f = float(residual @ residual - rest @ rest) / df / noise
        of_f = 2 * (residual - rest) / df / noise - 2 * f * rest / float(rest @ rest)
        gradient = {
            "ss": 2 * (residual - rest),
            "ms": 2 * (residual - rest) / df,
            "f": of_f,
            "p": stats.f.pdf(f, df, full.report["df"]) * of_f,
            "df": np.zeros(len(fit.y)),
        }[check["key"]]
    return float(np.abs(gradient) @ half)
