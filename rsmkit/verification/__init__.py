"""Verification: predicted against true at the optimum, and what to do about the difference."""
