"""Settings of all tests."""

import os

import pytest
from hypothesis import HealthCheck, settings

# How long an example takes is the machine's affair: nothing in the tests depends on time.
settings.register_profile("home", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("home")
# Continuous integration draws the same examples every time; at home each run draws new ones.
settings.register_profile("ci", settings.get_profile("home"), derandomize=True, print_blob=True)
if os.environ.get("CI"):
    settings.load_profile("ci")


@pytest.hookimpl(wrapper=True, optionalhook=True)
def pytest_xdist_auto_num_workers():
    """One process more than cores: tests that wait for others leave their core idle."""
    return (yield) + 1
