"""What is said of a surface does not contradict the verdict on it."""

import pytest

from rsmkit.report.explorer.verdict import quality_words
from rsmkit.verification.verification import Comparison, Confirmation, SimulatorRuns, Verification


def verification(verdict, objective, **responses):
    point = Confirmation(
        name="best",
        point="optimum",
        factors={"x": 1.0},
        objectives={"2 * drag": objective},
        responses=responses,
        constraints=(),
        extremes=(),
        verdict=verdict,
        sentence="",
        best_design=None,
        simulator_runs=SimulatorRuns(9, 1),
    )
    return Verification((point,), SimulatorRuns(9, 1))


WIDE = Comparison(1.0, 1.4, 0.0, 9.0, spread=1.0)  # 0.4 of 1.4 is 28.6 %, inside a wide interval
NARROW = Comparison(1.0, 1.01, 0.999, 1.001, spread=1.0)  # 0.99 % off, outside a narrow interval
RIGHT = Comparison(1.0, 1.0, 0.9, 1.1, spread=1.0)


@pytest.mark.parametrize(
    ("verdict", "objective", "tolerance", "added"),
    [
        ("IMPROVED, MODEL POOR", WIDE, 2.0, " over the runs, but not at the optimum (28.6 % off there)"),
        ("NOT CONFIRMED", WIDE, 2.0, " over the runs, but not at the optimum (28.6 % off there)"),
        ("NOT CONFIRMED", WIDE, 30.0, ""),
        ("IMPROVED, MODEL POOR", NARROW, 2.0, ""),  # as near as was asked for
        ("IMPROVED, MODEL POOR", NARROW, 0.5, " over the runs, but not at the optimum (0.99 % off there)"),
        ("CONFIRMED", WIDE, 2.0, ""),  # within the noise
        ("NOT CONFIRMED", RIGHT, 2.0, ""),  # a constraint is violated, the surface is right
    ],
)
def test_a_poor_model_is_not_called_excellent(verdict, objective, tolerance, added):
    found = verification(verdict, objective, drag=RIGHT, d=RIGHT)
    assert quality_words(0.995, "drag", found, tolerance) == f"excellent{added}"
    assert quality_words(0.995, "d", found, tolerance) == "excellent"  # no part of the objective's name
    assert quality_words(0.6, "drag", found, tolerance) == f"rough{added}"
