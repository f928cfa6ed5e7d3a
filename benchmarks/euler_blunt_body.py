"""Axisymmetric Euler solutions of blunt bodies at zero incidence: the evidence behind the `best` preset.

Finite volumes on a body-fitted grid, MUSCL reconstruction of primitive variables (van Albada limiter), HLLE
fluxes, two-stage time stepping with local steps. Perfect gas, gamma 1.4, free stream p = rho = 1.

    python benchmarks/euler_blunt_body.py 0 3 solutions.csv    # every third case, beginning with the first
"""

from __future__ import annotations

import csv
import math
import sys
import time

import numba
import numpy as np

from sim import BodyShape, reference_vehicle, sphere_cone

GAMMA = 1.4


def grid(shape: BodyShape, ni: int, nj: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes of a grid from the body outwards; slope angles are smoothed so that grid lines do not cross."""
    rn = shape.nose_radius_m
    arc = rn * (0.5 * math.pi - shape.nose_angle_rad)
    total = shape.frusta[-1].s1_m
    n_nose = ni // 3
    ds = arc / n_nose
    # cells grow smoothly from the nose's size
    growth = np.exp(np.linspace(0.0, math.log((total - arc) / (ds * (ni - n_nose))) * 1.6, ni - n_nose))
    growth = np.maximum(growth, 0.3)
    rest = np.concatenate([[0.0], np.cumsum(growth)])
    s = np.concatenate([np.linspace(0.0, arc, n_nose + 1), arc + (total - arc) * rest[1:] / rest[-1]])
    x, r, slope = np.empty(s.size), np.empty(s.size), np.empty(s.size)
    for k, value in enumerate(s):
        if value <= arc * (1 + 1e-12):
            slope[k] = 0.5 * math.pi - value / rn
            x[k], r[k] = rn * (1 - math.sin(slope[k])), rn * math.cos(slope[k])
            continue
        for part in shape.frusta:
            if value <= part.s1_m * (1 + 1e-12):
                t = (value - part.s0_m) / (part.s1_m - part.s0_m)
                x[k] = part.x0_m + t * (part.x1_m - part.x0_m)
                r[k] = part.r0_m + t * (part.r1_m - part.r0_m)
                slope[k] = part.angle_rad
                break
    smooth = slope.copy()
    for _ in range(30):
        smooth[n_nose // 2 : -1] = (
            0.25 * smooth[n_nose // 2 - 1 : -2]
            + 0.5 * smooth[n_nose // 2 : -1]
            + 0.25 * smooth[n_nose // 2 + 1 :]
        )
    height = rn * (0.42 + 0.5 * np.minimum(s / rn, 3.0)) + 0.27 * np.maximum(s - 3.0 * rn, 0.0)
    eta = np.linspace(0.0, 1.0, nj + 1)
    eta = eta * (0.35 + 0.65 * eta)
    x2 = x[:, None] - np.sin(smooth)[:, None] * height[:, None] * eta
    r2 = r[:, None] + np.cos(smooth)[:, None] * height[:, None] * eta
    r2[0] = 0.0
    return x2, r2


@numba.njit(error_model="numpy", fastmath=True)
def hlle(l, q, nx, ny, out):
    rl, ul, vl, pl = l[0], l[1], l[2], l[3]
    rr, ur, vr, pr = q[0], q[1], q[2], q[3]
    unl, unr = ul * nx + vl * ny, ur * nx + vr * ny
    el = pl / 0.4 + 0.5 * rl * (ul * ul + vl * vl)
    er = pr / 0.4 + 0.5 * rr * (ur * ur + vr * vr)
    w = math.sqrt(rr / rl)
    un = (unl + w * unr) / (1 + w)
    u = (ul + w * ur) / (1 + w)
    v = (vl + w * vr) / (1 + w)
    h = ((el + pl) / rl + w * (er + pr) / rr) / (1 + w)
    a = math.sqrt(0.4 * max(h - 0.5 * (u * u + v * v), 1e-10))
    sl = min(0.0, unl - math.sqrt(1.4 * pl / rl), un - a)
    sr = max(0.0, unr + math.sqrt(1.4 * pr / rr), un + a)
    d = 1.0 / (sr - sl)
    fl = (rl * unl, rl * unl * ul + pl * nx, rl * unl * vl + pl * ny, unl * (el + pl))
    fr = (rr * unr, rr * unr * ur + pr * nx, rr * unr * vr + pr * ny, unr * (er + pr))
    wl = (rl, rl * ul, rl * vl, el)
    wr = (rr, rr * ur, rr * vr, er)
    for k in range(4):
        out[k] = (sr * fl[k] - sl * fr[k] + sl * sr * (wr[k] - wl[k])) * d


@numba.njit(error_model="numpy", fastmath=True)
def limited(a, b):
    if a * b <= 0.0:
        return 0.0
    return a * b * (a + b) / (a * a + b * b + 1e-30)


@numba.njit(error_model="numpy", fastmath=True)
def residual(q, xn, rn, res, second):
    ni, nj = xn.shape[0] - 1, xn.shape[1] - 1
    left, right, f = np.empty(4), np.empty(4), np.empty(4)
    res[:] = 0.0
    # faces of constant i; ghosts: mirror at the axis (two cells), extrapolation at the exit
    for j in range(nj):
        for i in range(1, ni + 1):
            dx, dr = xn[i, j + 1] - xn[i, j], rn[i, j + 1] - rn[i, j]
            rf = 0.5 * (rn[i, j + 1] + rn[i, j])
            length = math.sqrt(dx * dx + dr * dr)
            nx, ny = dr / length, -dx / length
            for k in range(4):
                c = q[i + 1, j + 2, k]
                if i == ni:
                    left[k] = right[k] = c
                    continue
                p1 = q[i + 2, j + 2, k]
                m1 = q[i, j + 2, k]
                p2 = q[min(i + 3, ni + 1), j + 2, k]
                left[k] = c + second * 0.5 * limited(c - m1, p1 - c)
                right[k] = p1 - second * 0.5 * limited(p1 - c, p2 - p1)
            hlle(left, right, nx, ny, f)
            for k in range(4):
                flux = f[k] * length * rf
                res[i - 1, j, k] -= flux
                if i < ni:
                    res[i, j, k] += flux
    # faces of constant j
    for i in range(ni):
        for j in range(nj + 1):
            dx, dr = xn[i + 1, j] - xn[i, j], rn[i + 1, j] - rn[i, j]
            rf = 0.5 * (rn[i + 1, j] + rn[i, j])
            length = math.sqrt(dx * dx + dr * dr)
            nx, ny = -dr / length, dx / length
            if j == 0:
                pw = q[i + 2, 2, 3] - 0.5 * second * (q[i + 2, 3, 3] - q[i + 2, 2, 3]) * 0.9
                pw = max(pw, 0.2 * q[i + 2, 2, 3])
                f[0], f[1], f[2], f[3] = 0.0, pw * nx, pw * ny, 0.0
            else:
                for k in range(4):
                    c, p1 = q[i + 2, j + 1, k], q[i + 2, j + 2, k]
                    m1 = q[i + 2, j, k] if j > 1 else c - (p1 - c)
                    p2 = q[i + 2, min(j + 3, nj + 3), k]
                    left[k] = c + second * 0.5 * limited(c - m1, p1 - c)
                    right[k] = p1 - second * 0.5 * limited(p1 - c, p2 - p1)
                hlle(left, right, nx, ny, f)
            for k in range(4):
                flux = f[k] * length * rf
                if j < nj:
                    res[i, j, k] += flux
                if j > 0:
                    res[i, j - 1, k] -= flux


@numba.njit(error_model="numpy", fastmath=True)
def march(q, xn, rn, mach, iterations, second, cfl):
    ni, nj = xn.shape[0] - 1, xn.shape[1] - 1
    res = np.empty((ni, nj, 4))
    u0 = np.empty((ni, nj, 4))
    u_inf = mach * math.sqrt(1.4)
    for _ in range(iterations):
        for stage in range(2):
            for j in range(nj + 4):
                for g in range(2):
                    for k in range(4):
                        q[1 - g, j, k] = q[2 + g, j, k] * (-1.0 if k == 2 else 1.0)
            for i in range(ni + 2):
                for g in range(2):
                    q[i, nj + 2 + g, 0], q[i, nj + 2 + g, 1], q[i, nj + 2 + g, 2], q[i, nj + 2 + g, 3] = (
                        1.0,
                        u_inf,
                        0.0,
                        1.0,
                    )
            residual(q, xn, rn, res, second)
            for i in range(ni):
                for j in range(nj):
                    ax, ar = xn[i + 1, j + 1] - xn[i, j], rn[i + 1, j + 1] - rn[i, j]
                    bx, br = xn[i, j + 1] - xn[i + 1, j], rn[i, j + 1] - rn[i + 1, j]
                    area = 0.5 * abs(ax * br - ar * bx)
                    rc = 0.25 * (rn[i, j] + rn[i + 1, j] + rn[i, j + 1] + rn[i + 1, j + 1])
                    r, u, v, p = (
                        q[i + 2, j + 2, 0],
                        q[i + 2, j + 2, 1],
                        q[i + 2, j + 2, 2],
                        q[i + 2, j + 2, 3],
                    )
                    a = math.sqrt(1.4 * p / r)
                    li = math.hypot(xn[i, j + 1] - xn[i, j], rn[i, j + 1] - rn[i, j])
                    lj = math.hypot(xn[i + 1, j] - xn[i, j], rn[i + 1, j] - rn[i, j])
                    tx, tr = (xn[i + 1, j] - xn[i, j]) / lj, (rn[i + 1, j] - rn[i, j]) / lj
                    ut, un = abs(u * tx + v * tr), abs(-u * tr + v * tx)
                    dt = cfl * area / ((ut + a) * li + (un + a) * lj)
                    w = (r, r * u, r * v, p / 0.4 + 0.5 * r * (u * u + v * v))
                    new = np.empty(4)
                    for k in range(4):
                        source = p * area if k == 2 else 0.0
                        if stage == 0:
                            u0[i, j, k] = w[k]
                            new[k] = w[k] + dt * (res[i, j, k] + source) / (area * rc)
                        else:
                            new[k] = 0.5 * (u0[i, j, k] + w[k] + dt * (res[i, j, k] + source) / (area * rc))
                    rho = max(new[0], 1e-4)
                    q[i + 2, j + 2, 0] = rho
                    q[i + 2, j + 2, 1] = new[1] / rho
                    q[i + 2, j + 2, 2] = new[2] / rho
                    q[i + 2, j + 2, 3] = max(0.4 * (new[3] - 0.5 * (new[1] ** 2 + new[2] ** 2) / rho), 1e-3)


def solve(shape: BodyShape, mach: float, ni: int = 110, nj: int = 60, tolerance: float = 2e-5):
    """Wall pressure coefficients at the cell centres, and the forebody CA on the base area."""
    xn, rn = grid(shape, ni, nj)
    q = np.empty((ni + 2, nj + 4, 4))
    q[:] = (1.0, mach * math.sqrt(1.4), 0.0, 1.0)
    # start from rest-like gas at the wall so that the impulsive start does not pull a vacuum
    for j in range(nj + 2):
        q[:, j, 1] *= min(1.0, (j + 1) / (0.5 * nj))
    march(q, xn, rn, mach, 800, 0.0, 0.4)
    before = 0.0
    for _ in range(40):
        march(q, xn, rn, mach, 400, 1.0, 0.4)
        pw = q[2:, 2, 3] - 0.45 * (q[2:, 3, 3] - q[2:, 2, 3])
        pw = pw[:ni]
        cp = (pw - 1.0) / (0.7 * mach**2)
        ring = rn[1:, 0] ** 2 - rn[:-1, 0] ** 2
        ca = float(np.sum(cp * ring) / rn[-1, 0] ** 2)
        if abs(ca - before) < tolerance * abs(ca):
            break
        before = ca
    x = 0.5 * (xn[1:, 0] + xn[:-1, 0])
    return x, cp, ca


def cases():
    """The validation bodies: a known 9 deg cone, then vehicles of the design box."""
    yield "sc9_0.3", sphere_cone(9.0, 0.3, 1.0), 10.0
    for mach in (10.0, 5.0, 7.0, 14.0):
        for c1, c2, rn in (
            (7.5, 12.5, 0.225),
            (5.0, 10.0, 0.15),
            (10.0, 15.0, 0.30),
            (5.0, 15.0, 0.30),
            (10.0, 10.0, 0.15),
            (8.9225, 10.989, 0.20638),
        ):
            yield f"{c1:g}/{c2:g}/{rn:g}", reference_vehicle(c1, c2, rn).shape, mach


def main() -> None:
    start, step, path = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    size = [int(v) for v in sys.argv[4:6]] or [110, 60]
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["body", "mach", "x_m", "cp", "CA"])
        for name, shape, mach in list(cases())[start::step]:
            clock = time.process_time()
            x, cp, ca = solve(shape, mach, *size)
            for xi, ci in zip(x, cp, strict=True):
                writer.writerow([name, mach, f"{xi:.6g}", f"{ci:.6g}", f"{ca:.6g}"])
            file.flush()
            print(f"{name} Mach {mach:g}: CA {ca:.5f} ({time.process_time() - clock:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
