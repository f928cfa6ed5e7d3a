"""The criterion along one coordinate of one run, and its best value there: compiled, closed form.

With ``d`` the change of the run's model row, ``det M_new / det M`` and ``tr W V_new`` are ratios of second
degree forms in ``d`` (:mod:`rsmkit.design.optimal.exchange`), and ``d`` is linear in the basis functions of
the one factor that moves: powers of a number, indicators of a category.
"""
# ruff: noqa: NPY002 - inside compiled code this is numba's own generator, one per thread, seeded per start

from __future__ import annotations

import numpy as np

from rsmkit.design.compiled import compiled
from rsmkit.design.optimal.encoding import TRACE, Flags, Line, Lines, Model
from rsmkit.language.space import Floats

__all__ = ["allowed_interval", "basis", "best_on_line", "clear", "drawn_on_line", "separation"]

LEAST_GAIN = 1e-4  # part of the present value below which a draw would leave the matrix all but singular
HOPELESS = 12.0  # logarithm of odds against a draw that are not worth computing
GRID = 7  # points tried along a coordinate before the best is refined; a quartic has at most two maxima


@compiled
def basis(model: Model, j: int, t: float, e: int) -> float:
    """Basis function e of factor j at t."""
    value = 1.0
    if e > 0 and model.categorical[j]:
        value = model.contrasts[j, int(t), e - 1]
    else:
        for _ in range(e):
            value *= t
    return value


@compiled
def allowed_interval(lines: Lines, categorical: Flags, x: Floats, j: int) -> tuple[float, float]:
    """Give the part of the line through x along coordinate j that lies in the region."""
    low, high = lines.lows[j], lines.highs[j]
    if not categorical[j] and lines.radius < np.inf:
        rest = lines.radius**2
        for q in range(len(x)):
            if q != j and not categorical[q]:
                rest -= x[q] ** 2
        reach = np.sqrt(max(rest, 0.0))
        low, high = max(low, -reach), min(high, reach)
    for c in range(len(lines.offsets)):
        slope = lines.normals[c, j]
        if slope != 0.0:
            rest = lines.offsets[c]
            for q in range(len(x)):
                if q != j:
                    rest -= lines.normals[c, q] * x[q]
            if slope > 0.0:
                high = min(high, rest / slope)
            else:
                low = max(low, rest / slope)
    return low, high


@compiled
def separation(points: Floats, categorical: Flags, i: int, j: int, others: Floats) -> None:
    """Fill `others` with the squared distance of row i to every row, coordinate j left out."""
    for q in range(len(points)):
        others[q] = 0.0
        for c in range(points.shape[1]):
            if c != j:
                gap = points[i, c] - points[q, c]
                if categorical[c] and gap != 0.0:
                    gap = 2.0
                others[q] += gap * gap


@compiled
def clear(model: Model, lines: Lines, points: Floats, i: int, j: int, t: float, others: Floats) -> bool:
    """Whether row i may take the value t at coordinate j without coming too close to another row."""
    if lines.distance > 0.0:
        for q in range(len(points)):
            gap = t - points[q, j]
            if model.categorical[j] and gap != 0.0:
                gap = 2.0
            if q != i and others[q] + gap * gap < lines.distance**2 * (1.0 - 1e-9):
                return False
    return True


@compiled
def _level_value(line: Line, model: Model, j: int, t: float, linear: bool) -> float:
    """Evaluate the criterion with coordinate j at the level t; larger is better."""
    pii, gg, gd, dd, ggA, gdA, ddA, trace = line.scalars
    for e in range(1, len(line.base)):
        u = basis(model, j, t, e) - line.base[e]
        gd += u * line.gV[e]
        dd += 2.0 * u * line.dV[e]
        gdA += u * line.gA[e]
        ddA += 2.0 * u * line.dA[e]
        for f in range(1, len(line.base)):
            w = u * (basis(model, j, t, f) - line.base[f])
            dd += w * line.hV[e, f]
            ddA += w * line.hA[e, f]
    ratio = (1.0 + gd) ** 2 + (pii - gg) * dd
    if not linear:
        return float(ratio)
    if ratio < 1e-10:
        return -np.inf
    return float(-trace - ((gg - pii) * ddA - 2.0 * (1.0 + gd) * gdA + dd * ggA) / ratio)


@compiled
def _expand(line: Line, linear: bool) -> None:
    """Write the ratio, and the change of the trace times the ratio, as polynomials in the coordinate."""
    pii, gg, gd, dd, ggA, gdA, ddA, _ = line.scalars
    size = len(line.base)
    ratio, change, alone, square = line.ratio, line.change, line.alone, line.square
    for e in range(size):
        alone[0, e], alone[1, e] = line.gV[e], line.gA[e]
    for e in range(2 * size - 1):
        square[0, e], square[1, e] = 0.0, 0.0
    alone[0, 0], alone[1, 0] = 1.0 + gd, gdA
    square[0, 0], square[1, 0] = dd, ddA
    for part in range(2 if linear else 1):
        g, d, h = (line.gV, line.dV, line.hV) if part == 0 else (line.gA, line.dA, line.hA)
        for e in range(1, size):
            b = line.base[e]
            alone[part, 0] -= b * g[e]
            square[part, 0] -= 2.0 * b * d[e]
            square[part, e] += 2.0 * d[e]
            for f in range(1, size):
                square[part, e + f] += h[e, f]
                square[part, e] -= line.base[f] * h[e, f]
                square[part, f] -= b * h[e, f]
                square[part, 0] += b * line.base[f] * h[e, f]
    for e in range(2 * size - 1):
        ratio[e] = (pii - gg) * square[0, e]
        change[e] = (gg - pii) * square[1, e] + ggA * square[0, e]
    for e in range(size):
        for f in range(size):
            ratio[e + f] += alone[0, e] * alone[0, f]
            change[e + f] -= 2.0 * alone[0, e] * alone[1, f]


@compiled
def _value(line: Line, t: float, linear: bool) -> float:
    """Evaluate the criterion with a continuous coordinate at t; larger is better."""
    top = len(line.ratio) - 1
    ratio = line.ratio[top]
    for e in range(top - 1, -1, -1):
        ratio = ratio * t + line.ratio[e]
    if not linear:
        return float(ratio)
    if ratio < 1e-10:
        return -np.inf
    change = line.change[top]
    for e in range(top - 1, -1, -1):
        change = change * t + line.change[e]
    return float(-line.scalars[TRACE] - change / ratio)


@compiled
def drawn_on_line(
    line: Line,
    model: Model,
    lines: Lines,
    points: Floats,
    i: int,
    j: int,
    linear: bool,
    others: Floats,
    temperature: float,
    values: int,
) -> float:
    """Draw an allowed value of coordinate j of row i, the likelier the better: a heat bath.

    Of equally spaced values of a continuous coordinate, or the levels of a discrete one, and the present one,
    each with the weight ``exp(log det M / temperature)``, or ``exp(-p log tr W V / temperature)``.
    """
    now = float(points[i, j])
    low, high = allowed_interval(lines, model.categorical, points[i], j)
    count = lines.level_counts[j]
    present = _level_value(line, model, j, now, linear)
    power = (len(model.exponents) if linear else 1.0) / temperature
    least = max(LEAST_GAIN, 1.0 - HOPELESS / power)
    drawn, total = now, 1.0
    for q in range(count if count > 0 else values):
        t = lines.levels[j, q] if count > 0 else low + q * (high - low) / (values - 1)
        if t == now or not low - 1e-9 <= t <= high + 1e-9:
            continue
        value = _level_value(line, model, j, t, linear)
        gain = present / value if linear else value / present
        if gain > least and clear(model, lines, points, i, j, t, others):
            weight = min(gain**power, 1e200)
            total += weight
            if np.random.random() * total < weight:
                drawn = t
    return drawn


@compiled
def best_on_line(
    line: Line, model: Model, lines: Lines, points: Floats, i: int, j: int, linear: bool, others: Floats
) -> float:
    """Find the best allowed value of coordinate j of row i."""
    now = float(points[i, j])
    low, high = allowed_interval(lines, model.categorical, points[i], j)
    best_t, best = now, -np.inf
    if lines.level_counts[j] > 0:
        present = _level_value(line, model, j, now, linear)
        for q in range(lines.level_counts[j]):
            t = lines.levels[j, q]
            value = _level_value(line, model, j, t, linear)
            inside = low - 1e-9 <= t <= high + 1e-9
            if value > best and inside and clear(model, lines, points, i, j, t, others):
                best_t, best = t, value
        return best_t if best > present + 1e-9 * abs(present) else now
    if high <= low:
        return now
    # the determinant is a quartic (of a quadratic model) with at most two maxima, the trace a ratio of such:
    # a few points tell which maximum is the higher, then it is refined
    _expand(line, linear)
    present = _value(line, now, linear)
    step = (high - low) / (GRID - 1)
    for q in range(GRID):
        t = low + q * step if q < GRID - 1 else high
        value = _value(line, t, linear)
        if value > best:
            best_t, best = t, value
    left, middle, right = max(low, best_t - step), best_t, min(high, best_t + step)
    at_left, at_right = _value(line, left, linear), _value(line, right, linear)
    for _ in range(12):  # successive parabolas through three points that bracket the maximum
        towards_left = (middle - left) * (best - at_right)
        towards_right = (middle - right) * (best - at_left)
        if towards_left == towards_right:
            break
        shift = (middle - left) * towards_left - (middle - right) * towards_right
        t = middle - 0.5 * shift / (towards_left - towards_right)
        if not left < t < right or abs(t - middle) < 1e-8:
            break
        value = _value(line, t, linear)
        if value > best:
            if t > middle:
                left, at_left = middle, best
            else:
                right, at_right = middle, best
            middle, best = t, value
        elif t > middle:
            right, at_right = t, value
        else:
            left, at_left = t, value
    best_t = middle
    if not clear(model, lines, points, i, j, best_t, others):
        # too close to another point: the best is then at the rim of a forbidden stretch (or on the grid),
        # where another point is at just the least distance, on either side of it
        best = -np.inf
        for q in range(GRID + 2 * len(points)):
            t = low + q * step
            if q >= GRID:
                room = max(lines.distance**2 - others[(q - GRID) // 2], 0.0)
                t = points[(q - GRID) // 2, j] + (2.0 * (q % 2) - 1.0) * np.sqrt(room)
            if low <= t <= high:
                value = _value(line, t, linear)
                if value > best and clear(model, lines, points, i, j, t, others):
                    best_t, best = t, value
    return best_t if best > present + 1e-9 * abs(present) else now
