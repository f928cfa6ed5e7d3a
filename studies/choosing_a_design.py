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
# # Choosing a design
#
# Three factors, a budget of some twenty to fifty runs, a second-order surface in mind. Which points? This
# notebook puts the usual answers side by side, before a single run is spent.

# %%
# %config InlineBackend.figure_formats = ["png"]
# %matplotlib inline
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from rsmkit import (
    Space,
    assess,
    augment,
    box_behnken,
    ccd,
    compare_designs,
    design_space_fraction,
    fill,
    latin_hypercube,
    optimal_design,
    power_of_terms,
    term_correlations,
    variance_profile,
)

space = Space(temperature_C=(120, 180), pressure_bar=(2, 8), time_min=(10, 40))

# %% [markdown]
# ## Small designs
#
# A circumscribed composite design has its star outside the bounds; a faced one does not; a Box-Behnken
# design has no run at a corner; an optimal design takes any number of runs.

# %%
small = {
    "circumscribed": ccd(space, center=1),
    "faced": ccd(space, star="faced", center=1),
    "Box-Behnken": box_behnken(space, center=1),
    "D-optimal, 15": optimal_design(space, 15),
    "I-optimal, 15": optimal_design(space, 15, criterion="I"),
}


def table(designs):
    """Figures of merit, one column per design."""
    compared = compare_designs(designs)
    return pd.DataFrame(dict(compared.rows), index=list(compared.names)).T.round(3)


table(small)

# %% [markdown]
# D-efficiency rewards points far out, so it favours the star that leaves the bounds. Average and largest
# prediction variance are about the place where predictions are wanted. The curve below shows all of it:
# how much of the box is predicted with how much variance.

# %%
figure, axes = plt.subplots(figsize=(6.5, 4), layout="constrained")
for name, design in small.items():
    axes.plot(*design_space_fraction(design), label=name)
axes.set(
    xlabel="fraction of the box", ylabel="prediction variance / error variance", xlim=(0, 1), ylim=(0, 2)
)
axes.grid(alpha=0.3)
axes.legend()
# %% [markdown]
# ## What the runs can tell
#
# Every design warns about what it cannot do.

# %%
for name, design in small.items():
    for warning in assess(design).warnings:
        print(f"{name}: {warning}")

# %% [markdown]
# Power is the chance that a t test finds a term, if the response changes by two error standard deviations
# from the low to the high level. With a deterministic simulator there is no error to speak of; with a
# noisy one, this is what decides how many runs are enough.

# %%
pd.DataFrame({name: power_of_terms(design) for name, design in small.items()}).round(2)

# %%
figure, axes = plt.subplots(1, 3, figsize=(11, 3.6), layout="constrained")
for panel, name in zip(axes, ("circumscribed", "Box-Behnken", "I-optimal, 15"), strict=True):
    matrix, names = term_correlations(small[name])
    image = panel.imshow(np.abs(matrix), vmin=0, vmax=1, cmap="Greys")
    panel.set(title=name, xticks=[], yticks=range(len(names)), yticklabels=names if panel is axes[0] else [])
figure.colorbar(image, ax=axes, label="|correlation| of terms")
# %% [markdown]
# ## Fifty runs
#
# Now the composite design is kept and 35 runs are added: by D-optimality with replicates allowed, by
# D-optimality with every point 0.2 coded units away from the next (replicates tell nothing about a
# deterministic simulator), and as far apart as possible. A Latin hypercube of fifty points starts from
# nothing.

# %%
start = ccd(space, center=1)
large = {
    "D, replicates": augment(start, 50),
    "D, 0.2 apart": augment(start, 50, min_distance=0.2),
    "maximin": fill(start, 50),
    "Latin hypercube": latin_hypercube(space, 50),
}
table(large)

# %% [markdown]
# Keeping the points apart costs a tenth of the D-efficiency: what a *correct* quadratic pays for points
# that see what it misses. The search says how sure it is: how many of its starts ended at the same best
# value, the chance that one more would end at a value not seen before, and how far the design is from a
# bound that no design can pass.

# %%
best = large["D, replicates"]
print(f"{best.found.hits} of {best.found.starts} starts; something new with chance {best.found.unseen:.3f}; "
      f"{assess(best).d_bound_efficiency:.2f} % of the bound")  # fmt: skip

# %%
figure, axes = plt.subplots(1, 4, figsize=(12, 3.2), layout="constrained", sharey=True)
for panel, (name, design) in zip(axes, large.items(), strict=True):
    panel.scatter(*design.coded[:, :2].T, s=18, alpha=0.6)
    panel.add_patch(plt.Rectangle((-1, -1), 2, 2, fill=False))
    panel.set(title=name, xlabel=space.names[0] + ", coded", aspect="equal")
axes[0].set_ylabel(space.names[1] + ", coded")
# %% [markdown]
# D-optimal points crowd the corners: the variance of a *correct* quadratic is smallest that way. The
# spread designs pay some variance to see what the quadratic misses. Along one factor:

# %%
figure, axes = plt.subplots(figsize=(6.5, 4), layout="constrained")
for name, design in large.items():
    profile = variance_profile(design)[0]
    axes.plot(profile.values, profile.variances, label=name)
axes.set(xlabel=profile.factor, ylabel="prediction variance, others at the centre", ylim=(0, None))
axes.grid(alpha=0.3)
axes.legend()

# %% [markdown]
# **In short.** For a quadratic under noise: D or I-optimal, I if predictions matter. For a smooth
# deterministic simulator: keep the points apart, and prefer a spread design when the surface may turn out
# not to be quadratic. Stars outside the bounds only when the simulator is valid there.
