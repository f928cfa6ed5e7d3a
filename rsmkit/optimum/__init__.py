"""Search: the best point, or the Pareto front, on surfaces or on the true simulator (``optimum.json``)."""
