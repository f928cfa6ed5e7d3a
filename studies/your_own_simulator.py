# ---
# jupyter:
#   jupytext:
#     formats: py:percent,ipynb
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A simulator of your own
#
# This notebook takes a function that knows nothing of `rsmkit` and makes a study of it, with a file that
# can be run, stopped and resumed from the command line. The example is a tall tower that sways in the wind
# and gets a pendulum in its top, tuned to calm it. Two numbers are free: the pendulum's frequency relative
# to the tower's, and its damping. What should they be for the least sway at the worst frequency of the
# wind?
#
# It is chosen for two reasons. Den Hartog's textbook solves it on paper, so the answer is known. And it is
# awkward: the worst frequency jumps from one resonance to the other, so the response has a sharp valley
# that no smooth surface can follow. A good tool must notice.
#
# ## The function
#
# Factors and settings come in by name, results go out by name. Raising an exception is fine: the run is
# recorded as failed, with the reason, and the study goes on without it.

# %%
# %config InlineBackend.figure_formats = ["png"]
# %matplotlib inline
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

plt.rcParams["figure.dpi"] = 66
os.chdir(tempfile.mkdtemp())
Path("tower.py").write_text('''
import numpy as np


def sway(tuning, damping, mass_ratio):
    """Largest amplification of a steady wind load over all frequencies, and where it occurs."""
    if damping <= 0:
        raise ValueError("an undamped pendulum never settles")
    g = np.linspace(0.6, 1.3, 7001)  # wind frequency over the tower's
    friction = (2 * damping * g) ** 2
    top = friction + (g**2 - tuning**2) ** 2
    coupled = mass_ratio * tuning**2 * g**2 - (g**2 - 1) * (g**2 - tuning**2)
    bottom = friction * (g**2 - 1 + mass_ratio * g**2) ** 2 + coupled**2
    amplification = np.sqrt(top / bottom)
    worst = amplification.argmax()
    return {"amplification": float(amplification[worst]), "worst_frequency": float(g[worst])}
''')
sys.path.insert(0, ".")
from tower import sway

sway(tuning=1.0, damping=0.1, mass_ratio=0.05)

# %% [markdown]
# ## The study file
#
# Everything a study is, in one file: what to run, what to vary, what to look at, what to minimise. `rsmkit
# check` reads it and runs the simulator once, before anything is spent. (In a terminal leave out the
# exclamation mark.)

# %%
Path("study.toml").write_text("""
name = "Tower with a pendulum"

[simulator]
run = "tower:sway"

[simulator.settings]
mass_ratio = 0.05

[factors]
tuning  = { low = 0.85, high = 1.05, label = "pendulum frequency over the tower's" }
damping = { low = 0.05, high = 0.25, label = "damping ratio" }

[responses]
amplification = { label = "largest amplification" }

[design]
kind       = "ccd"
star       = "inscribed"
center     = 1
augment_to = 16

[[search]]
name     = "calmest"
minimize = "amplification"
""")


def rsmkit(*arguments):
    """What the command line answers."""
    environment = {key: value for key, value in os.environ.items() if key != "FORCE_COLOR"}
    command = [sys.executable, "-m", "rsmkit", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**environment, "COLUMNS": "100"})
    print(done.stdout)


rsmkit("check")

# %% [markdown]
# ## Run it
#
# `rsmkit run` is plan, evaluate, fit and verify in a row.

# %%
rsmkit("run")

# %% [markdown]
# The last lines are what the whole exercise is for. The surface promises a sway; the simulator, asked at
# that very point, says otherwise. Without that one run the report would have carried the promise. A picture
# shows what happened: the simulator (left) has a crease along which both resonances are equally high, with
# the best point in it; the surface (right) can only make a bowl of it, and the bowl is too deep.

# %%
from rsmkit import open_study

fitted = open_study(".").fitted()
surface, first = fitted.surfaces["amplification"], fitted.optima[0]

x, y = np.meshgrid(np.linspace(0.85, 1.05, 41), np.linspace(0.05, 0.25, 41))
grid = np.column_stack([x.ravel(), y.ravel()])
true = np.array([sway(*place, 0.05)["amplification"] for place in grid])
figure, axes = plt.subplots(1, 2, figsize=(8.5, 3.6), sharey=True, layout="constrained")
for axis, title, z in ((axes[0], "simulator", true), (axes[1], "surface", surface.predict(grid))):
    lines = axis.contour(x, y, z.reshape(x.shape), [5.5, 6, 6.5, 7, 8, 9, 10, 12, 14, 16], cmap="viridis")
    axis.clabel(lines, fmt="%g", fontsize=7)
    axis.plot(*first.point, "*", color="firebrick", markersize=12)
    axis.set(title=title, xlabel="tuning")
axes[0].plot(*fitted.runs.points.T, ".", color="grey")
axes[0].set_ylabel("damping")
plt.show()

# %% [markdown]
# ## Look closer
#
# A surface that is poor over a wide box is better over a small one. So: the same study again on a quarter
# of the area around the point found, then once more. Runs that are wanted again are taken from
# `runs.jsonl`.

# %%
import rsmkit as rk


def closer(centre, half_widths):
    low = np.maximum(centre - half_widths, [0.85, 0.05])
    high = np.minimum(centre + half_widths, [1.05, 0.25])
    space = rk.Space(tuning=(low[0], high[0]), damping=(low[1], high[1]))
    design = rk.ccd(space, star="faced", center=1)
    runs = rk.evaluate("tower:sway", design, responses=["amplification"], settings={"mass_ratio": 0.05})
    surfaces = rk.fit(runs)
    best = rk.search(surfaces, "amplification")
    proof = rk.verify(best, "tower:sway", surfaces, runs, settings={"mass_ratio": 0.05})
    print(
        f"{best.point.round(4)}  predicted {proof.objective.predicted:.3f}, run {proof.objective.actual:.3f}"
    )
    return best.point


point = first.point
for half_widths in ([0.05, 0.05], [0.025, 0.025], [0.0125, 0.0125]):
    point = closer(point, np.array(half_widths))

# %% [markdown]
# Den Hartog's answer, for a mass ratio of 0.05, has both resonances equally high; it is nearly, not
# exactly, the best.

# %%
mass_ratio = 0.05
paper = (1 / (1 + mass_ratio), np.sqrt(3 * mass_ratio / (8 * (1 + mass_ratio) ** 3)))
for label, place in (("Den Hartog", paper), ("found", point)):
    reached = sway(*place, mass_ratio)["amplification"]
    print(f"{label:12} tuning {place[0]:.4f}   damping {place[1]:.4f}   amplification {reached:.3f}")
print("runs made:", len(Path("runs.jsonl").read_text().splitlines()))

# %% [markdown]
# Three things to take home: the contract is a function; the verifying run is not a formality; and a smaller
# box is the cheapest better model.
