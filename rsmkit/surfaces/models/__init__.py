"""Kinds of surfaces: one file each, one row each in the register."""
