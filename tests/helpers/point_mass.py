"""A point mass in Earth-fixed axes, integrated with SciPy: other axes and formulas than the simulator's."""

import numpy as np
from scipy.integrate import solve_ivp


def local_axes(latitude, longitude):
    """Rows north, east, down in Earth-fixed axes."""
    sp, cp, sl, cl = np.sin(latitude), np.cos(latitude), np.sin(longitude), np.cos(longitude)
    return np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0.0], [-cp * cl, -cp * sl, -sp]])


def flown(earth, start, velocity_ned, factor, density, wind, times, **options):
    """Rows (latitude, longitude, height, north, east, down velocity) at some times.

    `start` is (latitude, longitude, height) in rad and m, `velocity_ned` relative to the rotating Earth,
    `factor` half the drag area over the mass; `density` and `wind` (north, east) are functions of height.
    """
    a, e2 = earth.radius_m, earth.flattening * (2 - earth.flattening)
    spin = np.array([0.0, 0.0, earth.rotation_rad_s])

    def place(r):
        longitude, rho = np.arctan2(r[1], r[0]), np.hypot(r[0], r[1])
        latitude = np.arctan2(r[2], rho * (1 - e2))
        for _ in range(8):
            normal = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
            latitude = np.arctan2(r[2] + e2 * normal * np.sin(latitude), rho)
        normal = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
        height = rho * np.cos(latitude) + r[2] * np.sin(latitude) - a**2 / normal
        return latitude, longitude, height

    def rate(t, y):
        r, v = y[:3], y[3:]
        latitude, longitude, height = place(r)
        distance = np.linalg.norm(r)
        j = 1.5 * earth.j2 * (a / distance) ** 2
        z2 = (r[2] / distance) ** 2
        gravity = -earth.gm_m3_s2 / distance**3 * r * (1 + j * (np.array([1.0, 1.0, 3.0]) - 5 * z2))
        north, east, _ = local_axes(latitude, longitude)
        towards_north, towards_east = wind(height)
        relative = v - towards_north * north - towards_east * east
        drag = -factor * density(height) * np.linalg.norm(relative) * relative
        turning = -2 * np.cross(spin, v) - np.cross(spin, np.cross(spin, r))
        return np.concatenate([v, gravity + drag + turning])

    latitude, longitude, height = start
    axes = local_axes(latitude, longitude)
    normal = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    position = -(normal + height) * axes[2] - np.array([0.0, 0.0, normal * e2 * np.sin(latitude)])
    solution = solve_ivp(
        rate,
        (0.0, times[-1]),
        np.concatenate([position, axes.T @ np.asarray(velocity_ned, dtype=float)]),
        "DOP853",
        times,
        **{"rtol": 1e-12, "atol": 1e-8, **options},
    )
    rows = []
    for y in solution.y.T:
        latitude, longitude, height = place(y[:3])
        rows.append((latitude, longitude, height, *(local_axes(latitude, longitude) @ y[3:])))
    return np.array(rows)
