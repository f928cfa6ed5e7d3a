"""What is kept of runs: the journal, its lock, tables of runs."""
