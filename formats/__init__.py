"""The only place that opens data files: HDF5, MCAP, score tables and importers of other formats."""

from .files import (
    EstimatesWriter,
    Source,
    estimates_writer,
    inspect,
    observed_digest,
    open_source,
    read,
    suffix_format,
    write,
)

__all__ = [
    "EstimatesWriter",
    "Source",
    "estimates_writer",
    "inspect",
    "observed_digest",
    "open_source",
    "read",
    "suffix_format",
    "write",
]
