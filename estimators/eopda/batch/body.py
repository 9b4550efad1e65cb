"""Several tags on one body: where on it each of them is."""

from __future__ import annotations

import re

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import shown
from ....models.records import Array

_TAG = re.compile(r"(\S+)((?:\s+[-+.\deE]+){2})")


def offsets(text: str) -> dict[str, Array]:
    """Places (2,) [m] by tag, x ahead and y to the left, of a text such as ``T0 0.1 0; T1 -0.1 0``.

    Raises
    ------
    ParameterError : the text is no such list, or names a tag twice
    """
    found: dict[str, Array] = {}
    for part in filter(None, (part.strip() for part in text.split(";"))):
        match = _TAG.fullmatch(part)
        try:
            if match is None or match[1] in found:
                raise ValueError
            found[match[1]] = np.array([float(number) for number in match[2].split()])
        except ValueError:
            rule = "tags with x and y each once, such as 'T0 0.1 0; T1 -0.1 0'"
            raise ParameterError(f"tags must be {rule}, got {shown(part)}") from None
    return found
