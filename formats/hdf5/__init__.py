"""HDF5, the random-access archive: what the registry of formats loads."""

from .header import header
from .oddities import oddities
from .reader import Source, read, summary
from .windows import Windows
from .writer import (
    MAGIC,
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
    "header",
    "write",
]
