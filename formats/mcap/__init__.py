"""MCAP, the stream for pipes and viewers: what the registry of formats loads."""

from .header import header
from .oddities import oddities
from .reader import Source, read, summary
from .records import MAGIC
from .rescue import Rescue as rescue
from .windows import Windows
from .writer import (
    SUFFIXES,
    SUMMARY,
    EstimatesWriter,
    RecordingWriter,
    write,
)

__all__ = [
    "MAGIC",
    "SUFFIXES",
    "SUMMARY",
    "EstimatesWriter",
    "Windows",
    "RecordingWriter",
    "Source",
    "oddities",
    "summary",
    "read",
    "rescue",
    "header",
    "write",
]
