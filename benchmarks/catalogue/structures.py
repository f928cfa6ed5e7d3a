"""What a design is made of, and what a screening design finds."""

import rsmkit as rk
from catalogue.answers import Answer, NotThereError, reported, worked
from catalogue.designs import REDUCE, settings_of
from catalogue.fractions import LETTERS, generators_of, made
from catalogue.runs import table_of


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
