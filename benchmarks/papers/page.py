"""What all pages have in common: tables, pictures and where the numbers come from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from echoset.control.runs import paired
from echoset.formats.provenance import versions
from echoset.report.plots import draw
from echoset.report.plots.protocol import Inputs


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def mean(values: Any, digits: int = 2) -> str:
    """Mean over runs and its standard error."""
    value, stderr = paired(np.asarray(values, float))
    return f"{value:.{digits}f} ± {stderr:.{digits}f}"


def picture(kind: str, inputs: Inputs, path: Path) -> None:
    """Draw a picture as ``echoset plot`` does."""
    save(draw.figure(kind, inputs), path)


def save(made: Figure, path: Path) -> None:
    """Write a picture, with the same bytes each time."""
    path.write_bytes(draw.save(made, "svg", {}))


def write(folder: Path, name: str, title: str, source: str, *parts: str) -> None:
    """Write a page: ``source`` says what the numbers were made from."""
    made = ", ".join(f"{package} {version}" for package, version in versions().items())
    how = f"Made by `make paper` with {made}. {source}"
    text = "\n\n".join(part.strip() for part in (f"# {title}", how, *parts))
    (folder / f"{name}.md").write_text(text + "\n")
