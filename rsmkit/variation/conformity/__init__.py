"""Whether what varies is good enough: fractions out, capability, regions that conform, proof by true runs."""
