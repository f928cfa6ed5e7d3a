"""A fit goes on with the runs that succeeded, and says what the failed ones cost."""

import pytest


@pytest.mark.slow
def test_a_fit_says_what_failed_runs_cost(rsmkit, study):
    planned = rsmkit.json("plan", "study")["quality"]
    rows = (study / "design.csv").read_text().splitlines()[1:]
    thinnest = min(float(row.split(",")[2]) for row in rows)
    simulator = study / "simulator.py"
    trouble = f"    if width_mm <= {thinnest!r}:\n        raise ValueError('buckled')\n    width, height ="
    simulator.write_text(simulator.read_text().replace("    width, height =", trouble))
    failed = rsmkit.json("evaluate", "study", expect=3)["failed"]
    document = rsmkit.json("fit", "study")
    (warning,) = [line for line in document["warnings"] if "failed" in line]
    assert warning.startswith(
        f"{failed} of {planned['distinct']} runs failed and are left out (the simulator fails "
    )
    assert "where width_mm < 3" in warning
    assert "): D-efficiency " in warning
    assert warning.split("instead of ")[1].startswith(f"{planned['d_efficiency']:.1f} %")
    assert rsmkit.json("fit", "study")["warnings"] == document["warnings"]
