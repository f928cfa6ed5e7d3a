"""Settings of all tests."""

import os

from hypothesis import settings

# Continuous integration draws the same examples every time; at home each run draws new ones.
settings.register_profile("ci", derandomize=True, print_blob=True)
if os.environ.get("CI"):
    settings.load_profile("ci")
