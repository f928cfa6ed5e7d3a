"""Flights that no surface has seen: 4,096 of them, kept in ``flights/fresh.csv``.

    python studies/reentry/holdout_flights.py    # flies what is missing, a tenth of a second each

The points are a Sobol sequence over the box, so only the responses are kept, one row per point. Delete the
table after a change of the simulator or of ``study.toml``.
"""

from __future__ import annotations

import fly
import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.stats import qmc

from rsmkit import Study, load_study
from rsmkit.io.files.atomic_files import write_text
from rsmkit.language.space import Floats
from sim import evaluate

TABLE = fly.TABLES / "fresh.csv"
COUNT = 4096
SAVED_EVERY = 128
DIGITS = 8


def main() -> None:
    study = load_study(fly.STUDY)
    points = fresh_points(study)
    kept = load_responses() if TABLE.exists() else pd.DataFrame(columns=fly.RESPONSES, dtype=float)
    while len(kept) < COUNT:
        flown = fly_points(study, points[len(kept) : len(kept) + SAVED_EVERY])
        kept = pd.concat([kept, flown], ignore_index=True)
        write_text(TABLE, kept.to_csv(index=False, float_format=f"%.{DIGITS}g", lineterminator="\n"))


def fresh_points(study: Study) -> Floats:
    """Points all over the box, natural units, shape (4096, 3)."""
    return study.space.decode(2.0 * qmc.Sobol(len(study.space), seed=7).random(COUNT) - 1.0)


def load_responses() -> pd.DataFrame:
    """F1, F2, F3 at :func:`fresh_points`."""
    return pd.read_csv(TABLE)


def fly_points(study: Study, points: Floats, jobs: int = -1) -> pd.DataFrame:
    """F1, F2, F3 flown now, by default on every core."""
    settings = study.file.simulator.settings if study.file.simulator else {}
    flown = Parallel(n_jobs=jobs)(
        delayed(evaluate)(**study.space.values(point), **settings) for point in points
    )
    rows = np.array([[responses[name] for name in fly.RESPONSES] for responses in flown])
    return pd.DataFrame(rows, columns=fly.RESPONSES)


if __name__ == "__main__":
    main()
