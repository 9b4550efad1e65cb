"""HDF5, the random-access archive: a format in five names, and two that spare reading.

``windows`` reads and ``Writer`` writes a record in windows of time; ``header`` reads the root
alone, ``oddities`` finds what no file of ours holds. Read :mod:`.writer` first.
"""

from .header import header
from .oddities import oddities
from .windows import Windows as windows
from .writer import MAGIC, SUFFIXES, SUMMARY, Writer

__all__ = ["MAGIC", "SUFFIXES", "SUMMARY", "Writer", "header", "oddities", "windows"]
