"""Every public name of rsmkit, called from Python; prints one JSON document."""

import inspect
import json
from pathlib import Path

import numpy as np
import simulator

import rsmkit as rk


def plain(value):
    """JSON values of arrays."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def arguments(name):
    """Parameters with their defaults; annotations may name types differently."""
    value = getattr(rk, name)
    if not callable(value):  # a module
        return sorted(value.__all__)
    found = inspect.signature(value).parameters.values()
    return [str(parameter.replace(annotation=parameter.empty)) for parameter in found]


def table(design):
    """A design as JSON values."""
    return {"points": design.points, "kinds": design.kinds, "blocks": design.blocks, "found": design.found}


two = rk.Space(temp_C=(20, 80), time_h=(1, 5))
four = rk.Space(a=(0, 1), b=(-5, 5), c=(10, 30), d=(1, 2))
mixed = rk.Space(
    [rk.Factor("ribs", 1, 6, integer=True, label="ribs")],
    gauge_mm=[1.0, 1.5, 2.5],
    material=["steel", "wood"],
)
ccd = rk.ccd(two, star="inscribed", center=1)
designs = {
    "ccd": ccd,
    "augmented": rk.augment(ccd, 13, min_distance=0.2),
    "optimal": rk.optimal_design(mixed, 12, criterion="I", seed=3),
    "box_behnken": rk.box_behnken(four, blocked=True),
    "full_factorial": rk.full_factorial(mixed, 3),
    "fractional_factorial": rk.fractional_factorial(four, ["D=ABC"], center=2),
    "plackett_burman": rk.plackett_burman(four),
    "definitive_screening": rk.definitive_screening(four),
    "latin_hypercube": rk.latin_hypercube(four, 9, spread="discrepancy", centered=False, seed=4),
    "sobol": rk.sobol(four, 8, seed=2),
    "halton": rk.halton(four, 7),
    "fill": rk.fill(ccd, 12, seed=2),
}
compared = rk.compare_designs({name: designs[name] for name in ("ccd", "augmented", "fill")})

runs = rk.evaluate(simulator.process, designs["augmented"], responses=["yield_pct", "cost_eur"], jobs=1)
models = {
    "polynomial": {},
    "reduced": {"model": "reduced"},
    "stretched": {"model": "stretched", "stretch": "power"},
    "gaussian process": {"model": "gaussian process"},
}
surfaces = {name: rk.fit(runs, **options) for name, options in models.items()}
grid = two.decode(np.array([[0.0, 0.0], [1.0, -1.0], [0.3, 0.7]]))
quadratic = surfaces["polynomial"]
best = rk.search(quadratic, "-yield_pct", subject_to=["cost_eur <= 11", "waste <= 4"], seed=2,
                 functions={"waste": lambda points: simulator.waste(*points.T)}, preset="fast")  # fmt: skip
front = rk.search(quadratic, ["-yield_pct", "cost_eur"], preset="fast", population=12)
proof = rk.verify(best, simulator.process, quadratic, runs, tolerance_pct=5.0,
                  functions={"waste": lambda points: simulator.waste(*points.T)})  # fmt: skip
page = rk.explorer(runs, quadratic, [front], title="From Python")
try:
    rk.Factor("x", 2, 1)
except rk.RsmkitError as error:
    refused = str(error)

document = {
    "names": {name: arguments(name) for name in sorted(rk.__all__)},
    "designs": {name: table(design) for name, design in designs.items()},
    "quality": {
        name: rk.assess(design, order=1).to_json() for name, design in designs.items() if len(design) > 4
    },
    "compared": compared.overview(),
    "responses": {name: runs.y(name) for name in runs.responses},
    "surfaces": {
        model: {
            name: {
                "report": surface.report(),
                "summary": surface.summary(),
                "json": surface.to_json(),
                "predict": surface.predict(grid, interval=0.9),
                "mean": surface.predict(grid, interval=0.9, kind="mean"),
                "gradient": surface.gradient(grid),
            }
            for name, surface in fitted.items()
        }
        for model, fitted in surfaces.items()
    },
    "best": best.to_json(),
    "front": front.to_json(),
    "proof": [proof.name, proof.verdict, proof.sentence, proof.factors],
    "page": page.name,
    "study": [str(rk.load_study("laboratory").space), rk.load_study("laboratory").responses],
    "refused": refused,
    "repr": [repr(Path("x")), repr(mixed), repr(mixed["ribs"])],
}
print(json.dumps(document, indent=1, default=plain))
