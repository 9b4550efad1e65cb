"""MCAP, the stream for pipes and viewers: what the registry of formats loads."""

from .parts import Parts
from .reader import Source, inspect, read
from .records import MAGIC
from .rescue import Rescue as rescue
from .stamp import stamp
from .writer import (
    SUFFIXES,
    SUMMARY,
    EstimatesWriter,
    RecordingWriter,
    doubts,
    write,
)

__all__ = [
    "MAGIC",
    "SUFFIXES",
    "SUMMARY",
    "EstimatesWriter",
    "Parts",
    "RecordingWriter",
    "Source",
    "doubts",
    "inspect",
    "read",
    "rescue",
    "stamp",
    "write",
]
