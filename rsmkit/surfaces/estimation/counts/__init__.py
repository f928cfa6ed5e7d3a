"""Counts and yes/no: scoring, estimates that stay finite, limits of a count."""
