"""The scenario in the name of a recording."""

from __future__ import annotations

import re

_RUN = re.compile(r"-s\d+-\d+$")


def scenario(recording: str) -> str:
    """The name of a recording without ``-s<seed>-<run>``, or of a pool without ``-*``."""
    return _RUN.sub("", recording).removesuffix("-*")
