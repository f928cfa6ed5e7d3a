"""The catalogue's files, and an experiment's runs in coded units."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pandas as pd

from catalogue.answers import NotThereError

PLACE = "datasets/experiments/reference_catalogue"


def catalogue_folder() -> Path:
    """Where the installed process-improve keeps its reference catalogue; the package itself is not loaded."""
    found = importlib.util.find_spec("process_improve")
    if found is None or not found.submodule_search_locations:
        raise SystemExit(
            "This needs the package process-improve: pip install 'process-improve==2.2.*' into an "
            "environment of its own that also holds rsmkit (python -m venv --system-site-packages)."
        )
    return Path(next(iter(found.submodule_search_locations))) / PLACE


def entries(folder: Path):
    """Yield source and entry, experiments before designs."""
    for path in sorted(folder.glob("*.json")):
        if path.name == "topics.json":
            continue
        document = json.loads(path.read_text(encoding="utf-8"))
        for entry in [*document["experiments"], *(document.get("designs") or [])]:
            yield document["source"]["key"], entry


def table_of(entry: dict, positions=None) -> pd.DataFrame:
    """The runs as they are printed; `positions` count from 1."""
    if not entry.get("runs"):
        raise NotThereError("the entry has no runs")
    table = pd.DataFrame(entry["runs"]["rows"], columns=entry["runs"]["columns"])
    return table if positions is None else table.iloc[[p - 1 for p in positions]].reset_index(drop=True)


def coded_runs(entry: dict, check: dict) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Settings in coded units (names of categories as texts) and responses."""
    table, runs = table_of(entry, check.get("runs")), entry["runs"]
    exact = {} if check.get("settings") == "as_printed" else runs.get("exact") or {}
    settings = {}
    mixture = [f for f in entry["factors"] if f.get("coding") == "pseudocomponent"]
    room = float(runs.get("mixture_total", 1)) - sum(float(f["low"]) for f in mixture)
    for factor in entry["factors"]:
        name = factor["name"]
        if name in table:
            settings[name] = _setting(factor, table[name], runs, room, exact)
    found = pd.DataFrame(settings, index=table.index)
    summary = check.get("summary")
    if summary and summary["statistic"] == "each":
        readings = table[summary["of"]].to_numpy(float)
        rows, columns = np.nonzero(~np.isnan(readings))
        each = pd.DataFrame({"each": readings[rows, columns]})
        return found.iloc[rows].reset_index(drop=True), each
    if summary:
        return found, _summary(table, summary)
    names = [r["name"] for r in entry.get("responses") or [] if r["name"] in table]
    return found, table[names].astype(float)


def _setting(factor: dict, column: pd.Series, runs: dict, room: float, exact: dict) -> pd.Series:
    coding, levels = factor.get("coding"), factor.get("levels") or []
    categorical = factor["type"] == "categorical"
    if coding == "name" or (categorical and len(levels) > 2 and coding != "none"):
        return column.astype(str)
    if coding == "pseudocomponent":
        return (_exactly(column.astype(float), exact) - factor["low"]) / room
    if coding == "none" or runs["coded"]:
        return _exactly(column.astype(float), exact)
    if categorical:
        return column.map({factor["low"]: -1.0, factor["high"]: 1.0})
    middle, half = (factor["high"] + factor["low"]) / 2, (factor["high"] - factor["low"]) / 2
    return _exactly((column.astype(float) - middle) / half, exact)


def _exactly(column: pd.Series, exact: dict) -> pd.Series:
    """Settings that a source prints rounded, as they are."""
    for rounded, value in exact.items():
        column = column.mask(np.isclose(column.abs(), float(rounded)), np.sign(column) * float(value))
    return column


def _summary(table: pd.DataFrame, asked: dict) -> pd.DataFrame:
    """One number per run from repeated readings."""
    readings = table[asked["of"]].astype(float) * asked.get("scale", 1)
    first, kind = readings.iloc[:, 0], asked["statistic"]
    n = float(asked.get("n", 1))
    with np.errstate(divide="ignore"):
        found = {
            "mean": lambda: readings.mean(axis=1),
            "total": lambda: readings.sum(axis=1),
            "std_dev": lambda: readings.std(axis=1, ddof=1),
            "variance": lambda: readings.var(axis=1, ddof=1),
            "range": lambda: readings.max(axis=1) - readings.min(axis=1),
            "ln_std_dev": lambda: np.log(readings.std(axis=1, ddof=1)),
            "sqrt": lambda: np.sqrt(first),
            "arcsin_sqrt": lambda: np.arcsin(np.sqrt(first)),
            "freeman_tukey_sqrt": lambda: (np.sqrt(first) + np.sqrt(first + 1)) / 2,
            "freeman_tukey_arcsin": lambda: (
                (np.arcsin(np.sqrt(n * first / (n + 1))) + np.arcsin(np.sqrt((n * first + 1) / (n + 1)))) / 2
            ),
            "angular_degrees": lambda: _angles(first, n, asked.get("ends", (0.0, 90.0))),
            "sn_larger": lambda: -10 * np.log10((1 / readings**2).mean(axis=1)),
            "sn_smaller": lambda: -10 * np.log10((readings**2).mean(axis=1)),
            "sn_target": lambda: 10 * np.log10(readings.mean(axis=1) ** 2 / readings.var(axis=1, ddof=1)),
        }
        column = found[kind if kind in found else "sn_target"]()
    if asked.get("round") is not None:
        column = column.round(asked["round"])
    return column.rename(kind).to_frame()


def _angles(counts: pd.Series, n: float, ends) -> pd.Series:
    angles = pd.Series(np.degrees(np.arcsin(np.sqrt(counts / n))), index=counts.index)
    return angles.where(counts > 0, ends[0]).where(counts < n, ends[1])


TRANSFORMS = {
    "log": np.log,
    "log10": np.log10,
    "sqrt": np.sqrt,
    "inverse": lambda y: 1 / y,
    "reciprocal": lambda y: 1 / y,
    "inverse_sqrt": lambda y: 1 / np.sqrt(y),
}


def runs_to_fit(entry: dict, check: dict) -> tuple[pd.DataFrame, pd.Series]:
    """Settings and the one response of a check, transformed where it says so."""
    settings, responses = coded_runs(entry, check)
    y = responses[check.get("response") or responses.columns[0]]
    if check.get("transform"):
        y = TRANSFORMS[check["transform"]](y.astype(float))
    return settings.reset_index(drop=True), y.reset_index(drop=True)
