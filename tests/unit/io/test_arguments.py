"""Arguments of public functions are checked at the door, by name, kind and word."""

import inspect
from typing import Literal

import numpy as np
import pytest

import rsmkit as rk
from rsmkit.errors import RsmkitError
from rsmkit.io.arguments import _wanted, checked

ARRAYS_ALONE = {"hypervolume", "nondominated"}
FUNCTIONS = sorted(name for name in rk.HOMES if inspect.isfunction(getattr(rk, name)))
SPACE = rk.Space(a=(0.0, 1.0), b=(2.0, 4.0))


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name not in ARRAYS_ALONE])
def test_every_public_function_checks_its_arguments(name):
    inside = inspect.unwrap(getattr(rk, name))
    assert inside is not getattr(rk, name), f"{name} is not checked"
    _, hints = _wanted(inside)
    assert set(hints) >= set(inspect.signature(inside).parameters)


@checked
def paint(
    wall: str,
    color: Literal["red", "green"] = "red",
    coats: int = 1,
    *,
    litres: float | None = None,
    names: tuple[str, ...] | list[str] = (),
    wet: bool = False,
) -> tuple[object, ...]:
    return wall, color, coats, litres, names, wet


@pytest.mark.parametrize(
    ("args", "keys"),
    [
        (("north",), {}),
        ((np.str_("north"), "green", np.int64(3)), {"litres": 2, "wet": np.bool_(True)}),
        ((), {"wall": "north", "litres": np.float32(0.5), "names": ["a", "b"]}),
    ],
)
def test_what_fits_goes_through(args, keys):
    assert paint(*args, **keys)[0] == "north"


@pytest.mark.parametrize(
    ("args", "keys", "words"),
    [
        ((), {}, r"paint\(\): missing a required argument: 'wall'"),
        ((3,), {}, r"paint\(\): wall must be a text; got 3"),
        (("n", "gren"), {}, r"color must be red or green; got 'gren', did you mean 'green'\?"),
        (("n",), {"coats": 1.5}, r"coats must be a whole number; got 1\.5"),
        (("n",), {"coats": True}, "coats must be a whole number; got True"),
        (("n",), {"litres": "two"}, "litres must be a number; got 'two'"),
        (("n",), {"names": "a"}, r"names must be a list .* got 'a'"),
        (("n",), {"names": ["a", 2]}, "names must be a list"),
        (("n",), {"wet": 1}, "wet must be true or false; got 1"),
        (
            ("n",),
            {"colour": "red"},
            r"an argument of paint\(\) must be .* did you mean 'color'",
        ),
        (("n", "red", 1, 2.0), {}, "too many positional arguments"),
    ],
)
def test_what_does_not_is_one_clear_message(args, keys, words):
    with pytest.raises(RsmkitError, match=words):
        paint(*args, **keys)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: rk.ccd("space"), "space must be a Space; got 'space'"),
        (lambda: rk.ccd(SPACE, center="three"), "center must be a whole number; got 'three'"),
        (lambda: rk.ccd(SPACE, centre=3), "did you mean 'center'"),
        (lambda: rk.sobol(SPACE, runs=12.0), "runs must be a whole number"),
        (lambda: rk.augment([[0, 1]], 12), "design must be a Design"),
        (lambda: rk.optimal_design(SPACE, 8, criterion="E"), "criterion must be"),
        (lambda: rk.evaluate("m:f", SPACE), "design must be a Design"),
        (lambda: rk.evaluate("m:f", rk.ccd(SPACE), jobs="4"), "jobs must be a whole number"),
        (lambda: rk.evaluate("m:f", rk.ccd(SPACE), responses="load"), "responses must be a list"),
        (lambda: rk.search({}, 7), "minimize must be"),
        (lambda: rk.fit_surface(SPACE, [[0, 0]], [1], order="two"), "order must be a whole number"),
        (lambda: rk.choose_surface(SPACE, [[0, 0]], [1], options={"model": "auto"}), "options must be"),
        (lambda: rk.open_study(3), "place must be"),
    ],
)
def test_public_functions_refuse_what_makes_no_sense(call, words):
    with pytest.raises(RsmkitError, match=words):
        call()


def test_what_stands_for_a_surface_passes_as_one():
    class Standing:
        stands_for = "surface"

        def __init__(self, surface):
            self.surface = surface

    @checked
    def order_of(space: rk.Space) -> int:
        return 2

    assert order_of(Standing(SPACE)) == 2
    with pytest.raises(RsmkitError, match="space must be a Space; got a"):
        order_of(Standing(3))
