"""The only place that opens data files: HDF5, MCAP, score tables and importers of other formats."""

from .files import (
    EstimatesWriter,
    Source,
    content_digest,
    estimates_writer,
    inspect,
    observed_digest,
    open_source,
    read,
    stamp,
    suffix_format,
    write,
)

__all__ = [
    "EstimatesWriter",
    "Source",
    "content_digest",
    "estimates_writer",
    "inspect",
    "observed_digest",
    "open_source",
    "read",
    "stamp",
    "suffix_format",
    "write",
]
