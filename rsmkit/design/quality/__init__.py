"""What a design is worth: variances, aliases, comparisons."""
