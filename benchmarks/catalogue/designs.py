"""Designs that rsmkit makes, and what it says of designs."""

import functools
import json
import math
from collections import Counter
from itertools import combinations

import numpy as np
import pandas as pd

import rsmkit as rk
from catalogue.answers import Answer, NotThereError, finished, reported, worked
from catalogue.formula import Model, spelled_out
from catalogue.fractions import LETTERS, generators_of, made
from catalogue.runs import coded_runs, table_of

REDUCE = {
    "max": max,
    "min": min,
    "mean": lambda v: float(np.mean(v)),
    "len": len,
    "sum": sum,
    "prod": math.prod,
}


def design_of(spec: dict):
    """The design of a specification."""
    return _design(json.dumps(spec, sort_keys=True))


@functools.cache
def _design(text: str):
    spec = json.loads(text)
    kind, k, options = spec["design_type"], spec.get("k"), dict(spec.get("options") or {})
    if options.get("n_replicates"):
        raise NotThereError("replicated designs from one call")
    if kind not in MAKERS:
        raise NotThereError(f"designs: {kind}")
    names = tuple(LETTERS[:k]) if k <= len(LETTERS) else tuple(f"X{i}" for i in range(k))
    space = rk.Space([rk.Factor(name, -1.0, 1.0) for name in names])
    center = options.get("n_center_points", 1 if kind == "dsd" else 3)
    return MAKERS[kind](space, spec, options, center)


def _factorial(space, spec, options, center):
    levels = spec.get("levels") or 2
    if isinstance(levels, list):
        levels = dict(zip(space.names, levels, strict=True))
    return _in_blocks(rk.full_factorial(space, levels=levels, center=center), options)


def _fractional(space, spec, options, center):
    generators = generators_of(options, space.names)
    if not generators:
        return _in_blocks(rk.full_factorial(space, levels=2, center=center), options)
    found, _, back = made(space.names, generators)
    own = rk.Space([rk.Factor(back[letter], -1.0, 1.0) for letter in LETTERS[: found.k]])
    design = rk.fractional_factorial(own, list(found.generators), center=center)
    columns = [own.names.index(name) for name in space.names]
    return _in_blocks(rk.Design(space, design.points[:, columns], design.kinds), options)


def _in_blocks(design, options):
    words = block_words(len(design.space), options)
    return rk.in_blocks(design, words) if words else design


def block_words(k: int, options) -> tuple[str, ...]:
    """The effects that make the blocks, given or rsmkit's choice."""
    if options.get("block_generators"):
        return tuple(options["block_generators"])
    if options.get("n_blocks") and options.get("generators"):
        raise NotThereError("a choice of blocks for a fraction")
    return rk.standard_blocks(k, options["n_blocks"]) if options.get("n_blocks", 1) > 1 else ()


def _composite(space, spec, options, center):
    alpha = options.get("alpha", "orthogonal" if options.get("n_blocks") else "rotatable")
    words: dict = {"center": center}
    if options.get("n_blocks"):
        if options["n_blocks"] != 2:
            raise NotThereError("composite designs whose cube is in blocks")
        words = {"center": center - center // 2, "center_axial": center // 2, "blocked": True}
    if alpha in ("face_centered", "faced"):
        words["star"] = "faced"
    elif alpha == "inscribed":
        words["star"] = "inscribed"
    else:
        words["alpha"] = "uncorrelated" if alpha == "orthogonal" and not options.get("n_blocks") else alpha
    if options.get("n_axial_replicates"):
        words["star_replicates"] = options["n_axial_replicates"]
    if options.get("generators"):
        words["generators"] = list(made(space.names, tuple(options["generators"]))[0].generators)
    elif options.get("cube") == "fractional":
        words["cube"] = "fraction"
        if options.get("resolution", 5) < 5 or len(space) < 5:  # no half of resolution five
            words["cube"] = "small"
    return rk.ccd(space, **words)


def _screening(space, spec, options, center):
    if not center:  # as some papers print it, without the centre run
        design = rk.definitive_screening(space, center=1)
        return design.select([i for i, kind in enumerate(design.kinds) if kind != "center"])
    if options.get("budget"):
        return rk.definitive_screening(space, runs=options["budget"])
    if spec.get("with_a_spare_factor") and len(space) % 2:
        return rk.definitive_screening(space, runs=2 * len(space) + 2 + center, center=center)
    return rk.definitive_screening(space, center=center)


MAKERS = {
    "full_factorial": _factorial,
    "fractional_factorial": _fractional,
    "ccd": _composite,
    "box_behnken": lambda space, spec, options, center: rk.box_behnken(space, center=center),
    "plackett_burman": lambda space, spec, options, center: rk.plackett_burman(space, center=center),
    "dsd": _screening,
}


def settings_of(entry: dict, check: dict) -> pd.DataFrame:
    """Runs of a design that rsmkit makes, or of the entry, in coded units."""
    if isinstance(check.get("design"), dict):
        design = design_of(check["design"])
        found = pd.DataFrame(design.coded, columns=list(design.space.names))
        found = found.iloc[:, : check.get("design_columns")]
        return _folded_over(found) if check.get("fold_over") else found
    asked = {k: check.get(k) for k in ("runs", "summary", "settings")}
    found = coded_runs(entry, asked)[0].reset_index(drop=True)
    for run, factor, value in check.get("set") or []:
        found.loc[run - 1, factor] = float(value)
    return _orthonormal(found, entry, check["jmp_coded"]) if check.get("jmp_coded") else found


def _orthonormal(settings: pd.DataFrame, entry: dict, names: list[str]) -> pd.DataFrame:
    """Categories as columns A1, A2, ... that JMP codes them in: orthogonal contrasts of mean square one."""
    levels = {f["name"]: list(map(str, f["levels"])) for f in entry["factors"] if f["name"] in names}
    columns = settings.drop(columns=names)
    for name, own in levels.items():
        count = len(own)
        contrasts = np.vstack([np.eye(count - 1), -np.ones(count - 1)])
        scaled = math.sqrt(count) * np.linalg.qr(contrasts)[0]
        rows = [own.index(str(level)) for level in settings[name]]
        columns = columns.assign(**{f"{name}{j + 1}": scaled[rows, j] for j in range(count - 1)})
    return columns


def _folded_over(runs: pd.DataFrame) -> pd.DataFrame:
    corners = runs[(runs != 0).any(axis=1)]
    center = runs[(runs == 0).all(axis=1)]
    parts = [corners.assign(fold=1.0), (-corners).assign(fold=-1.0), center.assign(fold=0.0)]
    return pd.concat(parts, ignore_index=True)


class DesignModel:
    """A design with the model that it is judged for."""

    def __init__(self, entry: dict, check: dict, text: str | None = None):
        self.settings = settings_of(entry, check)
        self.model = Model(self.settings, text or check.get("model") or "main_effects")
        kinds, blocks, ratio = ("given",) * len(self.settings), (), None
        if check.get("groups"):
            blocks, ratio = _plots(entry, check)
        self.design = rk.Design(self.model.space, self.model.points, kinds, blocks, block_ratio=ratio)
        self.names = self.model.terms.names(self.model.space)

    def __len__(self) -> int:
        return len(self.design)

    @functools.cached_property
    def quality(self):
        """All that rsmkit says of the design for the model."""
        return rk.assess(self.design, terms=self.model.terms, deterministic=False)

    @functools.cached_property
    def information(self):
        """Information matrix, in rsmkit's columns."""
        return rk.information_matrix(self.design, terms=self.model.terms)

    @functools.cached_property
    def columns(self) -> list[str]:
        """The catalogue's names of the columns."""
        return list(self.model.patsy.columns)

    def place(self, name: str) -> int:
        """Place of a column of the catalogue's among rsmkit's; refused where it is none of them."""
        row = self.model.combination(name)
        ones = np.flatnonzero(np.abs(row) > 1e-9)
        if ones.size != 1 or abs(row[ones[0]] - 1) > 1e-9:
            raise NotThereError("a column that rsmkit codes otherwise")
        return int(ones[0])

    @functools.cached_property
    def order(self) -> list[int]:
        """Places of the catalogue's columns among rsmkit's."""
        return [self.place(name) for name in self.columns]

    @functools.cached_property
    def same(self) -> bool:
        """Whether the columns are those of the catalogue, in another order at most."""
        try:
            return len(set(self.order)) == len(self.columns)
        except NotThereError:
            return False

    @functools.cached_property
    def covariance(self) -> np.ndarray:
        """Covariance of the catalogue's coefficients, for error variance one."""
        turned = self.model.turned
        return turned @ self.information.inverse @ turned.T

    @functools.cached_property
    def xtx(self) -> np.ndarray:
        """Information matrix of the catalogue's columns."""
        columns, spread = self.model.patsy.to_numpy(float), self.design.covariance
        return columns.T @ (columns if spread is None else np.linalg.solve(spread, columns))


def _plots(entry: dict, check: dict) -> tuple[tuple[int, ...], float]:
    """Numbers of the whole plots and the ratio of their variance to that of a run."""
    ratios = (check.get("options") or {}).get("random_effects") or {}
    if len(check["groups"]) != 1 or len(ratios) != 1:
        raise NotThereError("figures of designs with several kinds of random groups")
    labels = table_of(entry, check.get("runs"))[check["groups"][0]].astype(str)
    return tuple((1 + pd.factorize(labels)[0]).tolist()), float(next(iter(ratios.values())))


class DesignModels:
    """Those of one entry, by what was asked."""

    def __init__(self, entry: dict):
        self.entry, self.made = entry, {}

    def get(self, check: dict, text: str | None = None) -> DesignModel:
        """The design and model of a check."""
        words = ["design", "runs", "set", "groups", "options", "summary", "settings"]
        words += ["design_columns", "fold_over", "jmp_coded"]
        key = json.dumps([text or check.get("model"), *(check.get(w) for w in words)], sort_keys=True)
        if key not in self.made:
            try:
                self.made[key] = DesignModel(self.entry, check, text)
            except Exception as error:
                self.made[key] = error
        if isinstance(self.made[key], Exception):
            raise self.made[key]
        return self.made[key]


def design_property(check: dict) -> Answer:
    spec, asked = check["design"], check["property"]
    if asked == "resolution":
        names = tuple(LETTERS[: spec["k"]])
        options = dict(spec.get("options") or {})
        value = reported(made(names, generators_of(options, names))[0].resolution)
    else:
        design = design_of(spec)
        if asked == "n_runs":
            value = reported(len(design))
        elif asked == "n_factors":
            value = reported(len(design.space))
        elif asked == "alpha":
            value = worked(np.abs(design.coded[[k == "axial" for k in design.kinds]]).max())
        elif asked == "fraction":
            value = worked(len(design) / 2 ** len(design.space))
        else:
            raise NotThereError(f"a design's {asked}")
    if check.get("blocks"):
        value = value.changed(lambda x: x / check["blocks"])
    return finished(value, check, "squared")


def same_runs(entry: dict, check: dict, printed) -> Answer:
    """Whether a design has the printed runs, or the same but for names and signs."""
    if "array" in check:
        raise NotThereError("orthogonal arrays (Taguchi)")
    design = design_of(check["design"])
    mine = design.coded[:, : check.get("design_columns")]
    columns = check.get("columns") or [f["name"] for f in entry["factors"]]
    if entry["runs"].get("coded", True):
        stars = np.abs(design.coded[[k == "axial" for k in design.kinds]])
        alpha = float(stars.max()) if stars.size else math.nan
        words = {"α": alpha, "-α": -alpha}
        theirs = table_of(entry, check.get("runs"))[columns].map(lambda v: words.get(v, v)).to_numpy(float)
    else:
        theirs = coded_runs(entry, {"runs": check.get("runs")})[0][columns].to_numpy(float)
    digits = check.get("round", 6)
    mine, theirs = np.round(mine, digits) + 0.0, np.round(theirs, digits) + 0.0
    if check["kind"] == "same_projections":
        same = mine.shape == theirs.shape and _j_counts(mine) == _j_counts(theirs)
        return Answer("J", worked(0).how, same)
    text = str(printed).strip()
    counted = not text.isdigit() or int(text) == len(theirs)
    if check.get("relabel"):
        same = (
            counted and mine.shape == theirs.shape and np.allclose(_spread(mine), _spread(theirs), atol=1e-6)
        )
        return Answer("invariants", worked(0).how, bool(same))
    same = Counter(map(tuple, mine.tolist())) == Counter(map(tuple, theirs.tolist()))
    return Answer(f"{len(mine)} runs", reported(0).how, same and counted)


def _j_counts(runs: np.ndarray) -> list[Counter]:
    """Sums of the products of one, two, three columns, whatever their signs."""
    return [
        Counter(
            round(abs(runs[:, some].prod(axis=1).sum())) for some in combinations(range(runs.shape[1]), size)
        )
        for size in (1, 2, 3)
    ]


def _spread(runs: np.ndarray) -> np.ndarray:
    """Singular values of the second-order columns: the same whatever factors and levels are called."""
    k = runs.shape[1]
    pairs = [runs[:, i] * runs[:, j] for i in range(k) for j in range(i, k)]
    return np.linalg.svd(np.column_stack([np.ones(len(runs)), runs, *pairs]), compute_uv=False)


PAIRS = ("two_squares", "square_and_own_interaction", "square_and_other_interaction", "two_interactions")


def _pair(a, b) -> str:
    if max(a) == 2 and max(b) == 2:
        return PAIRS[0]
    if max(a) == 1 and max(b) == 1:
        return PAIRS[3]
    square, other = (a, b) if max(a) == 2 else (b, a)
    return PAIRS[1] if other[square.index(2)] else PAIRS[2]


def pair_correlations(entry: dict, check: dict) -> Answer:
    """Correlations of pairs of second-order columns, or of their estimates."""
    settings = settings_of(entry, check)
    settings = settings[check["factors"]] if check.get("factors") else settings
    text = "quadratic"
    if check.get("terms") == "squares":
        text = " + ".join([*settings, *(f"I({n} ** 2)" for n in settings)])
    model = Model(settings, spelled_out(text, settings.columns))
    design = rk.Design(model.space, model.points, ("given",) * len(settings))
    exponents = model.terms.exponents
    second = [i for i, e in enumerate(exponents) if sum(e) == 2]
    if check["kind"] == "estimate_correlations":
        matrix, places = rk.information_matrix(design, terms=model.terms).correlations, second
    else:
        matrix, names = rk.term_correlations(design, terms=model.terms)
        own = model.terms.names(model.space)
        places = [names.index(own[i]) for i in second]
    values = [
        abs(matrix[places[i], places[j]])
        for i, j in combinations(range(len(second)), 2)
        if _pair(exponents[second[i]], exponents[second[j]]) == check["pairs"]
    ]
    return (reported if check["key"] in ("max", "min") else worked)(REDUCE[check["key"]](values))


def unit_std_error(models: DesignModels, check: dict) -> Answer:
    found = models.get(check)
    errors = np.sqrt(np.diag(found.covariance))
    if "term" in check:
        place = found.columns.index(check["term"])
        plain = found.same and not check.get("jmp_coded")  # else the columns were made by hand
        answer = reported(errors[place]) if plain else worked(errors[place])
        return answer.changed(lambda x: x**2) if check.get("variance") else answer
    values = errors**2 if check.get("variance") else errors
    left = tuple(check.get("exclude", []))
    kept = [v for name, v in zip(found.columns, values, strict=True) if not name.startswith(left or ("\0",))]
    return worked(REDUCE[check.get("key", "max")](kept))


def normal_equations(models: DesignModels, check: dict) -> np.ndarray | Answer:
    """X'X, its inverse, X'y and their like; an array, or one number."""
    key, found = check["key"].split("."), models.get(check)
    if key[0] == "trend_robustness":
        raise NotThereError("trends over the order of runs")
    if key[0] == "leverage":
        point = np.array([[float(check["point"].get(n, 0.0)) for n in found.model.names]])
        surface = rk.fit_surface(
            found.model.space, found.model.points, np.arange(float(len(found))), terms=found.model.terms,
            deterministic=False,
        )  # fmt: skip
        answer = reported(surface.leverage(point)[0])
        return answer.changed(lambda x: x * len(found)) if check.get("scaled") else answer
    if key[0] == "relative_d":
        other = models.get({**check, "runs": check["versus"]})
        return worked(found.information.d_criterion / other.information.d_criterion)
    if key[0] == "model_matrix":
        return found.model.patsy.to_numpy(float)
    if key[0] == "xtx":
        return found.information.matrix[np.ix_(found.order, found.order)] if found.same else found.xtx
    if key[0] == "inverse":
        return found.covariance
    if key[0] in ("det_inverse", "trace_inverse"):
        values = found.covariance
        return worked(np.linalg.det(values) if key[0] == "det_inverse" else np.trace(values))
    y = coded_runs(models.entry, check)[1]
    y = y[check.get("response") or y.columns[0]].to_numpy(float)
    return found.model.patsy.to_numpy(float).T @ y


def run_order(entry: dict, check: dict) -> Answer:
    """A term, or a group of terms, against trends over the order of the runs."""
    settings = settings_of(entry, check)
    settings = settings[check["factors"]] if check.get("factors") else settings
    text = spelled_out(check.get("model", "quadratic"), settings.columns)
    for name in settings:
        if settings[name].nunique() < 3:  # two levels show no curvature
            text = text.replace(f" + I({name} ** 2)", "")
    model = Model(settings, text)
    design = rk.Design(model.space, model.points, ("given",) * len(settings))
    found = rk.run_order_trends(design, terms=model.terms, degree=check.get("degree", 3))
    head, *rest = check["key"].split(".")
    trends = ("linear", "quadratic", "cubic", "quartic")
    if head == "time_count_dot":
        return reported(found.time_count[found.names.index(rest[0])])
    if head == "terms":
        cosine = found.cosines[int(rest[0]), trends.index(rest[2])]
        return reported(cosine) if rest[1] == "cosine" else worked(math.degrees(math.acos(cosine)))
    group = {"main_effects": "FO", "interactions": "TWI", "quadratics": "PQ"}[rest[1]]
    values = found.of_group(group)[:, trends.index(rest[0])]
    how, _, what = rest[2].partition("_")
    values = values if what == "cosine" else np.degrees(np.arcsin(np.clip(values, 0.0, 1.0)))
    return worked(REDUCE[how](values))
