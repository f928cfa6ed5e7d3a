"""Re-entry flight simulator: atmosphere, aerothermodynamics and six-degree-of-freedom dynamics."""
