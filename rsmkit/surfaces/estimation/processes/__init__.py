"""Gaussian processes: correlations, prediction, likelihood, whole paths."""
