"""Models with random effects: restricted likelihood, and inference after Kenward and Roger."""
