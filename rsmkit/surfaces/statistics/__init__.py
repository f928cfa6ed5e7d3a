"""What a statistician asks of a fitted surface."""
