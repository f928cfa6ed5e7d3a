"""What a refinement knows of responses, constraints and failures, learnt from all runs so far."""
