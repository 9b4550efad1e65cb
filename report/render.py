"""Tables as Markdown, CSV, LaTeX, HTML and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..models.errors import ParameterError
from ..models.parameters import suggestion
from .page import first, page
from .table import Cell, Number, Table, as_shown, plain

Provenance = Mapping[str, Any]


def render(tables: Sequence[Table], format: str, provenance: Provenance | None = None) -> str:
    """``tables`` as the text of a file in one of :data:`FORMATS`, with its provenance.

    CSV and JSON hold all digits, the others as many as the standard error leaves. All but JSON
    show control characters as escapes; CSV has an apostrophe before a text that a spreadsheet
    would take for a formula.

    Raises
    ------
    ParameterError : an unknown format
    """
    if format not in FORMATS:
        raise ParameterError(f"unknown format {format!r}{suggestion(format, FORMATS)}")
    shown = tables if format == "json" else [as_shown(t) for t in tables]
    return FORMATS[format](shown, provenance or {})


def _json_line(provenance: Provenance) -> str:
    return json.dumps(provenance, sort_keys=True, allow_nan=False)


def _comment(provenance: Provenance) -> str:
    """Provenance as a comment of Markdown, which must not hold two hyphens."""
    if not provenance:
        return ""
    line = _json_line(provenance).replace("--", "-\\u002d")
    return f"<!-- provenance: {line} -->\n"


_MARKUP = re.compile(r"([\\|*_<>`]|\](?=[(\[:]))")


def _markdown(tables: Sequence[Table], provenance: Provenance) -> str:
    """Tables under their titles, markup in cells escaped, the provenance in a comment behind."""

    def line(cells: Sequence[str]) -> str:
        escaped = (_MARKUP.sub(r"\\\1", c).replace("\n", " ") for c in cells)
        return f"| {' | '.join(escaped)} |\n"

    text = ""
    for t in tables:
        text += f"\n## {t.title}\n\n" if t.title else "\n"
        rule = ("---" if isinstance(c, str) else "---:" for c in first(t))
        text += line(t.columns) + f"|{'|'.join(rule)}|\n"
        text += "".join(line([plain(c) for c in row]) for row in t.rows)
    comment = _comment(provenance)
    return (text + (comment and f"\n{comment}")).lstrip("\n")


def _csv(tables: Sequence[Table], provenance: Provenance) -> str:
    """Tables one after the other, an empty line and a line ``# title`` between them."""
    text = io.StringIO()
    if provenance:
        text.write(f"# provenance: {_json_line(provenance)}\n")
    writer = csv.writer(text, lineterminator="\n")
    for i, t in enumerate(tables):
        text.write("\n" * (i > 0) + (f"# {t.title}\n" if t.title else ""))
        columns = list(zip(*t.rows, strict=True)) if t.rows else [()] * len(t.columns)
        expanded = [_expand(n, c) for n, c in zip(t.columns, columns, strict=True)]
        writer.writerow([_harmless(name) for column in expanded for name in column])
        values = [map(_harmless, v) for column in expanded for v in column.values()]
        writer.writerows(zip(*values, strict=True))
    return text.getvalue()


def _harmless(cell: Any) -> Any:
    """A cell of which no spreadsheet makes a formula."""
    return f"'{cell}" if isinstance(cell, str) and cell.startswith("=") else cell


def _expand(name: str, cells: Sequence[Cell]) -> dict[str, list[Any]]:
    """A column of cells as columns of plain values: value, standard error, validity."""
    numbers = [c if isinstance(c, Number) else None for c in cells]
    values = [c.value if isinstance(c, Number) else c for c in cells]
    columns: dict[str, list[Any]] = {name: values}
    if any(n and not math.isnan(n.stderr) for n in numbers):
        columns[f"{name} stderr"] = [
            n.stderr if n and not math.isnan(n.stderr) else None for n in numbers
        ]
    if any(n and not n.valid for n in numbers):
        columns[f"{name} valid"] = [int(n.valid) if n else None for n in numbers]
    return columns


_LATEX = {c: f"\\{c}" for c in "&%$#_{}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "±": r"$\pm$",
}


def _latex(tables: Sequence[Table], provenance: Provenance) -> str:
    """Tables as floats with captions, after a comment with the provenance."""

    def line(cells: Sequence[str]) -> str:
        escaped = ("".join(_LATEX.get(c, c) for c in cell).replace("\n", " ") for cell in cells)
        return f"{' & '.join(escaped)} \\\\\n"

    text = f"% provenance: {_json_line(provenance)}\n" if provenance else ""
    for t in tables:
        kind = "".join("l" if isinstance(c, str) else "r" for c in first(t))
        caption = "".join(_LATEX.get(c, c) for c in t.title)
        text += f"\\begin{{table}}\n\\centering\n\\caption{{{caption}}}\n"
        text += f"\\begin{{tabular}}{{{kind}}}\n\\hline\n{line(t.columns)}\\hline\n"
        text += "".join(line([plain(c) for c in row]) for row in t.rows)
        text += "\\hline\n\\end{tabular}\n\\end{table}\n"
    return text


def _json(tables: Sequence[Table], provenance: Provenance) -> str:
    """An object of provenance and tables; numbers with value, standard error and validity."""

    def value(cell: Cell) -> Any:
        if not isinstance(cell, Number):
            return cell
        stderr = None if math.isnan(cell.stderr) else cell.stderr
        return {"value": cell.value, "stderr": stderr, "valid": cell.valid}

    tree = {
        "provenance": dict(provenance),
        "tables": [
            {"title": t.title, "columns": t.columns, "rows": [list(map(value, r)) for r in t.rows]}
            for t in tables
        ],
    }
    return json.dumps(tree, indent=1, sort_keys=True, allow_nan=False) + "\n"


FORMATS: Mapping[str, Callable[[Sequence[Table], Provenance], str]] = {
    "md": _markdown,
    "csv": _csv,
    "latex": _latex,
    "html": page,
    "json": _json,
}
