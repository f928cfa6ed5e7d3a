"""rsmkit."""
