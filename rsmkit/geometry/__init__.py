"""Convex sets given by bounds, linear limits and equalities: corners, faces, volumes. Plain arrays only."""
