"""The paper's printed numbers, Tables 1, 2 and 4 to 9, as data.

Source: "The Multidisciplinary Design Optimization of a Reentry Vehicle Using Parallel Genetic Algorithms".
Numbers stand as printed, with one correction: the headings of Table 7 name its last three columns thetac1,
thetac2, Rn, but the numbers are Rn, thetac2, thetac1. The first of them, 0.2064 to 0.2150, lies outside the
bounds of an angle (0.0873 to 0.1745 rad) and inside those of the radius, and its GA row is Table 8's.
"""

from __future__ import annotations

# Table 1: what the genetic algorithms were given. 10e6 is 1e7.
GENERATIONS = 45
POPULATION = 24
BOUNDS = {"theta_c1_deg": (5.0, 10.0), "theta_c2_deg": (10.0, 15.0), "nose_radius_m": (0.15, 0.30)}
SCALE = 10e6
WEIGHTS_TABLE_1 = (0.2, 0.7, 0.1)
WEIGHTS_TABLE_9 = (0.1, 0.7, 0.2)  # not printed: those that make Table 9's number out of Table 7's row

# Table 2: start of the flight.
INITIAL_CONDITIONS = {
    "v": "4300 m/s",
    "theta": "-15 deg",
    "nu": "15 deg",
    "alpha": "30 deg",
    "Height": "82 km",
    "p, q, r": "0 rad/s",
}

# Table 3: numbers of the engineering methods.
METHODS = {
    "inviscid": (
        "1 Blunt body",
        "2 Modified Newtonian",
        "3 Modified Newtonian plus Prandtl-Meyer",
        "4 Tangent cone",
        "5 High Mach number",
    ),
    "viscous": ("1 Reference enthalpy", "2 Spalding-Chi"),
}

# Tables 4, 5, 6: Mach, alpha (deg), height (km), CFD, Subroutine, Diff%.
AERODYNAMICS = {
    "CA": (
        (4, 0, 10, 0.28949, 0.3117, 7.6),
        (4, 10, 10, 0.318, 0.32748, 2.98),
        (5, 0, 10, 0.2497754, 0.28289, 13.25),
        (5, 10, 10, 0.2797982, 0.30089, 7.53),
        (10, 0, 8, 0.1909151, 0.16061, -15.87),
        (10, 10, 8, 0.2258, 0.17076, -24.37),
        (14, 0, 60, 0.2102048, 0.18151, -13.65),
        (14, 10, 60, 0.2498, 0.19207, -23.11),
    ),
    "CN": (
        (4, 0, 10, 0.0, 0.0, 0.0),
        (4, 10, 10, 0.352, 0.4052, 15.11),
        (5, 0, 10, 0.0, 0.0, 0.0),
        (5, 10, 10, 0.3248, 0.3937, 21.21),
        (10, 0, 8, 0.0, 0.0, 0.0),
        (10, 10, 8, 0.2708, 0.2856, 5.46),
        (14, 0, 60, 0.0, 0.0, 0.0),
        (14, 10, 60, 0.249, 0.287, 15.26),
    ),
    "Cm": (
        (4, 0, 10, 0.0, 0.0, 0.0),
        (4, 10, 10, 0.542, 0.60396, 11.43),
        (5, 0, 10, 0.0, 0.0, 0.0),
        (5, 10, 10, 0.5045, 0.58749, 16.44),
        (10, 0, 8, 0.0, 0.0, 0.0),
        (10, 10, 8, 0.424, 0.43831, 3.375),
        (14, 0, 60, 0.0, 0.0, 0.0),
        (14, 10, 60, 0.374, 0.43456, 16.19),
    ),
}

# Table 7: F1, F2, F3 as text (every printed digit counts), then thetac1 (rad), thetac2 (rad), Rn (m).
PARETO = (
    ("4603151831824.87", "5561613281.09753", "10317123753.6537", 0.1382, 0.2292, 0.2140),
    ("5165120394485.97", "5674185057.20986", "10411760398.0818", 0.1557, 0.1918, 0.2064),
    ("5809687701099.58", "5837682372.12098", "10816653212.4112", 0.1314, 0.1876, 0.2150),
    ("4962295734064.01", "5878443378.83571", "10997703260.1690", 0.1528, 0.2223, 0.2070),
)
GA_ROW = 1  # row 2 is the optimum of the scalar genetic algorithm

# Table 8: thetac1 (rad), thetac2 (rad), Rn (m), and the printed difference in per cent.
GA_OPTIMUM = (0.155727, 0.191795, 0.20638)
RSM_OPTIMUM = (0.1596, 0.1879, 0.2085)
OPTIMUM_DIFFERENCE_PCT = (2.5003, 2.0337, 1.0075)

# Table 9.
CALCULATED_VALUE = "522566321068.260"
REAL_VALUE = "565385440921.823"
VALUE_DIFFERENCE_PCT = 7.5734
