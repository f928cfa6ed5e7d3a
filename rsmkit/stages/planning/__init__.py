"""``rsmkit plan``, and what it takes into account: runs paid for before, plots, what a change costs."""
