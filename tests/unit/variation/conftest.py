"""Surfaces and studies that several tests use."""

import numpy as np
import pytest

import rsmkit as rk


@pytest.fixture(scope="session")
def quadratic():
    """y = 3 + 2a - b + ab + a^2 in three factors, without error, and z = b."""
    space = rk.Space(a=(-10.0, 10.0), b=(-10.0, 10.0), c=(0.0, 1.0))
    points = 20.0 * np.random.default_rng(1).random((20, 3)) - 10.0
    points[:, 2] = (points[:, 2] + 10.0) / 20.0
    a, b, _ = points.T
    y = rk.fit_surface(space, points, 3.0 + 2.0 * a - b + a * b + a * a, response="y", order=2)
    return {"y": y, "z": rk.fit_surface(space, points, b, response="z", order=1)}
