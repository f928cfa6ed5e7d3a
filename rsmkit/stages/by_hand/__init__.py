"""Where no simulator makes the runs: run sheets of a laboratory, tables of finished experiments."""
