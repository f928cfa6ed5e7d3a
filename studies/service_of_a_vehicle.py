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
# # Will it hold in service?
#
# The shield of a re-entry vehicle stands a peak heat flux of 5.3 MW/m2. The drawing meets it. But the entry
# is a little steep or a little shallow, the vehicle a little heavy, the nose ground a little blunt, and no
# day has the air of the table. Three questions: how often is the limit exceeded, what causes it, and which
# tolerance is worth its money? Forty flights answer them, and a hundred more prove the answer.

# %%
# %config InlineBackend.figure_formats = ["png"]
# %matplotlib inline
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import rsmkit as rk
from sim import evaluate

plt.rcParams["figure.dpi"] = 66
SETTINGS = {
    "speed_m_s": 4300.0, "altitude_m": 82000.0, "nu_deg": 15.0, "alpha_deg": 30.0, "preset": "paper",
    "blend": [4.5, 5.5], "cg_fraction": 0.55, "length_1_m": 1.6, "length_2_m": 0.4, "length_3_m": 0.7,
    "theta_c1_deg": 7.0, "theta_c2_deg": 12.0,
}  # fmt: skip
space = rk.Space(theta_deg=(-18, -12), mass_kg=(900, 1100), nose_radius_m=(0.18, 0.26))
drawing = {"theta_deg": -15.0, "mass_kg": 1000.0, "nose_radius_m": 0.22}

# %% [markdown]
# Every flight draws an atmosphere of its own (the simulator's dispersions, by a seed): density is not a
# factor but a noise, as it is in service. What is flown is kept in `service_of_a_vehicle.csv`; delete it,
# and the flights are made again, in about a minute.

# %%
kept = Path("service_of_a_vehicle.csv")
known = {} if not kept.exists() else {tuple(row[:-1]): row[-1] for row in pd.read_csv(kept).to_numpy()}
flown_before = len(known)


def flux(points):
    """Peak heat flux at the stagnation point [MW/m2] of each flight, shape (n,)."""
    found = []
    for point in np.round(points, 9):
        key = tuple(point)
        if key not in known:
            seed = int(abs(point @ [1e5, 1e3, 1e7])) % 2**31  # an atmosphere that belongs to the flight
            flown = evaluate(**space.values(point), **SETTINGS, seed=seed)
            known[key] = flown["peak_heat_flux_W_m2"] / 1e6
        found.append(known[key])
    return np.array(found)


design = rk.latin_hypercube(space, 40)
observed = flux(design.points)
surface = rk.fit_surface(space, design.points, observed, response="flux", order=2)
print(f"{len(observed)} flights, {observed.min():.2f} to {observed.max():.2f} MW/m2")
print(f"R2 {surface.report()['r2']:.3f}; what the air does: {surface.fit.sigma:.3f} MW/m2")

# %% [markdown]
# ## The laws
#
# The entry angle has a standard deviation of 0.4 degrees, the mass one of 10 kg, and the nose radius may
# lie within 8 mm of the drawing. Runs repeat with noise, so `deterministic` is false: the air is part of
# what the heat flux does in service.

# %%
laws = {
    "theta_deg": {"law": "normal", "sd": 0.4},
    "mass_kg": {"law": "normal", "sd": 10.0},
    "nose_radius_m": {"law": "uniform", "half_width": 0.008},
}
limits = {"flux": {"high": 5.3}}
asked = {
    "at": drawing,
    "specifications": limits,
    "deterministic": False,
    "map": ["theta_deg", "nose_radius_m"],
}
served = rk.uncertainty({"flux": surface}, laws, **asked)
print(served.summary())

# %% [markdown]
# ## What causes it
#
# Left: the share of each law in the variance that the surface transmits, with its interval. Right: the
# probability that the limit is kept over entry angle and nose radius, and the largest box in which it is at
# least 95 %: tolerances that may be given away.

# %%
own = served.responses["flux"]
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
for height, share in enumerate(own.sobol.values()):
    left.barh(height, share.total, color="steelblue")
    left.plot([share.low, share.high], [height, height], color="black", linewidth=2)
left.set(yticks=range(3), yticklabels=list(own.sobol), xlabel="share of the transmitted variance")
area = served.design_space
mesh = right.pcolormesh(*area.axes, np.array(area.probability).T, vmin=0, vmax=1, cmap="Blues")
if area.box:
    (x0, x1), (y0, y1) = (area.box[name] for name in area.factors)
    right.plot([x0, x1, x1, x0, x0], [y0, y0, y1, y1, y0], color="black", linewidth=2)
right.plot(drawing["theta_deg"], drawing["nose_radius_m"], "o", color="firebrick")
right.set(xlabel="entry angle [deg]", ylabel="nose radius [m]")
figure.colorbar(mesh, ax=right, label="P(flux below the limit)")
plt.show()

# %% [markdown]
# ## Which tolerance to tighten
#
# `tightening` is the change of the deviation of the flux per unit of the deviation of a factor. Times what a
# tolerance could be narrowed by, it says what that would buy.

# %%
table = {
    name: {
        "sd it has a part in": cause.sd,
        "sd without it": cause.sd_without,
        "gained by halving it": own.sd - np.sqrt(own.sd**2 - 0.75 * cause.sd**2),
    }
    for name, cause in own.causes.items()
}
pd.DataFrame(table).T.round(4)

# %% [markdown]
# ## The proof
#
# A hundred flights of the true simulator: half drawn from the laws, half where it is in doubt whether the
# limit holds.

# %%
proven = rk.prove_uncertainty(lambda x: {"flux": flux(x)}, {"flux": surface}, laws, runs=100, **asked)
true = proven.responses["flux"].true
rows = [
    ("mean", own.mean, own.mean_low, own.mean_high, true["mean"], true["mean_low"], true["mean_high"]),
    ("sd", own.sd, own.sd_low, own.sd_high, true["sd"], true["sd_low"], true["sd_high"]),
    ("outside", own.out_of_specification, own.out_low, own.out_high,
     true["out_of_specification"], true["out_low"], true["out_high"]),
]  # fmt: skip
print(proven.true["sentence"])
print(f"as good as {true['mean_gain']:.1f} times as many plain flights for the mean")
pd.DataFrame(rows, columns=["", "promised", "low", "high", "true", "low", "high"]).round(4)

# %%
if len(known) > flown_before:
    columns = [*space.names, "flux_MW_m2"]
    pd.DataFrame([(*key, value) for key, value in known.items()], columns=columns).to_csv(kept, index=False)

# %% [markdown]
# From the command line the same is a table `[uncertainty]` and a table `[specifications]` in `study.toml`,
# `rsmkit fit`, and `rsmkit verify --uncertainty 100`; see `docs/uncertainty.md`.
