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
# # A published optimisation, done again
#
# *The Multidisciplinary Design Optimization of a Reentry Vehicle Using Parallel Genetic Algorithms* looks
# for the shape of a re-entry vehicle, two cone angles and a nose radius, that flies from 82 km to the
# ground with little drag, little heating and much stability. It does so twice: by a genetic algorithm that
# flies 1,080 designs, and by a response surface fitted to 50. This notebook does the same with `sim`, the
# flight simulator, and `rsmkit`, and puts every table and figure of the paper beside ours.
#
# **What can be compared.** The paper does not print the vehicle's lengths, mass or inertia, its integrals
# are sums over unknown steps, and some of its tables contradict each other (each case is shown below). So
# its absolute objective values are out of reach for anybody. What can be compared: the aerodynamic
# coefficients, the design, the place of the optimum in the box, and the differences between genetic
# algorithm and surface.
#
# The direct searches take thousands of flights; they are kept in `flights/` and made again by `python
# studies/reentry/fly.py`. Everything else is computed here: the study runs from plan to verification in the
# next cell.

# %%
# %config InlineBackend.figure_formats = ["png"]
# %matplotlib inline
import comparison
import conditions
import matplotlib.pyplot as plt
import pictures
import printed
import results
from IPython.display import Markdown

from sim import plot_history

plt.rcParams["figure.dpi"] = 66


def show(table):
    return Markdown(results.markdown(table))


done = comparison.reproduce()
print(f"{len(done.fit.runs)} flights for the surfaces, {len(done.checks)} to verify their optima")
print(f"kept flights flown again agree to {comparison.drift(done):.1e}")

# %% [markdown]
# ## The vehicle and its design variables
#
# **Figure 1.** Sphere, cone, cylinder, flare. The half-angles and the nose radius vary within bounds; the
# three lengths are constant, so total length and base follow. Below, the middle and the two extremes of the
# box. The lengths are ours: fitted to the paper's aerodynamic tables and rounded.

# %%
figure = pictures.vehicles(
    {
        "optimum printed in the paper": comparison.degrees(printed.GA_OPTIMUM),
        "middle of the box": {"theta_c1_deg": 7.5, "theta_c2_deg": 12.5, "nose_radius_m": 0.225},
        "all variables low": {"theta_c1_deg": 5.0, "theta_c2_deg": 10.0, "nose_radius_m": 0.15},
        "all variables high": {"theta_c1_deg": 10.0, "theta_c2_deg": 15.0, "nose_radius_m": 0.30},
    }
)

# %% [markdown]
# **Table 1.** Parameters of the genetic algorithms. `10e6` in the paper's fitness functions is 1e7. Its
# weights are not the ones behind its results: see *Three objectives* below.

# %%
show(conditions.settings_table(done.study))

# %% [markdown]
# **Table 2.** The start of the flight. The paper's theta may be the flight-path angle or the pitch angle;
# we read it as the former (`angles = "pitch"` takes the other).

# %%
show(conditions.initial_conditions(done.study))

# %% [markdown]
# **Table 3.** The engineering methods, all there. Two of the printed equations needed repair: equation 2 is
# a ratio to the stagnation pressure, not to the static one (its coefficients sum to 1 at the stagnation
# point), and equation 7 has an exponent too many (as the derivation of Kaufman's matching point shows).

# %%
show(conditions.methods_table())

# %% [markdown]
# ## Aerodynamics
#
# **Tables 4, 5 and 6.** Axial force, normal force and pitching moment of the printed optimum, at four
# points of a descent. *CFD* and *Subroutine* are the paper's; the columns after them are our presets.
# `paper` and `literal` are two readings of a sentence in the paper that contradicts its tables; the others
# do not follow the paper. The moment is about the nose, nose-down positive, as printed.

# %%
show(conditions.aerodynamics("CA"))

# %%
show(conditions.aerodynamics("CN"))

# %%
show(conditions.aerodynamics("Cm"))

# %% [markdown]
# Over the sixteen entries that are not zero:

# %%
show(conditions.aerodynamic_differences())

# %% [markdown]
# `paper` comes close to the printed subroutine, but that is how it was made: the lengths and the division
# of methods between Mach regimes were chosen to fit these numbers. It says that the equations are right,
# not that the physics is. What no choice removes is the fall of CA between Mach 5 and 10, which needs a
# change of method. The largest printed difference is 24.37 % (Mach 10, 10 deg), not the 23 % of the paper's
# text.
#
# ## The design
#
# **Figure 2.** The circumscribed central composite design: the cube on the bounds, the star points outside
# (angles down to 3.3 deg, radii up to 0.35 m; our simulator flies them all). The paper speaks of 50 points
# and of 17; ours has 15, with one centre point because a deterministic simulator has nothing to tell twice,
# and 35 more that are D-optimal.

# %%
figure = pictures.design(done.plan.design)

# %% [markdown]
# The paper fits second-order polynomials and mentions stretched variables without giving the function;
# `rsmkit` has families of its own, and the study takes the exponential one. Four kinds of surface through
# the same 50 flights, over 128 flights inside the bounds that none of them has seen (root mean square, per
# cent of the range): stretching halves the errors of F2 and F3, and a Gaussian process errs least:

# %%
show(comparison.surface_quality(done))

# %% [markdown]
# ## The direct genetic algorithm
#
# **Figure 4.** 24 individuals, 45 generations, 1,080 flights, then a gradient search from the best, as in
# the paper; Table 1's weights. The same picture: range and distance shrink as the population gathers. Ours
# has the paper's size and kind of mutation, but neither its code nor its random numbers, so single
# generations do not compare.

# %%
figure = pictures.ga_history(done.ga["table1"])

# %% [markdown]
# **Figure 3.** The flight of that optimum. It enters at 30 deg angle of attack and swings until the air is
# dense enough to damp it; the load and the heating are over before it is subsonic. The step in the axial
# force near 60 s is the change of methods around Mach 5 that the paper prescribes. (The curves of the
# paper's Figure 3 are not legible enough to be laid over ours.)

# %%
figure = plot_history(done.history(done.ga["table1"]["polished"]["factors"]))

# %% [markdown]
# ## Genetic algorithm against response surface
#
# **Table 8.** Where the two put the optimum, for three objectives: Table 1's weights, Table 9's, and a
# normalised one (below). *Diff%* is the paper's formula, 100 |RSM - GA| / GA; the last column relates the
# difference to the width of the box, which is the fairer measure: the paper's 2.5 % of an angle is 4.4 % of
# its range. Where our rows differ by more, the objective is flat: the next table says what the difference
# costs.

# %%
show(comparison.optimum_differences(done))

# %% [markdown]
# **Table 9.** What the surfaces promise at their optimum, what the simulator says there, and what it says
# at the GA's optimum. The printed "calculated value" is, to all its digits, 0.1 F1 + 0.7 F2 + 0.2 F3 of the
# GA's row in Table 7: not a prediction but a flight. Read so, the table says that the surface's optimum is
# 8.2 % worse than the GA's (second row). The surfaces here promise and deliver much closer.

# %%
show(comparison.objective_differences(done))

# %% [markdown]
# **Tables 8 and 9 with other surfaces** on the same flights. *Within the bar* is 1 % in each variable, or
# 0.1 % in the true objective where that is flat, and 1 % between calculated and real. Plain second order is
# what the paper's equation 1 says; stretching brings it close where the optimum is inside the box, less so
# where it lies in a corner.

# %%
show(comparison.models(done))

# %% [markdown]
# The paper stops here. `rsmkit verify --refine` spends a few flights more around the optimum, each where a
# model promises most, until no model promises anything. An optimum in a corner of the box is in the design
# already, and needs none.

# %%
show(comparison.refinements(done))

# %% [markdown]
# How many flights is that? Every way of searching, over several seeds, until a flight is within 0.1 % of the
# true optimum, which was found by an exhaustive search (`benchmarks/search_reentry.py`):

# %%
show(comparison.true_optima())

# %%
show(comparison.simulations())

# %% [markdown]
# **Figure 6.** The objective on the surfaces, two variables at a time with the third at its optimum. The
# paper's conclusion that its surface "predicted a lot of local minimum points" cannot come from its
# equation 1: a second-order polynomial has one stationary point at most, and stretching its variables adds
# none.

# %%
figure = pictures.contours(done)

# %% [markdown]
# ## The Pareto front
#
# **Figure 5.** NSGA-II on the simulator, every individual a flight, with the optimum of the scalar search
# on the front, as it must be: a weighted sum with positive weights is least at a point that nothing
# dominates.

# %%
figure = pictures.front(done)
comparison.front_around(done)

# %% [markdown]
# **Table 7.** The printed rows with their columns put right (the headings say thetac1, thetac2, Rn; the
# numbers are Rn, thetac2, thetac1), the same four designs flown here, and points of our front. The printed
# rows are no Pareto set: row 1 is better than every other in all three objectives, row 2 (the GA's optimum)
# better than row 3. If F3 were to be maximised, none would dominate another; its reciprocal may have been
# lost.

# %%
show(comparison.pareto_rows(done))

# %% [markdown]
# Flown here, the four designs come out in another order (in axial force the best of the printed rows is our
# worst), and the static margin tells them apart more than in print. What separates them is smaller than
# what the unknown lengths, mass and centre of gravity may do: with others than ours the printed optimum is
# the optimum (`RESULTS.md`, *On what the place of the optimum rests*; `printed_optimum/study.toml`).
#
# ## Three objectives that are one
#
# Each term's share in the weighted sum. In the paper the axial force carries 99 %, whatever the weights: it
# minimised drag, and the heat flux did not count. Its optimum is therefore better compared with our point
# of least axial force, in the table above, than with the optimum of our sum, where drag and heat weigh
# about the same and a blunter shape wins. The static margin is next to nothing in both. Dividing each
# response by its value at the middle of the box gives the weights the meaning they seem to have.

# %%
show(comparison.shares(done))

# %% [markdown]
# ## What the star points cost
#
# The paper says *circumscribed*: stars outside the bounds. They tell the surface about designs that nobody
# may build, and the errors inside the bounds pay for it. Here plain second-order surfaces of six designs
# are tried on 128 flights that they have not seen (errors in per cent of the objective's range), and their
# optima, for Table 1's weights, are flown. More runs do not always help: D-optimal points crowd the
# corners, and a surface of the wrong form that bends towards them misses the middle.

# %%
show(comparison.star_points(done))

# %% [markdown]
# ## One page
#
# `RESULTS.md` is written here.

# %%
results.write(done)
