"""Logs of text, one row a range or a detection, read by a mapping that says what columns mean."""

from .importer import SUMMARY, Params, read

__all__ = ["SUMMARY", "Params", "read"]
