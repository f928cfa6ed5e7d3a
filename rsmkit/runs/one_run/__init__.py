"""One run of a simulator: in a worker, in time, whatever it does."""
