import numpy as np
import pytest

from rsmkit.errors import RsmkitError
from rsmkit.language.space import Space
from rsmkit.optimum.problem import Archive, build_problem

SPACE = Space(x=(0.0, 4.0), y=(-1.0, 1.0))


def responses(points):
    return {"f": points[:, 0] ** 2, "g": points[:, 0] * points[:, 1]}


def test_objectives_and_margins_use_factors_functions_and_responses():
    problem = build_problem(
        SPACE,
        ["2*f + g", "area"],
        responses,
        responses=["f", "g"],
        subject_to=["1 <= f <= 9", "area + y >= 0"],
        functions={"area": lambda points: points[:, 0] * 10},
    )
    result = problem.evaluate(np.array([[2.0, 0.5], [3.0, -1.0]]))
    assert result.objectives.tolist() == [[9.0, 20.0], [15.0, 30.0]]
    assert result.margins.tolist() == [[3.0, 5.0, 20.5], [8.0, 0.0, 29.0]]


def test_only_constraints_without_responses_are_cheap():
    problem = build_problem(SPACE, "f", responses, responses=["f", "g"], subject_to=["f <= 9", "x >= y"])
    assert [c.text for c in problem.cheap_constraints] == ["x >= y"]
    assert problem.cheap_margins(np.array([[2.0, 0.5]])).tolist() == [[1.5]]


def test_constant_objective_has_one_value_per_point():
    problem = build_problem(SPACE, "3", responses, responses=["f", "g"])
    assert problem.evaluate(np.zeros((4, 2))).objectives.tolist() == [[3.0]] * 4


def test_unknown_name_is_refused_with_the_closest():
    with pytest.raises(RsmkitError, match="did you mean area"):
        build_problem(SPACE, "aria", responses, responses=[], functions={"area": lambda p: p[:, 0]})


def test_names_that_clash_are_refused():
    with pytest.raises(RsmkitError, match="different names"):
        build_problem(SPACE, "f", responses, responses=["f", "x"])


def test_archive_counts_and_keeps_order():
    archive = Archive(build_problem(SPACE, "f", responses, responses=["f", "g"]))
    archive.evaluate(np.array([[1.0, 0.0], [2.0, 0.0]]))
    archive.evaluate(np.array([[3.0, 0.0]]))
    assert archive.count == 3
    assert archive.everything().objectives[:, 0].tolist() == [1.0, 4.0, 9.0]


def test_violation_is_scaled_and_infinite_where_nothing_is_known():
    problem = build_problem(
        SPACE, "log(f)", lambda p: {"f": p[:, 1]}, responses=["f"], subject_to=["1000*x >= 2000"]
    )
    archive = Archive(problem)
    result = archive.evaluate(np.array([[4.0, 1.0], [1.0, 1.0], [2.0, 1.0], [4.0, -1.0]]))
    assert archive.violation(result).tolist() == [0.0, 0.5, 0.0, np.inf]
