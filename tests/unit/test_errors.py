"""What errors say."""

import numpy as np
import pytest

from rsmkit.errors import RsmkitError, one_of

STARS = ("circumscribed", "inscribed", "faced")


@pytest.mark.parametrize("word", STARS)
def test_an_allowed_word_is_given_back(word):
    assert one_of("star", word, STARS) is word


@pytest.mark.parametrize(
    ("value", "allowed", "message"),
    [
        (
            "inscribd",
            STARS,
            "star must be circumscribed, inscribed or faced; got 'inscribd', did you mean 'inscribed'?",
        ),
        (
            "Faced",
            STARS,
            "star must be circumscribed, inscribed or faced; got 'Faced', did you mean 'faced'?",
        ),
        ("d", ("D", "A", "bayesian-D"), "star must be D, A or bayesian-D; got 'd', did you mean 'D'?"),
        ("", STARS, "star must be circumscribed, inscribed or faced; got ''"),
        (None, STARS, "star must be circumscribed, inscribed or faced; got None"),
        (np.zeros(2), ("a", "b"), "star must be a or b; got array([0., 0.])"),
        (["a"], {"a": 1}, "star must be a; got ['a']"),
        (7, {"a": 1}, "star must be a; got 7"),
    ],
)
def test_a_wrong_word_is_answered_with_the_nearest_right_one(value, allowed, message):
    with pytest.raises(RsmkitError) as refused:
        one_of("star", value, allowed)
    assert str(refused.value) == message
