"""Batch processor over recorded and simulated radar and ultra-wideband data."""

__version__ = "0.1.0"
