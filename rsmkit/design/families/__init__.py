"""Families of designs: one file each, one row each in the register."""
