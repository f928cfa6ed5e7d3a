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
# # Laboratory data
#
# Not every simulator is a program. Here it is a stirred vessel, a stop-watch and a chemist: each run
# takes half a day, each result is a number written by hand, and the same run made twice does not give the
# same number twice. How long and how hot must the reaction be for the most product, if the product must
# also flow (viscosity between 62 and 68) and must not be too heavy (molecular weight of 3400 at most)?
#
# The data are those of Montgomery, *Design and Analysis of Experiments*, which every course on response
# surfaces uses, so that what comes out can be looked up. The study is in
# [laboratory](laboratory/study.toml): a study file without a simulator.

# %%
# %config InlineBackend.figure_formats = ["png"]
# %matplotlib inline
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

plt.rcParams["figure.dpi"] = 66
folder = Path(tempfile.mkdtemp()) / "laboratory"
shutil.copytree(
    "laboratory", folder, ignore=shutil.ignore_patterns("*.json", "*.jsonl", "design.csv", "*.html")
)
os.chdir(folder)


def rsmkit(*arguments):
    """What the command line answers."""
    environment = {key: value for key, value in os.environ.items() if key != "FORCE_COLOR"}
    command = [sys.executable, "-m", "rsmkit", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**environment, "COLUMNS": "100"})
    print(done.stdout + done.stderr)


rsmkit("plan")

# %% [markdown]
# Thirteen runs: a square, a star around it, and the centre five times. The centre is what a computer
# would never repeat, and what a laboratory must: its spread is the only honest measure of how well
# anything can be known here. The note is right, too: the star points lie outside the range that was
# named, so the chemist must be willing to run there.
#
# ## Out to the laboratory, and back
#
# A run sheet is an ordinary table: print it, or open it in a spreadsheet.

# %%
rsmkit("sheet", "sheet.csv")
pd.read_csv("sheet.csv")

# %% [markdown]
# Some weeks later the sheet comes back filled in, rows in another order, decimals as people write them.

# %%
results = pd.read_csv("results.csv")
results

# %%
rsmkit("record", "results.csv")

# %% [markdown]
# Each row is recorded once. Recording the same sheet again changes nothing, and half a sheet would do as
# well: what is empty stays to be done.

# %%
rsmkit("fit")

# %% [markdown]
# ## May these surfaces be believed?
#
# Look at *R2 pred*, each run predicted from the others. The yield is known well. The molecular weight is
# not: its value is negative, so the mean of all runs would predict a new run better than the surface
# does. Repeated centre points say whether the model is to blame or the measurement: *lack of fit*
# compares what the surface misses with how far repeats differ.

# %%
from rsmkit import open_study

fitted = open_study(".").fitted()
surfaces = fitted.surfaces
rows = {}
for name, surface in surfaces.items():
    report = surface.report()
    lack = report["lack_of_fit"]
    rows[name] = {
        "R2": report["r2"],
        "R2 predicted": report["r2_predicted"],
        "spread of repeats": np.std(fitted.runs.y(name)[results["kind"] == "center"], ddof=1),
        "sigma of the fit": report["sigma"],
        "lack of fit, p": lack["p"],
    }
pd.DataFrame(rows).T.round(3)

# %% [markdown]
# The yield's surface misses hardly more than repeats differ (0.27 against 0.23). The molecular weight
# varies by 130 between runs that should be equal: no model will predict that, only more repeats. Yield
# first, then:

# %%
from rsmkit import plots

figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
plots.parity(surfaces["yield_pct"], ax=axes[0])
plots.parity(surfaces["molecular_weight"], ax=axes[1])
plt.show()

# %% [markdown]
# ## Where the top is
#
# A second-order surface has one stationary point; canonical analysis says what it is. Two negative
# eigenvalues: a summit. The book has 0.389 and 0.306 in coded units, a yield of 80.21 and eigenvalues of
# -0.9635 and -1.4143.

# %%
from rsmkit import canonical_analysis

canonical = canonical_analysis(surfaces["yield_pct"])
space = fitted.runs.space
stationary = space.decode(canonical.stationary[None])[0]
print("stationary point, coded  ", canonical.stationary.round(3))
print("stationary point, natural", stationary.round(2))
print("yield there              ", surfaces["yield_pct"].predict(stationary[None]).round(2)[0])
print("eigenvalues              ", np.round(canonical.eigenvalues, 4))
assert np.allclose(canonical.stationary, [0.389, 0.306], atol=6e-4)
assert np.allclose(canonical.eigenvalues, [-0.9635, -1.4143], atol=6e-4)

# %% [markdown]
# But the summit is not allowed: the product would be too viscous there. The picture has the yield as
# lines, what the other two responses forbid in grey, and the constrained optimum as a star.

# %%
x, y = np.meshgrid(np.linspace(80, 90, 81), np.linspace(170, 180, 81))
grid = np.column_stack([x.ravel(), y.ravel()])
viscosity, weight = (
    surfaces[name].predict(grid).reshape(x.shape) for name in ("viscosity_cSt", "molecular_weight")
)
allowed = (viscosity >= 62) & (viscosity <= 68) & (weight <= 3400)
best = fitted.optima[0]

axis = plots.contours(surfaces["yield_pct"], "time_min", "temperature_F", points=fitted.runs.points)
axis.contourf(x, y, allowed, levels=[-0.5, 0.5], colors=["grey"], alpha=0.75)
axis.plot(*best.point, "*", color="gold", markeredgecolor="black", markersize=16)
axis.plot(*stationary, "^", color="white", markeredgecolor="black", markersize=9)
plt.show()
print(
    {name: round(value, 2) for name, value in best.factors.items()},
    "yield",
    round(-best.best.objectives[0], 2),
)

# %% [markdown]
# ## The runs that settle it
#
# The sheet now has one more row, the optimum. It is the row worth the half day.

# %%
Path("sheet.csv").unlink()
rsmkit("sheet", "sheet.csv")
pd.read_csv("sheet.csv").tail(2)

# %% [markdown]
# What should the chemist expect? The prediction, give or take what one run varies:

# %%
for name, surface in surfaces.items():
    mean, low, high = (float(v[0]) for v in surface.predict(best.point[None], interval=0.95))
    print(f"{name:18} {mean:8.1f}   {low:8.1f} .. {high:8.1f}")

# %% [markdown]
# The yield is promised within about a percent. The viscosity may leave its limits by bad luck alone, and
# of the molecular weight nothing is promised at all. That is not a flaw of the method but what thirteen
# runs and this instrument are worth; the page `explorer.html`, written by `rsmkit fit`, shows the same
# with bands that can be dragged through.
