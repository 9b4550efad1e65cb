"""Scores as tables in Markdown, CSV, LaTeX, HTML and JSON."""

from .layouts import tables
from .render import FORMATS, render
from .table import Number, Table

__all__ = ["FORMATS", "Number", "Table", "render", "tables"]
