"""Batch processor over recorded and simulated radar and ultra-wideband data.

The commands are described in the README. In Python, ``read``, ``write``, ``estimate`` and
``score`` do the same on records in memory.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from .api import estimate, read, score, write
    from .models.records import Estimates, Recording, Scores

__all__ = ["Estimates", "Recording", "Scores", "estimate", "read", "score", "write"]


def __getattr__(name: str) -> Any:
    """Load the public names when they are asked for: the command line starts without them."""
    if name in ("estimate", "read", "score", "write"):
        return getattr(import_module(".api", __name__), name)
    if name in __all__:
        return getattr(import_module(".models.records", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
