"""Scores as tables in Markdown, CSV, LaTeX, HTML and JSON."""

from .gaps import gaps
from .layouts import tables
from .page import page
from .render import FORMATS, render
from .table import Number, Table

__all__ = ["FORMATS", "Number", "Table", "gaps", "page", "render", "tables"]
