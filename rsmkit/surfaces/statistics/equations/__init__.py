"""Surfaces as equations to read and to copy."""
