"""How pictures look: colours that the colour-blind tell apart, and lines that grey print does.

Okabe and Ito, Color Universal Design, 2008.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PURPLE, GREY = "#0072B2", "#D55E00", "#CC79A7", "#777777"
SURFACE = "cividis"
"""Colour map of fields: of even steps in lightness, for every kind of eye."""
DIVERGING = "coolwarm"
"""Colour map of what is positive or negative: blue below zero, red above, grey at it."""
LABEL = {"boxstyle": "square,pad=0.1", "facecolor": "#ffffffb0", "edgecolor": "none"}
"""The ground of a label on a field."""
CM = 1 / 2.54
"""Inches in a centimetre."""

_LINES: tuple[tuple[str, Any, str], ...] = (
    (VERMILION, "-", "o"),
    (BLUE, (0, (5, 1.5)), "s"),
    (GREEN, (0, (5, 1.2, 1, 1.2)), "^"),
    (PURPLE, (0, (1.2, 1.2)), "D"),
    (ORANGE, (0, (9, 1.5)), "v"),
    (SKY, (0, (5, 1.2, 1, 1.2, 1, 1.2)), "P"),
)
_HATCHES = ("", "////", "....", "\\\\\\\\", "xxxx", "----")
_BOUNDS: tuple[tuple[str, Any], ...] = (
    (BLACK, "-"),
    (BLACK, (0, (3, 1.5))),
    (BLACK, (0, (1, 1.2))),
)
_STYLE: Any = {
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "figure.titlesize": 9,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#cccccc",
    "grid.linewidth": 0.4,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.handlelength": 2.8,
    "savefig.dpi": 200,
    "svg.fonttype": "none",
    "svg.hashsalt": "echoset",
    "pdf.fonttype": 42,
}


@contextmanager
def style() -> Iterator[None]:
    """Matplotlib as pictures need it, whatever the user's settings."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def line(index: int) -> dict[str, Any]:
    """Colour, dashes and marker of the line ``index``, unlike those of its neighbours."""
    colour, dashes, marker = _LINES[index % len(_LINES)]
    return {"color": colour, "linestyle": dashes, "marker": marker}


def bound(index: int) -> dict[str, Any]:
    """Colour and dashes of the bound ``index``."""
    colour, dashes = _BOUNDS[index % len(_BOUNDS)]
    return {"color": colour, "linestyle": dashes, "linewidth": 1.0}


def box(index: int) -> dict[str, Any]:
    """Filling of the bars or boxes ``index``."""
    colour = _LINES[index % len(_LINES)][0]
    return {"facecolor": colour + "55", "hatch": _HATCHES[index % len(_HATCHES)]}


def shade(index: int) -> dict[str, Any]:
    """Filling of the area ``index`` of a stack."""
    colour = (SKY, ORANGE, PURPLE, GREEN)[index % 4]
    hatch = _HATCHES[index % len(_HATCHES)]
    return {"facecolor": colour + "99", "hatch": hatch, "edgecolor": "#444444", "linewidth": 0.3}
