"""Records as trees of named leaves, and the digests over them.

Both file formats store the same tree: groups that hold strings, numbers, tuples of strings and
arrays. A leaf's *token* is its type, shape and the SHA-256 of its bytes; the *content digest* is
the SHA-256 over all paths and tokens, so that it covers datasets and attributes alike and is the
same in every format. The *observed digest* leaves out what no estimator may see.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..models.columns import COLUMNS

Array = np.ndarray[Any, Any]
Leaf = str | bool | int | float | tuple[str, ...] | Array
Tree = dict[str, Any]


def flatten(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Leaf]:
    """The leaves of ``tree`` by path, ``a/b/c``, in the order of the names."""
    leaves: dict[str, Leaf] = {}
    for key, value in sorted(tree.items()):
        if isinstance(value, Mapping):
            leaves.update(flatten(value, f"{prefix}{key}/"))
        else:
            leaves[prefix + key] = value
    return leaves


def unflatten(leaves: Mapping[str, Leaf]) -> Tree:
    """The tree whose leaves these are."""
    tree: Tree = {}
    for path, leaf in leaves.items():
        *groups, name = path.split("/")
        node = tree
        for group in groups:
            node = node.setdefault(group, {})
        node[name] = leaf
    return tree


class ArrayToken:
    """The token of an array that arrives in parts along its first axis."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._dtype, self._tail, self._length = "", (), 0

    def update(self, part: Array) -> None:
        """Take in the next rows."""
        self._dtype, self._tail = part.dtype.newbyteorder("<").str, part.shape[1:]
        self._length += len(part)
        self._hash.update(np.ascontiguousarray(part, part.dtype.newbyteorder("<")).tobytes())

    def __str__(self) -> str:
        shape = ",".join(map(str, (self._length, *self._tail)))
        return f"{self._dtype}[{shape}]:{self._hash.hexdigest()}"


def token(leaf: Leaf) -> str:
    """The token of one leaf."""
    if isinstance(leaf, np.ndarray):
        whole = ArrayToken()
        whole.update(leaf)
        return str(whole)
    value = list(leaf) if isinstance(leaf, tuple) else leaf
    return f"{type(leaf).__name__}:{json.dumps(value)}"


def tokens(leaves: Mapping[str, Leaf]) -> dict[str, str]:
    """The tokens of all leaves."""
    return {path: token(leaf) for path, leaf in leaves.items()}


def digest(tokens: Mapping[str, str]) -> str:
    """SHA-256 over paths and tokens."""
    text = json.dumps(sorted(tokens.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def is_observed(path: str) -> bool:
    """Whether an estimator may see the leaf at ``path`` of a recording."""
    top, *rest = path.split("/")
    if top in ("truth", "provenance", "kind"):
        return False
    column = COLUMNS.get(rest[-1]) if top == "streams" and rest[1:2] == ["rows"] else None
    return column is None or not column.evaluation


def observed(paths: Iterable[str]) -> list[str]:
    """Those of ``paths`` that an estimator may see."""
    return [p for p in paths if is_observed(p)]


def observed_digest(tokens: Mapping[str, str]) -> str:
    """Digest of what an estimator may see of a recording; empty for any other record."""
    if tokens["kind"] != token("recording"):
        return ""
    return digest({p: tokens[p] for p in observed(tokens)})
