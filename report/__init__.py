"""Scores as tables in Markdown, CSV, LaTeX, HTML and JSON."""

from .gaps import gaps
from .layouts import tables
from .page import Picture, page
from .render import FORMATS, render
from .summary import few, headlines
from .table import Number, Table

__all__ = [
    "FORMATS",
    "Number",
    "Picture",
    "Table",
    "few",
    "gaps",
    "headlines",
    "page",
    "render",
    "tables",
]
