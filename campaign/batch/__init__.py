"""Batches of tasks: workers, resuming, retries, summaries, rules for make; start with ``run``."""
