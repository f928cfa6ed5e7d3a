"""What ``rsmkit new`` copies: a small study with its simulator."""
