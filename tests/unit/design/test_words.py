"""Public design functions refuse words they do not know, and name the nearest one they do."""

import pytest

import rsmkit as rk

SPACE = rk.Space(a=(0, 1), b=(0, 1), c=(0, 1))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: rk.ccd(SPACE, star="inscribd"),
            "ccd(): star must be circumscribed, inscribed or faced; "
            "got 'inscribd', did you mean 'inscribed'?",
        ),
        (
            lambda: rk.ccd(SPACE, alpha="rotateable"),
            "ccd(): alpha must be rotatable, orthogonal, spherical, uncorrelated or a number; "
            "got 'rotateable', did you mean 'rotatable'?",
        ),
        (lambda: rk.ccd(SPACE, cube="half"), "ccd(): cube must be full, fraction or small; got 'half'"),
        (
            lambda: rk.ccd(SPACE, generators="C=AB"),
            "ccd(): generators must be a list (each element a text); got 'C=AB'",
        ),
        (
            lambda: rk.fractional_factorial(SPACE, 8),
            "fractional_factorial(): generators must be a list (each element a text); got 8",
        ),
        (
            lambda: rk.latin_hypercube(SPACE, 10, spread="maxmin"),
            "latin_hypercube(): spread must be maximin, discrepancy or correlation; "
            "got 'maxmin', did you mean 'maximin'?",
        ),
        (
            lambda: rk.optimal_design(SPACE, 14, criterion="d"),
            "optimal_design(): criterion must be D, A, G, I or bayesian-D; got 'd', did you mean 'D'?",
        ),
        (
            lambda: rk.augment(rk.ccd(SPACE), 20, criterion="bayes-D"),
            "optimal_design(): criterion must be D, A, G, I or bayesian-D; "
            "got 'bayes-D', did you mean 'bayesian-D'?",
        ),
    ],
)
def test_unknown_words_are_refused(make, message):
    with pytest.raises(rk.RsmkitError) as refused:
        make()
    assert str(refused.value) == message
