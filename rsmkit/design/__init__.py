"""Planning: which points of the design space are worth a simulator run (``design.csv``)."""
