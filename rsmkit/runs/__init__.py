"""Evaluation: simulator runs and the durable journal that keeps them (``runs.jsonl``)."""
