"""The body: shape, mass, vehicle."""
