"""Designs of mixtures."""
