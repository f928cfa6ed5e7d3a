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
# # Ten minutes in the laboratory
#
# From an empty folder to a document that can be handed in, for experiments made by hand. Everything that is
# typed is here: one small file, and one command a step. What takes days, the experiments themselves, is
# played by the line of Python that fills in the run sheet.
#
# **Minute 0: an empty folder, and what is asked.** A resin is cured in an oven. How hot, and for how long,
# for the strongest bond that is not brittle?

# %%
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import rsmkit as rk

folder = Path(tempfile.mkdtemp()) / "curing"
folder.mkdir()
os.chdir(folder)

Path("study.toml").write_text("""
name = "Curing of a resin"

[factors]
oven_C   = { low = 120.0, high = 160.0, label = "oven temperature", unit = "C" }
time_min = { low = 20.0, high = 60.0, label = "time in the oven", unit = "min" }

[responses]
strength_MPa = { label = "bond strength", unit = "MPa" }
bending_pct  = { label = "bending at break", unit = "%" }

[design]
kind   = "ccd"
star   = "inscribed"
center = 4

[[search]]
name       = "strongest"
minimize   = "-strength_MPa"
subject_to = ["bending_pct >= 6"]
""")


def read(name):
    """The rows of a table."""
    with open(name, newline="") as file:
        return list(csv.DictReader(file))


def write(name, rows):
    """The same, written back."""
    with open(name, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)


def rsmkit(*arguments):
    """What the command line answers: typed in a terminal, this is `rsmkit ...`."""
    environment = {key: value for key, value in os.environ.items() if key != "FORCE_COLOR"}
    command = [sys.executable, "-m", "rsmkit", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**environment, "COLUMNS": "100"})
    print(done.stdout + done.stderr)


# %% [markdown]
# **Minute 2: the design and the run sheet**, in random order.

# %%
rsmkit("plan")
rsmkit("sheet", "sheet.csv")

# %% [markdown]
# **Then the days of work.** The sheet comes back filled in. One bond slipped out of the clamp: its row is
# excluded, with the reason. One oven ran five degrees too hot: what it really was stands beside the plan.

# %%
rows = read("sheet.csv")
for i, row in enumerate(rows):
    if i == 5:
        row["oven_C actual"] = str(float(row["oven_C"]) + 5.0)
    oven, time = (float(row["oven_C actual"] or row["oven_C"]) - 140) / 20, (float(row["time_min"]) - 40) / 20
    scatter = 0.15 * ((7 * i) % 5 - 2)
    strength = 24 + 3 * oven + 2 * time - 2.5 * oven**2 - 1.5 * time**2 - oven * time + scatter
    row["strength_MPa"] = f"{strength:.2f}"
    row["bending_pct"] = f"{8 - 1.6 * oven - 1.2 * time + 0.5 * scatter:.2f}"
    if i == 8:
        row["strength_MPa"], row["excluded"] = "", "slipped out of the clamp"
write("sheet.csv", rows)

# %% [markdown]
# **Minute 4: back on the record**, and what follows from it.

# %%
rsmkit("record", "sheet.csv")
rsmkit("fit", "-q")

# %% [markdown]
# **Minute 6: try the promise.** The predicted optimum is a run like any other: it gets its sheet, is made,
# recorded, and judged.

# %%
rsmkit("sheet", "optimum.csv")
rows = read("optimum.csv")
made = [row for row in rows if row["kind"] == "optimum"]
for row in made:
    oven, time = (float(row["oven_C"]) - 140) / 20, (float(row["time_min"]) - 40) / 20
    row["strength_MPa"] = f"{24 + 3 * oven + 2 * time - 2.5 * oven**2 - 1.5 * time**2 - oven * time:.2f}"
    row["bending_pct"] = f"{8 - 1.6 * oven - 1.2 * time:.2f}"
write("optimum.csv", rows)
rsmkit("record", "optimum.csv")
rsmkit("verify")

# %% [markdown]
# **Minute 8: the document.** Summary first, then question, runs (the excluded one in grey, with its reason),
# surfaces, verdict, and the hashes of all files it rests on; also as `--pdf`, `--docx`, `--xlsx`.

# %%
rsmkit("report")
sorted(path.name for path in folder.iterdir())

# %% [markdown]
# **Minute 10**: whoever asks further gets the page: `rsmkit explore` opens it in a browser, and in a
# notebook `rk.open_study(".").explore()` shows it below the cell. What the study holds:

# %%
rk.open_study(".")
