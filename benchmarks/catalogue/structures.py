"""What a design is made of, and what a screening design finds."""

import re

import numpy as np

import rsmkit as rk
from catalogue.answers import Answer, NotThereError, reported, worked
from catalogue.designs import REDUCE, DesignModel, settings_of
from catalogue.fits import Fits
from catalogue.fractions import LETTERS, generators_of, made
from catalogue.runs import catalogue_folder, entries, table_of


def _structure(entry: dict, check: dict):
    settings = settings_of(entry, check)
    settings = settings[check["factors"]] if check.get("factors") else settings
    blocks = ()
    if check.get("blocks"):
        labels = table_of(entry, check.get("runs"))[check["blocks"]].tolist()
        blocks = tuple(1 + sorted(set(labels)).index(x) for x in labels)
        settings = settings.drop(columns=check["blocks"], errors="ignore")
    space = rk.Space([rk.Factor(str(name), -1.0, 1.0) for name in settings])
    design = rk.Design(space, settings.to_numpy(float), ("given",) * len(settings), blocks)
    return rk.design_structure(design)


def structure(entry: dict, check: dict) -> Answer:
    """A count of a design's structure."""
    key = check["key"] if isinstance(check["key"], list) else check["key"].split(".")
    found = _structure(entry, check)
    head, *rest = map(str, key)
    if head == "level_counts":
        counts = {name: own.get(float(rest[0]), 0) for name, own in found.level_counts.items()}
        return reported(counts[rest[1]]) if rest[1] in counts else worked(REDUCE[rest[1]](counts.values()))
    if head in ("zeros", "zeros_with_center_runs"):
        kinds = {"n0ME": found.zeros, "n0IE": found.product_zeros}
        kinds |= {"main_effects": found.zeros, "interactions": found.product_zeros}
        values = set(kinds[rest[0]].values())
        more = found.center_runs if head == "zeros_with_center_runs" else 0
        if len(rest) > 1:
            return worked(REDUCE[rest[1]](values) + more)
        if len(values) > 1:
            raise NotThereError("one count of zeros where factors have different ones")
        (value,) = values
        return worked(value + more) if more else reported(value)
    if head == "block_sizes":
        return worked(REDUCE[rest[0]](found.block_sizes.values()))
    if head == "replicated":
        return worked(len(found.replicates if rest[0] == "len" else found.replicates[int(rest[0])]))
    values = {
        "foldover": lambda: found.folded_over,
        "n_center_runs": lambda: found.center_runs,
        "blocks_balanced": lambda: found.balanced_blocks,
        "n_three_level": lambda: len(found.three_level),
        "n_two_level": lambda: len(found.two_level),
        "n_distinct_runs": lambda: found.distinct,
        "n_factors": lambda: len(found.names),
        "mirror_pairs": lambda: found.mirror_pairs,
    }
    return reported(values[head]())


def measure(entry: dict, check: dict) -> Answer:
    """Projectivity."""
    if check["measure"] != "projectivity":
        raise NotThereError(f"designs: {check['measure']}")
    return reported(_structure(entry, check).projectivity)


def resolution(entry: dict, check: dict, key: str) -> Answer:
    """Strength as an orthogonal array, or one more."""
    found = _structure(entry, check)
    return reported(found.strength if key == "strength" else found.resolution)


def average_power(entry: dict, check: dict) -> Answer:
    """Average power of one of Jones and Nachtsheim's hypotheses."""
    settings = settings_of(entry, check)
    space = rk.Space([rk.Factor(str(name), -1.0, 1.0) for name in settings])
    design = rk.Design(space, settings.to_numpy(float), ("given",) * len(settings))
    row = rk.screening_power(design, signal_to_noise=2.0 * check["effect_size"])[check["hypothesis"] - 1]
    if check.get("status"):
        return Answer(row.status, reported(0).how, row.status == check["status"])
    return reported(row.average)


def of_fraction(check: dict, metric: str, steps: list) -> Answer:
    """Clear effects, words and their lengths of a regular fraction."""
    spec = check.get("design")
    if spec is None:
        raise NotThereError("clear effects of runs without generators")
    names = tuple(LETTERS[: spec["k"]])
    found = made(names, generators_of(dict(spec.get("options") or {}), names))[0]
    if metric == "defining_relation" and steps == ["len"]:
        return worked(len(found.words))
    if metric == "minimum_aberration" and steps[0] == "wordlength_pattern":
        return reported(found.word_lengths.get(int(steps[1]) + 3, 0))
    if metric == "clear_effects":
        size = {"main_effects": 1, "two_factor_interactions": 2}[steps[0]]
        return worked(sum(len(effect) == size for effect in found.clear_effects))
    raise NotThereError(f"designs: {metric.replace('_', ' ')}")


def expected_mean_squares(_, check: dict) -> Answer:
    """A coefficient, an error term, or degrees of freedom of a balanced layout."""
    rows = rk.expected_mean_squares(
        check["levels"], random=check.get("random") or [], nested=check.get("nested") or {},
        replicates=check.get("replicates", 1), restricted=check.get("restricted", True),
    )  # fmt: skip
    by_name = {("Error" if row.source == "error" else row.source): row for row in rows}
    head, *rest = check["key"].split(".")
    if head == "error_term":  # numbers of rows, as Minitab prints them
        row = by_name[rest[0]]
        return reported([r.source for r in rows].index(row.error_term) + 1)
    if head == "per_df":
        return reported(by_name[rest[0]].of_squared_effects)
    if head == "form":
        row = by_name[rest[0]]
        return reported(rest[1] in row.quadratic or (rest[1] == rest[0] and not row.random))
    return reported(by_name[head].coefficients.get("error" if rest[0] == "Error" else rest[0], 0))


def relative_efficiency(entry: dict, check: dict) -> Answer:
    """The entry's runs against another design: D-efficiency, or standard errors."""
    if "versus" in check:
        raise NotThereError("efficiency against the runs of another entry")
    words = ("design", "design_columns", "fold_over", "model")  # main effects, whatever they are called
    own = DesignModel(entry, {k: v for k, v in check.items() if k not in words})
    other = DesignModel(entry, {k: v for k, v in check.items() if k != "model"})
    if check["criterion"] == "d":
        found = worked(own.quality.d_efficiency / other.quality.d_efficiency)
    else:
        errors = [np.sqrt(np.diag(each.covariance)[1:]).mean() for each in (own, other)]
        found = worked(errors[0] / errors[1])
    if check.get("gain"):
        found = found.changed(lambda x: 100 * (x - 1))
    return found.changed(lambda x: 100 * x) if check.get("percent") else found


def marginal_means(fits, check: dict) -> Answer:
    """Taguchi's prediction: level means of single factors and of pairs, added up."""
    run = table_of(fits.entry).iloc[int(check["run"]) - 1]
    if check.get("from"):
        fits = Fits(next(e for _, e in entries(catalogue_folder()) if e["name"] == check["from"]))
    entry, names, pairs = fits.entry, check["factors"], check.get("interactions") or []
    means = {}
    for some in [*((name,) for name in names), *map(tuple, pairs)]:
        fit = fits.get({**check, "model": ":".join(f"C({name})" for name in some)})
        place = np.flatnonzero((table_of(entry)[list(some)] == run[list(some)]).all(axis=1).to_numpy())[0]
        means[some] = fit.report["diagnostics"]["fitted"][place]
    whole = float(np.mean(fit.y))
    value = whole + sum(means[(name,)] - whole for name in names)
    value += sum(means[tuple(p)] - means[(p[0],)] - means[(p[1],)] + whole for p in pairs)
    if check.get("deviation"):
        observed = check["observed"]
        seen = float(np.mean([run[c] for c in ([observed] if isinstance(observed, str) else observed)]))
        value = 100 * (seen - value) / seen if check["deviation"] == "percent" else seen - value
    return worked(value)


def by_strata(entry: dict, check: dict) -> Answer:
    """Degrees of freedom of a layout's sources; an error has those of the sources that are no terms."""
    if "levels" not in check or check["key"] != "df":
        raise NotThereError("analysis of variance by strata")
    rows = rk.expected_mean_squares({k: int(n) for k, n in check["levels"].items()})
    dfs = {frozenset(row.source.split(":")): row.df for row in rows}
    if check["term"] == "Total":
        return worked(sum(dfs.values()))
    if check["term"] != "Residual":
        return reported(dfs[frozenset(check["term"].split(":"))])
    factors = set(re.findall(r"\w+", check["model"]))
    errors = {source: df for source, df in dfs.items() if source - factors - {"error"}}
    strata = [set(part.split(":")) for part in check["strata"].split("/")]
    inside = [set().union(*strata[: i + 1]) for i in range(len(strata))]
    own = set(check["stratum"].split(":")) if check["stratum"] != "Within" else None
    smaller = [s for s in inside if own is None or s < own]
    values = [
        df for source, df in errors.items()
        if (own is None or source <= own) and not any(source <= s for s in smaller)
    ]  # fmt: skip
    return worked(sum(values))
