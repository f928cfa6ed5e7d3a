"""What the fitting of surfaces repeats so often that it is compiled."""
