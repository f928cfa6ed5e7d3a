"""Pressure on the surface: the published laws, their register, and where each holds."""
