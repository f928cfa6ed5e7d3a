"""The examples of the flight page run and show what an independent integration found.

The page's numbers are those of a point mass in inertial axes (SciPy DOP853, 1e-12), written apart from this
package.
"""

import doctest
from pathlib import Path

PAGE = Path(__file__).parents[3] / "docs" / "flight.md"


def test_the_examples_of_the_flight_page_run():
    result = doctest.testfile(str(PAGE), module_relative=False)
    assert result.attempted > 15
    assert result.failed == 0
