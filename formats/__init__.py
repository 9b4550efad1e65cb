"""The only place that opens data files: HDF5, MCAP, score tables and importers of other formats."""

from .files import (
    Source,
    Windows,
    Writer,
    content_digest,
    header,
    observed_digest,
    oddities,
    open_source,
    open_windows,
    read,
    rescue,
    suffix_format,
    summary,
    write,
    writer,
)

__all__ = [
    "Source",
    "Windows",
    "Writer",
    "content_digest",
    "header",
    "observed_digest",
    "oddities",
    "open_source",
    "open_windows",
    "read",
    "rescue",
    "suffix_format",
    "summary",
    "write",
    "writer",
]
