"""Closed loops of simulator, estimator and policy."""
