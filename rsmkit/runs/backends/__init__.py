"""Where runs are made: one file per backend, one row each in the register."""
