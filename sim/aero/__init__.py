"""Aerodynamics and heating of a body."""
