"""Further runs around the optimum, wave by wave."""
