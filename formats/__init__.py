"""The only place that opens data files: HDF5, MCAP, score tables and importers of other formats."""

from .files import (
    EstimatesWriter,
    Parts,
    RecordingWriter,
    Source,
    doubts,
    estimates_writer,
    inspect,
    observed_digest,
    open_parts,
    open_source,
    peek,
    read,
    recording_writer,
    rescue,
    suffix_format,
    write,
)

__all__ = [
    "EstimatesWriter",
    "Parts",
    "RecordingWriter",
    "Source",
    "doubts",
    "estimates_writer",
    "inspect",
    "observed_digest",
    "open_parts",
    "open_source",
    "peek",
    "read",
    "recording_writer",
    "rescue",
    "suffix_format",
    "write",
]
