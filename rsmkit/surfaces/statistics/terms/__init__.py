"""Which terms and factors matter: tests by term, means of levels, comparisons."""
