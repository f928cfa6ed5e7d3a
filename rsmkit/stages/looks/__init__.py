"""Looking without changing anything: does the study run, where does it stand."""
