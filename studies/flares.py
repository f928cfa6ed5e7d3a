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
# # A mixture from the laboratory
#
# A flare is pressed from magnesium, sodium nitrate, strontium nitrate and a binder. Which blend burns
# brightest? The four add up to one, so that no factor can be changed alone: more magnesium is less of
# something else. And not every blend can be pressed: magnesium must be between 40 and 60 %, each nitrate
# at least 10 %, the binder between 3 and 8 %. McLean and Anderson (*Technometrics* 8, 1966) burnt a flare at
# each corner of that region, at the middles of its faces, and in its centre: 15 in all, none twice.

# %%
# %config InlineBackend.figure_formats = ["png"]
# %matplotlib inline
import matplotlib.pyplot as plt
import pandas as pd

import rsmkit as rk
from rsmkit import plots

plt.rcParams["figure.dpi"] = 66
components = ["mg", "nano3", "sr", "binder"]
fit = rk.fit_table("flares.csv", [], ["light"], mixture=components)
flare, report = fit.surfaces["light"], fit.report()["responses"]["light"]
pd.DataFrame(report["blending_models"]["models"])[
    ["model", "df", "ss", "F", "p", "sigma", "r2", "r2_adjusted", "r2_predicted"]
].round(4)

# %% [markdown]
# Sums of squares are about the mean: linear blending of four components has three degrees of freedom, because
# four components that all do the same are a constant. Linear blending is there (p 0.03); the six quadratic
# terms add what chance might (p 0.25), and a negative predicted R2 says how little that model knows of blends
# it has not seen. So the report suggests the linear model. The authors took the quadratic one; we follow,
# warned. No flare was burnt twice, so nobody can tell lack of fit from noise.
#
# ## What the components do
#
# Coefficients of a mixture are hard to read: that of binder is the light of pure binder, which burns not at
# all. What a component does is told along its Cox direction, on which the others keep their proportions.

# %%
pd.DataFrame(report["component_effects"]["effects"]).round(2)

# %% [markdown]
# The slope of the binder is by far the largest: one per cent more of it is worth 19 units of light, although
# only five per cent are to be had. Strontium costs light; of magnesium there is enough. Coefficients in
# pseudo-components, which put the region onto a whole simplex, tell the same story.

# %%
print(report["mixture"]["pseudo"])
pd.DataFrame(report["terms_pseudo"]).round(2)

# %% [markdown]
# ## Where to press the next flare

# %%
best = report["optimum"]["maximum"]
print({name: round(x, 3) for name, x in best["natural"].items()}, "predicted", round(best["predicted"]))
point = list(best["natural"].values())
low, high = (float(limit[0]) for limit in flare.predict([point], interval=0.95)[1:])
print(f"95 % of such flares burn between {low:.0f} and {high:.0f}")

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5), layout="constrained")
plots.ternary(flare, at=point, points=flare.data.points, optimum=point, ax=left)
plots.trace(flare, ax=right)
plt.show()

# %% [markdown]
# The triangle is cut through the region at the binder of the best blend; filled circles are flares that were
# burnt there, the line is the limit of magnesium. The best blend lies on the limit of the binder: before
# anything else one would ask whether that limit is a law of nature or a habit. On the command line:
# `rsmkit fit --data flares.csv --mixture mg,nano3,sr,binder --response light`.
