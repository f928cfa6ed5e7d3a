"""Small studies with simulators of a microsecond, for ``verdicts.py``: what the verdicts are measured on."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["STUDIES", "SmallStudy"]


@dataclass(frozen=True)
class SmallStudy:
    """One study.

    Parameters
    ----------
    name, family : str
        What it is called, and what it is an example of.
    factors : str
        The table of the study file, names with their options.
    body : str
        Of the simulator: assigns responses from the factors; may use numpy functions as ``m``.
    responses : str
        Names, separated by blanks.
    search : str
        The search table.
    noise : tuple of float
        Standard deviation of each response.
    more : str
        Further tables.
    seeds : tuple of int
        One study for each, with other noise.
    """

    name: str
    family: str
    factors: str
    body: str
    responses: str
    search: str
    noise: tuple[float, ...] = ()
    more: str = ""
    seeds: tuple[int, ...] = (0,)


X2 = "x = { low = -1, high = 1 }\nz = { low = -1, high = 1 }"
X3 = f"{X2}\nw = {{ low = -1, high = 1 }}"
X4 = f"{X3}\ns = {{ low = -1, high = 1 }}"
X5 = f"{X4}\nt = {{ low = -1, high = 1 }}"
MIN_Y = 'minimize = "y"'
GP = "[surface]\nmodel = 'gaussian process'\n"
AUTO = "[surface]\nmodel = 'auto'\n"
LHS = "[design]\nkind = 'latin-hypercube'\nruns = {}\n"
CENTRES = "[design]\ncenter = 4\n"
BOWL = "y = 5 + (x - 0.2)**2 + 2*(z + 0.3)**2 + 0.5*x*z"
BENT = "y = 3 + m.exp(0.7*x) + 1.5*(z - 0.4)**2 + 0.3*x*z"
TEN = tuple(range(1, 11))
FIVE = tuple(range(1, 6))


def _smooth() -> list[SmallStudy]:
    make = [
        ("bowl", X2, BOWL, ""),
        ("bent", X2, BENT, ""),
        ("bent, auto", X2, BENT, AUTO),
        ("skewed", X2, "y = m.exp(1.5*x + z) + 2*m.exp(-x - 0.5*z)", ""),
        ("skewed, GP", X2, "y = m.exp(1.5*x + z) + 2*m.exp(-x - 0.5*z)", GP + LHS.format(25)),
        ("three factors", X3, "y = 10 + x**2 + (z - 0.5)**2 + (w + 0.4)**2 + 0.4*x*w + 0.1*z**3", ""),
        ("plane", X2, "y = 20 + 3*x - 2*z", ""),
        ("reciprocal", X2, "y = 1/(1.4 + x) + 2/(1.6 - x) + z**2", ""),
    ]
    return [SmallStudy(name, "smooth", f, body, "y", MIN_Y, more=more) for name, f, body, more in make]


def _multimodal() -> list[SmallStudy]:
    make = [
        ("ripples", "y = 4 + m.sin(6*x) + m.cos(5*z)", LHS.format(20)),
        ("ripples, GP", "y = 4 + m.sin(6*x) + m.cos(5*z)", GP + LHS.format(60)),
        ("two wells", "y = 2 + (x**2 - 0.5)**2 * 8 + z**2 + 0.1*x", ""),
        ("two wells, GP", "y = 2 + (x**2 - 0.5)**2 * 8 + z**2 + 0.1*x", GP + LHS.format(30)),
        ("narrow pit", "y = 3 + x**2 + z**2 - 2*m.exp(-40*((x - 0.6)**2 + (z - 0.6)**2))", LHS.format(20)),
        (
            "pit beside a valley",
            "y = 3 + (x + 0.4)**2 + 0.5*z**2 - 2.5*m.exp(-12*((x - 0.6)**2 + (z - 0.6)**2))",
            LHS.format(20),
        ),
        (
            "camel",
            "a = 2*x\ny = (4 - 2.1*a**2 + a**4/3)*a**2 + a*z + (-4 + 4*z**2)*z**2",
            GP + LHS.format(40),
        ),
    ]
    return [SmallStudy(name, "multimodal", X2, body, "y", MIN_Y, more=more) for name, body, more in make]


def _zero() -> list[SmallStudy]:
    line = "y = 3 + 2*x + z + 0.5*x*z"
    make = [
        ("target", line, 'minimize = "(y - 4)**2"', ""),
        ("target, abs", line, 'minimize = "abs(y - 4)"', ""),
        ("target, GP", f"{line} + 0.2*m.sin(2*x)", 'minimize = "(y - 4)**2"', GP + LHS.format(20)),
        ("zero bowl", "y = (x - 0.3)**2 + (z + 0.1)**2", MIN_Y, ""),
        ("zero bowl, GP", "y = (x - 0.3)**2 + (z + 0.1)**2", MIN_Y, GP + LHS.format(20)),
        ("zero and bent", "y = (x - 0.3)**2 + (m.exp(z) - 1)**2", MIN_Y, GP + LHS.format(25)),
        ("through zero", "y = x + 0.5*z", MIN_Y, ""),
        (
            "zero, five factors",
            "y = sum((v - 0.1*i)**2 for i, v in enumerate((x, z, w, s, t))) + m.exp(w - 0.2) - 0.8 - w",
            MIN_Y,
            "",
        ),
        ("just zero", "y = 1000*(1 + x)*(1.2 + z)", MIN_Y, ""),
    ]
    return [
        SmallStudy(name, "zero optimum", X5 if "five" in name else X2, body, "y", search, more=more)
        for name, body, search, more in make
    ]


def _constrained() -> list[SmallStudy]:
    cost = "y = 10 + 2*x + 3*z\n"
    make = [
        ("limit", cost + "g = 6 - 2*x - 2*z + 0.5*x*z", 'minimize = "y"\nsubject_to = ["g <= 6"]', ""),
        ("limit, bent", cost + "g = 4*m.exp(-0.4*x - 0.5*z)", 'minimize = "y"\nsubject_to = ["g <= 4"]', ""),
        (
            "limit, bent, GP",
            cost + "g = 4*m.exp(-0.4*x - 0.5*z)",
            'minimize = "y"\nsubject_to = ["g <= 4"]',
            GP + LHS.format(25),
        ),
        (
            "limit, strongly bent",
            cost + "g = m.exp(-1.2*x - 1.5*z)",
            'minimize = "y"\nsubject_to = ["g <= 2"]',
            "",
        ),
        (
            "zero, bent",
            cost + "g = m.exp(-0.6*x - 0.8*z) - 1.1",
            'minimize = "y"\nsubject_to = ["g <= 0"]',
            "",
        ),
        ("limit of zero", cost + "g = -2*x - 2*z + 0.5*x*z", 'minimize = "y"\nsubject_to = ["g <= 0"]', ""),
        ("zero, square", cost + "g = 1 - (x + 1.5)**2/4 - z", 'minimize = "y"\nsubject_to = ["g <= 0"]', ""),
        ("between", cost + "g = x - z", 'minimize = "y"\nsubject_to = ["-0.2 <= g <= 0.2", "x >= -0.5"]', ""),
        (
            "two limits",
            "y = x**2 + z**2 + 1\ng = x + 2*z\nh = 2*x + z",
            'minimize = "y"\nsubject_to = ["g >= 1", "h >= 0.5"]',
            "",
        ),
        ("idle limit", BOWL + "\ng = x + z", 'minimize = "y"\nsubject_to = ["g <= 1"]', ""),
    ]
    return [
        SmallStudy(name, "constrained", X2, body, "y g h" if "\nh" in body else "y g", search, more=more)
        for name, body, search, more in make
    ]


def _failing() -> list[SmallStudy]:
    fails = "if {}: raise ValueError('does not converge')\n"
    make = [
        ("corner fails", fails.format("x + z > 1.5") + BOWL, ""),
        ("slope to the failing corner", fails.format("x + z < -1.2") + "y = 9 + x + z", ""),
        ("optimum fails", fails.format("abs(x - 0.2) < 0.3 and abs(z + 0.3) < 0.3") + BOWL, ""),
        ("optimum fails, GP", fails.format("x > 0.85") + "y = 4 - x + z**2", GP + LHS.format(20)),
        ("half fails", fails.format("x > 0.3") + BOWL, LHS.format(30)),
        (
            "oblique, four factors",
            "if x + z + w + s < -0.9: raise ValueError('does not converge')\n"
            "y = 9 + x + 0.8*z + 0.5*w + 0.3*s + 0.5*x*x + 0.3*z*w",
            "",
        ),
        ("edge fails", fails.format("z < -0.95") + "y = 7 + z + x**2", LHS.format(15)),
    ]
    return [
        SmallStudy(name, "failing", X4 if "four" in name else X2, body, "y", MIN_Y, more=more)
        for name, body, more in make
    ]


def _unreachable() -> list[SmallStudy]:
    body = "y = 50 + 5*x + 3*z + x*z\nc = 12 - x + z**2"
    wish = '[search.desirability]\ny = { goal = "maximize", low = %g, high = 100 }\n'
    other = 'c = { goal = "minimize", low = 0, high = %g }'
    make = [
        ("unreachable", body, "y c", wish % 80 + other % 20),
        ("both unreachable", body, "y c", wish % 80 + other % 10),
        ("reachable", body, "y c", wish % 40 + other % 20),
        ("one at a time", "y = 50 + 5*x\nc = 12 + 3*x", "y c", wish % 54 + other % 10),
        ("no point", "y = 1 + x\ng = 5 + x + z**2", "y g", 'minimize = "y"\nsubject_to = ["g <= 2"]'),
        (
            "exclude each other",
            "y = 1 + x\ng = x + z",
            "y g",
            'minimize = "y"\nsubject_to = ["g <= -1", "g >= 1"]',
        ),
        (
            "spring",
            "y = (2 + z)*(1 + 0.3*x)**2*0.5\ng = 1 + 0.2*x*x - 0.1*z",
            "y g",
            'minimize = "y"\nsubject_to = ["g <= 0"]',
        ),
    ]
    return [SmallStudy(name, "unreachable", X2, body, names, search) for name, body, names, search in make]


def _mixed() -> list[SmallStudy]:
    steel = X2 + "\nmetal = { levels = ['steel', 'brass', 'lead'] }"
    turns = "x = { low = -1, high = 1 }\nn = { levels = [1, 2, 3, 4, 5] }"
    add = "b = {'steel': 0.0, 'brass': -1.0, 'lead': 2.0}[metal]\n"
    make = [
        ("category", steel, add + "y = 6 + b + (x - 0.3*b)**2 + z**2", ""),
        ("category that bends", steel, add + "y = 6 + b*x + (x - 0.3)**2 + m.exp(0.5*z)", ""),
        ("steps", turns, "y = 8 + (n - 3.3)**2 + (x - 0.1*n)**2", ""),
        ("steps, GP", turns, "y = 8 + 6/n + n + x**2", GP + LHS.format(20)),
        ("category, limit", steel, add + "y = 6 + b + x\ng = 2 - x - b*0.2 + z**2", "g"),
    ]
    return [
        SmallStudy(
            name,
            "mixed",
            factors,
            body,
            f"y {extra}".strip() if "GP" not in name else "y",
            'minimize = "y"\nsubject_to = ["g <= 2.5"]' if extra == "g" else MIN_Y,
            more=extra if "GP" in name else "[design]\nkind = 'optimal'\nruns = 24\n",
        )
        for name, factors, body, extra in make
    ]


def _several() -> list[SmallStudy]:
    two = 'minimize = ["y", "c"]'
    robust = 'minimize = "y"\nrobust = { noise = { z = { mean = 0.0, spread = 0.3 } }, deviations = 2.0 }'
    return [
        SmallStudy(
            "front", "front, robust", X2, "y = 2 + x**2 + z**2\nc = 3 + (x - 1)**2 + z**2", "y c", two
        ),
        SmallStudy(
            "bent front", "front, robust", X2, "y = m.exp(x) + z**2\nc = m.exp(-x) + (z - 0.2)**2", "y c", two
        ),
        SmallStudy("robust", "front, robust", X2, "y = 4 + x**2 + (1 + x)*z", "y", robust),
    ]


def _noisy() -> list[SmallStudy]:
    make = [
        ("noisy bowl", BOWL, "y", MIN_Y, (0.1,), CENTRES),
        ("noisy bowl, quiet", BOWL, "y", MIN_Y, (0.02,), CENTRES),
        ("noisy bowl, loud", BOWL, "y", MIN_Y, (0.4,), CENTRES),
        ("noisy bent", BENT, "y", MIN_Y, (0.1,), ""),
        ("noisy target", "y = 3 + 2*x + z", "y", 'minimize = "(y - 4)**2"', (0.1,), CENTRES),
        (
            "noisy limit",
            "y = 10 + 2*x + 3*z\ng = 6 - 2*x - 2*z",
            "y g",
            'minimize = "y"\nsubject_to = ["g <= 6"]',
            (0.1, 0.1),
            CENTRES,
        ),
        (
            "noisy, three factors",
            "y = 5 + (x - 0.2)**2 + 2*(z + 0.3)**2 + (w - 0.1)**2 + 0.5*x*z",
            "y",
            MIN_Y,
            (0.15,),
            "",
        ),
        ("noisy ripples", "y = 4 + m.sin(6*x) + m.cos(5*z)", "y", MIN_Y, (0.1,), LHS.format(20)),
    ]
    return [
        SmallStudy(
            name,
            "noisy",
            X3 if "w" in body else X2,
            body,
            names,
            search,
            noise,
            more,
            TEN if "bowl" in name else FIVE,
        )
        for name, body, names, search, noise, more in make
    ]


STUDIES = [
    *_smooth(),
    *_multimodal(),
    *_zero(),
    *_constrained(),
    *_failing(),
    *_unreachable(),
    *_mixed(),
    *_several(),
    *_noisy(),
]
