"""What outputs say of the software that made them."""

from __future__ import annotations

from functools import cache
from importlib.metadata import version


def versions() -> dict[str, str]:
    """Versions of echoset and of the packages that its numbers come from."""
    return {name: _version(name) for name in ("echoset", "numpy", "scipy")}


@cache
def _version(package: str) -> str:
    return version(package)
