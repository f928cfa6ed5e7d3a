"""Where a second-order surface has its optimum."""
