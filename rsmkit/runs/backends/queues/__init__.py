"""Queues of batch systems: what is written for a job and read of it, the systems' commands, the pool."""
