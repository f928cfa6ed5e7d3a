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
# # An external program
#
# Most simulators are not Python functions. They are programs that read an input file, run for a while,
# and leave a report that was written for people. This one computes the temperature along a cooling fin by
# finite volumes. It happens to be 40 lines of awk, so that it runs wherever you are; a licensed solver on
# a cluster is used the same way.
#
# The question: ten grams of aluminium, as one round pin. How long must it be, and how thick, to carry the
# most heat into the air? A long thin pin is cold at its tip and idle there; a short thick one has little
# surface.
#
# ## The program as it is
#
# It must not be changed, only called.

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
folder = Path(tempfile.mkdtemp()) / "external_command"
shutil.copytree(
    "external_command", folder, ignore=shutil.ignore_patterns("runs", "*.json", "*.csv", "*.html")
)
os.chdir(folder)
print(Path("fin.in").read_text())

# %% [markdown]
# That is its input file, with braces where a number goes that shall vary. The study file says the rest:
# the command, which file is made from which template, and where each result is found afterwards: behind a
# phrase of the report, or in a column of a table.

# %%
text = Path("study.toml").read_text()
print(text[text.index("[simulator]") : text.index("[design]")])

# %% [markdown]
# ## One run first
#
# `rsmkit check` makes one run at the centre. Most mistakes (a wrong path, a pattern that finds nothing)
# show here, before a night of computing is lost to them.


# %%
def rsmkit(*arguments):
    """What the command line answers."""
    environment = {key: value for key, value in os.environ.items() if key != "FORCE_COLOR"}
    command = [sys.executable, "-m", "rsmkit", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**environment, "COLUMNS": "100"})
    print(done.stdout if done.returncode == 0 else done.stderr)


rsmkit("check")

# %% [markdown]
# What a mistake looks like: the same study with a misspelt phrase.

# %%
_ = Path("study.toml").write_text(text.replace("heat flow", "heat flux"))
rsmkit("check")
_ = Path("study.toml").write_text(text)

# %% [markdown]
# ## All runs
#
# Every run has a folder of its own under `runs/`, with its input, everything the program wrote, and what
# it said. Several run side by side without meeting.

# %%
rsmkit("run")

# %%
run = sorted(path for path in Path("runs").iterdir() if path.is_dir())[0]
print(*sorted(path.name for path in run.iterdir()), sep="\n")
print()
print((run / "stdout.txt").read_text())

# %% [markdown]
# Nothing is lost either: the temperature profiles that the program wrote on its way are still there. They
# show what the numbers only hint at: the tip of a long thin pin has little heat left to give away.

# %%
from rsmkit import open_study

fitted = open_study(".").fitted()
figure, axis = plt.subplots(figsize=(6, 3.6), layout="constrained")
for made in fitted.runs.runs:
    profile = pd.read_csv(Path("runs") / made.key / "profile.csv", skipinitialspace=True)
    label = "{length_mm:g} x {diameter_mm:g} mm".format(**made.factors)
    axis.plot(profile["position_mm"], profile["temperature_C"], label=label)
axis.set(xlabel="distance from the wall [mm]", ylabel="temperature [C]")
axis.legend(fontsize=8, frameon=False, ncols=2)
plt.show()

# %% [markdown]
# ## What was found
#
# The mass is known exactly without any run, so the constraint on it is written as a formula of the
# factors, not as a surface. The optimum sits on it.

# %%
from rsmkit import plots

best = fitted.optima[0]
axis = plots.contours(fitted.surfaces["heat_W"], "length_mm", "diameter_mm", points=fitted.runs.points)
length = np.linspace(30, 90, 101)
axis.plot(length, np.sqrt(4715 / length), color="firebrick", linewidth=2, label="10 g")
axis.plot(*best.point, "*", color="gold", mec="black", ms=16)
axis.legend(loc="upper right")
plt.show()

# %% [markdown]
# Textbooks have the fin in closed form. With the loss through its end counted as extra length, the heat
# is sqrt(h P k A) (T - T_air) tanh(m L), m = sqrt(h P / k A); along the line of ten grams:

# %%
h, k = 50.0, 200.0


def heat(length_mm, diameter_mm):
    """Heat flow of a pin fin, W (Incropera & DeWitt, corrected length)."""
    d, corrected = diameter_mm / 1000, (length_mm + diameter_mm / 4) / 1000
    perimeter, area = np.pi * d, np.pi * d**2 / 4
    m = np.sqrt(h * perimeter / (k * area))
    return np.sqrt(h * perimeter * k * area) * 80.0 * np.tanh(m * corrected)


length = np.linspace(60, 90, 3001)
exact = heat(length, np.sqrt(4715 / length))
x, y = best.point
ideal = length[exact.argmax()]
print(f"textbook    {ideal:.1f} x {np.sqrt(4715 / ideal):.2f} mm, {exact.max():.3f} W")
print(f"nine runs   {x:.1f} x {y:.2f} mm, {heat(x, y):.3f} W by the textbook")
assert heat(x, y) > 0.998 * exact.max()

# %% [markdown]
# Nine runs of a program that nobody touched, and one to be sure. What changes with a real solver is the
# `command`, the template and the patterns; add `timeout_s` for the runs that never end, and `rsmkit
# evaluate
# --jobs 8` for the night.
