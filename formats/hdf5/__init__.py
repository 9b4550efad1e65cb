"""HDF5, the random-access archive: what the registry of formats loads."""

from .parts import Parts
from .reader import Source, inspect, read
from .stamp import stamp
from .writer import (
    MAGIC,
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
    "stamp",
    "write",
]
