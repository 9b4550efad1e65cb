"""MCAP, the stream for pipes and viewers: a format in five names, and three that others lack.

``windows`` reads and ``Writer`` writes a record in windows of time; ``header`` reads the end
alone, ``oddities`` finds what no file of ours holds, ``rescue`` what is sound in a damaged one.
Read :mod:`.tables` first, then :mod:`.writer`.
"""

from .container import MAGIC
from .header import header
from .oddities import oddities
from .windows import Rescue as rescue
from .windows import Windows as windows
from .writer import SUFFIXES, SUMMARY, Writer

__all__ = ["MAGIC", "SUFFIXES", "SUMMARY", "Writer", "header", "oddities", "rescue", "windows"]
