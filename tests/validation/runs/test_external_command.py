"""The example with an external program, against the closed form of its problem."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from rsmkit.runs.evaluation import evaluate_points
from rsmkit.runs.how_to_run import HowToRun
from rsmkit.runs.one_run.simulator import Simulator
from rsmkit.runs.record.journal import Journal
from rsmkit.study.file import load_study

STUDY = Path(__file__).parents[3] / "studies" / "external_command"


def fin_heat_W(length_m, diameter_m, k, h, excess_K):
    """Pin fin of uniform section with convection from its tip: Incropera and DeWitt, table 3.4, case A."""
    area, perimeter = math.pi * diameter_m**2 / 4, math.pi * diameter_m
    m = math.sqrt(h * perimeter / (k * area))
    s, c, ratio = math.sinh(m * length_m), math.cosh(m * length_m), h / (m * k)
    return math.sqrt(h * perimeter * k * area) * excess_K * (s + ratio * c) / (c + ratio * s)


def test_the_program_solves_the_fin(tmp_path):
    for file in ("study.toml", "fin.awk", "fin.in"):
        shutil.copy(STUDY / file, tmp_path)
    study = load_study(tmp_path)
    points = np.array([[30.0, 4.0], [90.0, 10.0], [55.0, 7.3]])
    runs = evaluate_points(
        Simulator(study.file.simulator, study.folder),
        points,
        study.space,
        Journal(tmp_path / "runs.jsonl"),
        HowToRun(1),
        responses=study.responses,
    )
    assert runs.done.all(), [run.error for run in runs.runs]
    for (length_mm, diameter_mm), run in zip(points, runs.runs, strict=True):
        heat = fin_heat_W(length_mm / 1000, diameter_mm / 1000, 200.0, 50.0, 80.0)
        # 200 cells: the discretisation error is of second order, (m dx)^2 / 24 < 1e-5
        assert run.responses["heat_W"] == pytest.approx(heat, rel=1e-5)
        mass = 2700.0 * math.pi / 4 * diameter_mm**2 * length_mm * 1e-6
        assert run.responses["mass_g"] == pytest.approx(mass, rel=1e-9)
        assert 20.0 < run.responses["tip_C"] < 100.0
