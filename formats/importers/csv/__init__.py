"""Logs of text, read by a mapping that says what their columns mean."""

from .importer import GENERAL, SUMMARY, Params, read, recognises
from .propose import propose

__all__ = ["GENERAL", "SUMMARY", "Params", "propose", "read", "recognises"]
