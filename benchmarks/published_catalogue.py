"""The published experiments of process-improve's reference catalogue, asked of rsmkit.

    python -m venv --system-site-packages ask && ask/bin/pip install "process-improve==2.2.*"
    ask/bin/python benchmarks/published_catalogue.py [--source KEY] [--only ENTRY] [--part 1/4] [--out FOLDER]

The package process-improve (2.2) ships some 1,460 published experiments and designs with the numbers that
their sources print, and for most a description of how to recompute each. Its NOTICE says what they are for:
facts against which software can be checked. Nothing of it is copied here; this script reads the files where
the package is installed, puts every question to rsmkit's public functions, and counts the answers:

as reported     a number of a report or of a public function agrees with the printed digits
by arithmetic   one line of arithmetic on such numbers agrees
differs         the catalogue itself says why the printed number does not follow from the data
unexplained     to be looked at; also listed, one by one
refused         rsmkit says in words why there is no such number (terms that cannot be told apart, ...)
cannot          rsmkit has nothing that would answer
crash           anything but an error in words

A number agrees if it lies within half a unit of the last printed digit. Sums of raw readings, tables of
distributions and numbers without a recipe are not asked. `--out` gets `numbers.csv`, one row per number;
`--part 2/4` takes every fourth entry, and several parts may write to one folder.
"""

import argparse
import csv
import signal
import sys
import time
import warnings
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from catalogue import (
    best_settings,
    designs,
    fits,
    fractions,
    means,
    metrics,
    points,
    structures,
    subsets,
    three_levels,
)
from catalogue.answers import Answer, NothingToAskError, NotThereError, agrees, finished, reported
from catalogue.runs import catalogue_folder, entries

from rsmkit.errors import RsmkitError

SECONDS = 60.0
"""Longest processor time for all questions of one entry."""
RAW = {
    "mean", "sum", "median", "minimum", "maximum",
    "range", "std_dev", "variance", "observation", "n_runs",
    "difference_of_means", "dot_product", "run_count", "distinct_runs", "fraction_runs",
    "generator_holds", "product_column", "standard_order", "run_radius", "cross_products",
    "column_correlation", "fold_over_pairs", "limit_through", "blocks_orthogonal", "projection",
    "mod3_sum",
}  # fmt: skip
FRACTIONS = {
    "aliases", "clear", "resolution", "defining_relation", "word_lengths",
    "generator", "minimum_aberration", "block_effects",
}  # fmt: skip
OF_FITS = {
    "prediction": points.prediction,
    "best_corner": points.best_corner,
    "target_setting": points.target_setting,
    "optimum": points.optimum,
    "steepest_path": points.steepest,
    "box_cox": points.box_cox,
    "desirability": points.desirability,
    "transmitted_variance": points.transmitted,
    "nested_test": fits.nested,
    **{f"extra_{key}": fits.extra(key) for key in ("ss", "ms", "f", "p")},
    "contrast": means.contrast,
    "tukey": means.tukey,
    "least_squares_means": means.least_squares_means,
    "curvature": means.curvature,
    "curvature_difference": means.curvature,
    **{f"lenth_{key}": means.lenth for key in ("t", "p", "pse", "me", "sme", "s0")},
    "normal_plot": means.lenth,
    "active_effects": means.lenth,
    "split_plot": means.split_plot,
    "variance_component": means.variance_component,
    "mean_squares": means.mean_squares,
    "nonadditivity": means.nonadditivity,
    "glm": means.glm,
    "t_test": means.two_samples,
    "classical_test": means.one_sample,
    "desirability_optimum": best_settings.desirability_optimum,
    "marginal_means": structures.marginal_means,
}
OF_STRUCTURES = {
    "design_structure": structures.structure,
    "design_measure": structures.measure,
    "average_power": structures.average_power,
    "expected_mean_squares": structures.expected_mean_squares,
    "multistratum": structures.by_strata,
    "relative_efficiency": structures.relative_efficiency,
}
MISSING = {
    "connecting_letters": "connecting letters",
    "log_variance_ratio": "dispersion of repeated readings",
    "capability": "capability from readings",
}


COLUMNS = ("source", "entry", "number", "kind", "term", "printed", "status", "found", "reason")


class Late(BaseException):
    """The entry takes too long."""


class Entry:
    """One entry with its fits and designs, kept while its questions last."""

    def __init__(self, entry: dict):
        self.entry, self.fits, self.designs = entry, fits.Fits(entry), designs.DesignModels(entry)

    def answer(self, check: dict, printed) -> Answer:
        """Put a question to rsmkit."""
        kind = check["kind"]
        if kind in RAW:
            raise NothingToAskError
        if kind == "component_ss":
            return three_levels.sums(self.fits, check)
        if kind in three_levels.KINDS:
            return three_levels.KINDS[kind](self.entry, check, printed)
        if kind in MISSING or kind.startswith("component_"):
            raise NotThereError(MISSING.get(kind, "3^k components of interactions"))
        if kind in FRACTIONS:
            return fractions.answer(self.entry, check, str(printed))
        if kind in fits.KINDS:
            found = fits.KINDS[kind](self.fits.get(check), check)
            return self._transformed_back(found, check)
        if kind in OF_FITS:
            found = OF_FITS[kind](self.fits, check)
            if kind in ("glm", "optimum") or found.verdict is not None:
                return found
            return self._transformed_back(found, check)
        return self._of_designs(kind, check, printed)

    @staticmethod
    def _transformed_back(found: Answer, check: dict) -> Answer:
        found = finished(found, check, "squared complement exp exp10 log10")
        if check.get("back_transform") == "freeman_tukey_sqrt":
            found = found.changed(lambda x: (x - 1 / (4 * x)) ** 2)
        return found

    def _of_designs(self, kind: str, check: dict, printed) -> Answer:
        if kind in ("design_metric", "normal_equations") and isinstance(printed, list):
            return self._array(check, printed)
        if kind in OF_STRUCTURES:
            return OF_STRUCTURES[kind](self.entry, check)
        if kind == "run_order_trends":
            return designs.run_order(self.entry, check)
        if kind in ("projections", "estimable_projections"):
            return subsets.projections(self.entry, check)
        if kind == "interaction_columns":
            return subsets.interaction_columns(self.entry, check)
        if kind == "generalized_interactions":
            return fractions.of_blocks(check, printed)
        if kind == "block_confounding":
            return self._blocks(check, printed)
        if kind == "design_metric":
            return metrics.answer(self.designs, check)
        if kind == "normal_equations":
            found = designs.normal_equations(self.designs, check)
            if isinstance(found, Answer):
                return found
            return reported(found[tuple(int(i) for i in check["key"].split(".")[1:])])
        if kind == "design_property":
            return designs.design_property(check)
        if kind in ("same_runs", "same_projections"):
            return designs.same_runs(self.entry, check, printed)
        if kind == "unit_std_error":
            return designs.unit_std_error(self.designs, check)
        if kind in ("term_correlations", "estimate_correlations"):
            return designs.pair_correlations(self.entry, check)
        if kind == "library_value":
            return points.library_value(check)
        if kind == "library_text":
            return points.library_text(check, str(printed))
        raise NotThereError(f"questions of kind {kind}")

    def _blocks(self, check: dict, printed) -> Answer:
        spec = check["design"]
        design, options = designs.design_of(spec), spec.get("options") or {}
        words, names = designs.block_words(len(design.space), options), design.space.names
        relation = ()
        if options.get("generators"):
            relation = fractions.made(names, tuple(options["generators"]))[0].words
        if relation and words:
            return fractions.confounded_with_blocks(relation, {"of": ", ".join(words)}, printed)
        return fractions.of_blocks(check, printed, words, relation)

    def _array(self, check: dict, printed: list) -> Answer:
        """All numbers of a printed matrix at once."""
        wanted = np.asarray(printed, dtype=object)
        if check["kind"] == "normal_equations":
            found = np.asarray(designs.normal_equations(self.designs, check))
            found = found[check["rows"]] if "rows" in check else found
            found = found.mean(axis=0) if check.get("average") else found
            found = found[..., check["columns"]] if "columns" in check else found
            found = np.diag(found) if check.get("diagonal") else found
            found = np.abs(found) if check.get("abs") else found
        else:
            plain = {k: v for k, v in check.items() if k not in ("printed", "decimals", "expression")}
            keys = [[*str(check["key"]).split("."), *map(str, at)] for at in np.ndindex(wanted.shape)]
            cells = [metrics.answer(self.designs, {**plain, "key": key}).value for key in keys]
            found = np.array(cells).reshape(wanted.shape)
        rule = {"expression": check.get("expression"), "decimals": check.get("decimals")}
        same = found.shape == wanted.shape and all(
            agrees(float(a), str(b), rule) for a, b in zip(found.ravel(), wanted.ravel(), strict=True)
        )
        return Answer(f"{wanted.size} numbers", reported(0).how, same)

    def judged(self, check: dict, printed) -> tuple[str, str, str]:
        """Status, what was found, and why it is what it is."""
        try:
            found = self.answer(check, printed)
            right = found.verdict if found.verdict is not None else self._agree(found.value, check, printed)
            if not right and '"dsd"' in str(check.get("design")).replace("'", '"'):
                found, right = self._with_a_spare_factor(check, printed, found)
        except NothingToAskError:
            return "not asked", "", ""
        except NotThereError as gap:
            return "cannot", "", str(gap)
        except RsmkitError as refusal:
            return "refused", "", str(refusal)[:200]
        except Exception as crash:
            return "crash", "", f"{type(crash).__name__}: {crash}"[:200]
        shown = found.value if isinstance(found.value, str) else f"{found.value:.8g}"
        if right:
            return found.how, shown, ""
        known = check.get("disagreement")
        return ("differs" if known else "unexplained"), shown, check.get("cause") or ""

    def _agree(self, value: float, check: dict, printed) -> bool:
        turned = isinstance(check.get("key"), str) and "eigenvectors" in check["key"] and not check.get("abs")
        for one in [value, -value] if turned and not check.get("sign_of") else [value]:
            if check.get("data_rounding"):
                target = float(str(printed).replace("\N{MINUS SIGN}", "-").replace(",", "").strip("<>= "))
                if abs(one - target) <= fits.carried(self.fits, check):
                    return True
            if agrees(one, printed, check):
                return True
        return False

    def _with_a_spare_factor(self, check: dict, printed, before: Answer) -> tuple[Answer, bool]:
        """Some sources make the screening design of an odd number of factors from the next even one."""
        spec = {**check["design"], "with_a_spare_factor": True}
        try:
            found = self.answer({**check, "design": spec}, printed)
        except (NotThereError, RsmkitError):
            return before, False
        right = found.verdict if found.verdict is not None else self._agree(found.value, check, printed)
        return (found, True) if right else (before, False)


def rows_of(source: str, entry: dict) -> list[dict]:
    """Every printed number of an entry, judged."""
    asked, rows, late = Entry(entry), [], False
    signal.setitimer(signal.ITIMER_VIRTUAL, SECONDS)
    for number, expected in enumerate(entry["expected"]):
        checks = expected.get("check") or {}
        for check in checks if isinstance(checks, list) else [checks]:
            printed = check.get("printed", expected["value"])
            about = str(check.get("term") or check.get("key") or check.get("metric") or "")[:60]
            values = (source, entry["name"], number, check.get("kind", ""), about, str(printed)[:60])
            row = dict(zip(COLUMNS, (*values, "not asked", "", ""), strict=True))
            if row["kind"]:
                try:
                    if late:
                        raise Late
                    row["status"], row["found"], row["reason"] = asked.judged(check, printed)
                except Late:
                    late = True
                    row["status"], row["reason"] = "crash", f"more than {SECONDS} s"
            rows.append(row)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    return rows


ORDER = ("as reported", "by arithmetic", "differs", "unexplained", "refused", "cannot", "crash")


def table(rows: list[dict], by: str) -> str:
    """Counts of every status by a column of the rows."""
    counts: dict[str, Counter] = defaultdict(Counter)
    for row in rows:
        if row["status"] != "not asked":
            counts[row[by]][row["status"]] += 1
            counts["all"][row["status"]] += 1
    lines = [f"{by:32s} {'asked':>7s} " + " ".join(f"{word:>13s}" for word in ORDER)]
    for key in sorted(counts, key=lambda k: (k == "all", k)):
        found = counts[key]
        lines.append(
            f"{key:32s} {sum(found.values()):7d} " + " ".join(f"{found[word]:13d}" for word in ORDER)
        )
    return "\n".join(lines)


def summary(rows: list[dict]) -> str:
    """Tables by kind and source, what cannot be produced, and everything that needs a look."""
    asked = [row for row in rows if row["status"] != "not asked"]
    agree = sum(row["status"] in ORDER[:2] for row in asked)
    plain = sum(row["status"] == ORDER[0] for row in asked)
    gaps = Counter(row["reason"] for row in asked if row["status"] == "cannot")
    odd = [row for row in asked if row["status"] in ("unexplained", "crash", "refused")]
    parts = [
        table(rows, "kind"),
        table(rows, "source"),
        f"agree {_share(agree, asked)}, as reported {_share(plain, asked)} of {len(asked)}",
        "cannot be produced:\n" + "\n".join(f"{n:6d}  {reason}" for reason, n in gaps.most_common()),
        "to be looked at:\n"
        + "\n".join(
            f"{r['status']:11s} {r['entry']} {r['kind']} {r['term']}: printed {r['printed']}, "
            f"found {r['found']} {r['reason']}"
            for r in odd
        ),
    ]
    return "\n\n".join(parts)


def _share(count: int, asked: list) -> str:
    return f"{100 * count / max(1, len(asked)):.1f} %"


def main() -> None:
    """Ask, count, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--source")
    parser.add_argument("--only", help="name of one entry")
    parser.add_argument("--part", default="1/1", help="2/4: the second quarter of the entries")
    parser.add_argument("--out", type=Path, help="folder for numbers.csv, added to by several parts")
    parser.add_argument("--count", action="store_true", help="count what is in the folder, ask nothing")
    options = parser.parse_args()
    place = options.out / "numbers.csv" if options.out else None
    if options.count:
        with open(place, newline="", encoding="utf-8") as lines:
            print(summary(list(csv.DictReader(lines))))
        return
    warnings.simplefilter("ignore")
    np.seterr(all="ignore")
    signal.signal(signal.SIGVTALRM, _late)
    part, parts = map(int, options.part.split("/"))
    rows, start = [], time.process_time()
    for index, (source, entry) in enumerate(entries(catalogue_folder())):
        wanted = options.source in (None, source) and options.only in (None, entry["name"])
        if wanted and index % parts == part - 1:
            rows += rows_of(source, entry)
    print(summary(rows))
    print(f"\n{time.process_time() - start:.0f} s of processor time")
    if place:
        options.out.mkdir(parents=True, exist_ok=True)
        new = not place.exists()
        with open(place, "a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0])
            if new:
                writer.writeheader()
            writer.writerows(rows)


def _late(*_):
    raise Late


if __name__ == "__main__":
    main()
