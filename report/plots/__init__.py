"""Pictures of recordings, estimates and scores: each kind a plugin, drawn to PNG, SVG or PDF.

Matplotlib, the extra ``echoset[plot]``, is imported only where something is drawn.
"""

from .draw import FORMATS, GROUP, available, figure, inline, save
from .protocol import Inputs, Selection
from .residuals import residuals

__all__ = [
    "FORMATS",
    "GROUP",
    "Inputs",
    "Selection",
    "available",
    "figure",
    "inline",
    "residuals",
    "save",
]
