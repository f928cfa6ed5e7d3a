"""The paper's Figures 1, 2, 4, 5 and 6; Figure 3 is ``sim.plots.plot_history``."""

from __future__ import annotations

import math
from itertools import combinations
from typing import Any

import fly
import matplotlib.pyplot as plt
import numpy as np
from comparison import FACTORS, Reproduction
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rsmkit import Design
from sim import Vehicle, reference_vehicle

INK, OURS, THEIRS, MUTED = "#222222", "#1f5fa8", "#c2410c", "#9aa5b1"
NAMES = {
    "axial_integral": "F1, axial force",
    "heat_integral": "F2, heat flux",
    "margin_inverse": "F3, margin",
}


def vehicles(named: dict[str, dict[str, float]]) -> Figure:
    """Figure 1: the first vehicle with its dimensions, and all of them laid over one another."""
    figure, (top, bottom) = plt.subplots(
        2, 1, figsize=(8.5, 6.0), layout="constrained", height_ratios=(3, 2.4)
    )
    shapes = {label: reference_vehicle(**factors) for label, factors in named.items()}
    label, vehicle = next(iter(shapes.items()))
    _dimensions(top, vehicle)
    top.set_title(label)
    styles = [(OURS, "-"), (THEIRS, "-"), (MUTED, "--"), (MUTED, ":")]
    for (label, vehicle), (colour, line) in zip(shapes.items(), styles, strict=False):
        x, r = vehicle.shape.outline()
        bottom.plot(np.r_[x, x[-1]], np.r_[r, 0.0], line, color=colour, label=label)
    bottom.set(xlabel="x (m)", ylabel="r (m)", ylim=(0, None))
    bottom.set_aspect("equal")
    bottom.legend(loc="upper left", fontsize=8, frameon=False)
    return figure


def _dimensions(axis: Axes, vehicle: Vehicle) -> None:
    shape = vehicle.shape
    x, r = shape.outline()
    axis.fill_between(x, -r, r, color=OURS, alpha=0.12)
    axis.plot(np.r_[x, x[::-1]], np.r_[r, -r[::-1]], color=INK)
    axis.axhline(0.0, color=MUTED, linewidth=0.8, linestyle="-.")
    axis.plot(vehicle.cg_m, 0.0, "o", color=THEIRS)
    axis.annotate("CG", (vehicle.cg_m, 0.0), xytext=(5, 6), textcoords="offset points", color=THEIRS)
    floor = -1.25 * shape.base_radius_m
    for number, part in enumerate(shape.frusta, start=1):
        axis.annotate(
            "",
            (part.x0_m, floor),
            (part.x1_m, floor),
            arrowprops={"arrowstyle": "<->", "color": INK, "lw": 0.8},
        )
        length = part.x1_m - part.x0_m
        middle = 0.5 * (part.x0_m + part.x1_m)
        axis.text(middle, floor - 0.03, f"L{number}\n{length:.2f} m", ha="center", va="top", fontsize=9)
        axis.plot([part.x0_m, part.x0_m], [floor, -part.r0_m], color=MUTED, linewidth=0.6)
        if part.angle_rad:
            name = "1" if number == 1 else "2"
            axis.text(
                middle,
                0.5 * (part.r0_m + part.r1_m) + 0.07,
                rf"$\theta_{{c{name}}}$ = {math.degrees(part.angle_rad):.2f} deg",
                ha="right",
                fontsize=9,
            )
    radius = shape.nose_radius_m
    edge = (radius * (1 - math.cos(0.9)), radius * math.sin(0.9))
    axis.annotate("", edge, (radius, 0.0), arrowprops={"arrowstyle": "->", "color": INK, "lw": 0.8})
    axis.text(edge[0] - 0.03, edge[1] + 0.05, f"Rn = {radius:.4f} m", ha="right", fontsize=9)
    axis.set_aspect("equal")
    axis.set(ylim=(floor - 0.25, 1.35 * shape.base_radius_m))
    axis.axis("off")


def design(points: Design) -> Figure:
    """Figure 2: the central composite design and the points added to it, in coded units."""
    figure = plt.figure(figsize=(9.5, 4.8), layout="constrained")
    kinds = {
        "factorial": (OURS, "o"),
        "axial": (THEIRS, "^"),
        "center": (INK, "s"),
        "augmented": (MUTED, "o"),
    }
    for place, (title, shown) in enumerate(
        (("the paper's Figure 2", ("factorial", "axial", "center")), ("all 50 points", tuple(kinds))), start=1
    ):
        axis = figure.add_subplot(1, 2, place, projection="3d")
        for start, end in combinations(np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T, 2):
            if np.abs(start - end).sum() == 2:
                axis.plot(*np.transpose([start, end]), color=MUTED, linewidth=0.8)
        for kind in shown:
            rows = points.coded[[k == kind for k in points.kinds]]
            colour, marker = kinds[kind]
            axis.scatter(
                *rows.T, color=colour, marker=marker, s=28, label=f"{len(rows)} {kind}", depthshade=False
            )
            if kind == "axial":
                for row in rows:
                    axis.plot(*np.transpose([np.zeros(3), row]), color=THEIRS, linewidth=0.6, linestyle=":")
        axis.set(xlabel="theta_c1", ylabel="theta_c2", zlabel="Rn")
        axis.set_title(title, fontsize=10)
        axis.set_box_aspect((1, 1, 1), zoom=0.85)
        axis.tick_params(labelsize=7)
        axis.legend(fontsize=8, loc="upper left", frameon=False)
    return figure


def ga_history(found: dict[str, Any]) -> Figure:
    """Figure 4: range, mean distance, and best and mean of every generation."""
    h = {key: np.array(column, float) for key, column in found["history"].items()}
    generation = h["generation"]
    figure, (a, b, c) = plt.subplots(1, 3, figsize=(11.0, 3.4), layout="constrained")
    a.vlines(generation, h["best"], h["worst"], color=OURS, linewidth=1.5)
    a.plot(generation, h["mean"], "_", color=THEIRS, markersize=5)
    a.set(title="(a) best, mean and worst", ylabel="objective")
    b.plot(generation, h["mean_distance"], ".", color=OURS)
    b.set(title="(b) mean distance", ylabel="between individuals, unit box", ylim=(0, None))
    c.plot(generation, h["mean"], ".", color=MUTED, label="mean")
    c.plot(generation, h["best"], ".", color=OURS, label="best")
    c.axhline(found["polished"]["objective"], color=THEIRS, linewidth=0.8, label="after the gradient search")
    c.set(title="(c) best and mean", ylabel="objective")
    c.legend(fontsize=8, frameon=False)
    for axis in (a, b, c):
        axis.set_xlabel("generation")
    return figure


def front(done: Reproduction) -> Figure:
    """Figure 5: the Pareto front in space and in its three projections."""
    points = done.front[list(fly.RESPONSES)].to_numpy()
    marks = {
        "direct GA": (done.ga["table1"]["polished"]["responses"], THEIRS, "*", 130),
        "RSM, flown": (
            {key: value.actual for key, value in done.checks["table1"].responses.items()},
            INK,
            "D",
            30,
        ),
    }
    figure = plt.figure(figsize=(10.0, 8.0), layout="constrained")
    space = figure.add_subplot(2, 2, 1, projection="3d")
    space.scatter(*points.T, s=10, c=OURS, depthshade=False)
    for responses, colour, marker, size in marks.values():
        space.scatter(*[[responses[name]] for name in fly.RESPONSES], c=colour, marker=marker, s=size)
    space.set(xlabel="F1", ylabel="F2", zlabel="F3", title="(a)")
    for place, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=2):
        axis = figure.add_subplot(2, 2, place)
        axis.plot(points[:, i], points[:, j], ".", color=OURS, label="NSGA-II on the simulator")
        for label, (responses, colour, marker, size) in marks.items():
            x, y = responses[fly.RESPONSES[i]], responses[fly.RESPONSES[j]]
            axis.scatter([x], [y], c=colour, marker=marker, s=size, label=label, zorder=3)
        axis.set(
            xlabel=NAMES[fly.RESPONSES[i]], ylabel=NAMES[fly.RESPONSES[j]], title=f"({'abcd'[place - 1]})"
        )
        if place == 2:
            axis.legend(fontsize=8, frameon=False)
    return figure


def contours(done: Reproduction, name: str = "table1") -> Figure:
    """Figure 6: the scalar objective on the surfaces, two variables at a time, the third at its optimum."""
    optimum, space = done.optima[name], done.space
    figure = plt.figure(figsize=(11.5, 7.0), layout="constrained")
    best = done.ga[name]["polished"]["factors"]
    unit = 10.0 ** math.floor(math.log10(done.ga[name]["polished"]["objective"]))
    for place, (i, j) in enumerate(combinations(range(3), 2), start=1):
        axis = figure.add_subplot(2, 3, place)
        relief = figure.add_subplot(2, 3, place + 3, projection="3d")
        x, y = (np.linspace(factor.low, factor.high, 61) for factor in (list(space)[i], list(space)[j]))
        grid = np.tile(optimum.point, (x.size * y.size, 1))
        grid[:, [i, j]] = np.array(np.meshgrid(x, y)).reshape(2, -1).T
        z = done.predict(name, grid).reshape(y.size, x.size)
        z /= unit
        drawn = axis.contour(x, y, z, 12, cmap="viridis")
        axis.clabel(drawn, fontsize=7, fmt="%.3f")
        axis.plot(optimum.point[i], optimum.point[j], "D", color=INK, label="RSM", clip_on=False)
        axis.plot(
            best[FACTORS[i]], best[FACTORS[j]], "*", color=THEIRS, ms=12, label="direct GA", clip_on=False
        )
        titles = [factor.title for factor in space]
        axis.set(xlabel=titles[i], ylabel=titles[j])
        third = 3 - i - j
        axis.set_title(f"{FACTORS[third]} = {optimum.point[third]:.4g}", fontsize=9)
        relief.plot_surface(*np.meshgrid(x, y), z, cmap="viridis", linewidth=0)
        relief.set(xlabel=FACTORS[i], ylabel=FACTORS[j])
        relief.tick_params(labelsize=7)
        relief.set_title(f"objective / {unit:.0e}", fontsize=9)
        if place == 1:
            axis.legend(fontsize=8, loc="lower left")
    return figure
