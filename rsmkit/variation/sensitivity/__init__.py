"""Which factor causes the variation: exact indices of polynomials, sampled ones, Morris screening."""
