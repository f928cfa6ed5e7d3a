"""Runs made by hand: the sheet that goes out to a laboratory, and its results back into the journal."""
