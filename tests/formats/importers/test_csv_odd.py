"""Mappings in which any key has any value: understood or refused, never an internal error."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.formats.importers.csv.columns import Field, TimeField
from echoset.formats.importers.csv.mapping import Mapping
from echoset.formats.importers.csv.truth import TruthReading
from echoset.models.errors import EchosetError

ODD: list[Any] = [
    None, True, False, 0, 1, -1, 2, 10**30, 1.5, -0.5, 1e308, 1e-308, "", " ", "a", "A", "t", "1",
    "nan", "1e400", "x" * 5000, "\x00", "é", "١", "error", "first", "2024-05-01", "HH:MM", "(",
    "distance < 1", "b.csv", [], [1], ["t"], [[]], [None, {}], {}, {"a": 1}, {"A": []},
    {"t": {"t": "t"}}, {"file": "b.csv"}, {"file": "b.csv", "columns": {"time": "t"}},
    {"column": "t"}, {"value": 1}, {"anchor": {"A": "B"}}, [0, 0], [1e308, 1e308, -1e308],
    {"A": [0, 0]}, {"offset": "x"}, {"rotation": 1e300},
]  # fmt: skip
LOG = "t,id,r,q\n0,A,1.5,3\n1,A,2.5,\n2,A,,4\n"
TRUTH: dict[str, Any] = {
    "file": "b.csv", "columns": {"time": "t", "x": "r", "y": "r", "label": "id"}, "labels": {"A": 1}
}  # fmt: skip
BASES: dict[str, dict[str, Any]] = {
    "uwb": {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "id", "distance": {"column": "r"}},
        "anchors": {"A": [0, 0]},
        "truth": TRUTH,
    },
    "wide": {
        "kind": "uwb",
        "columns": {"time": {"column": "t"}, "distance": {"pattern": "r_{anchor}"}},
        "names": ["t", "id", "r_A", "q"],
        "header": False,
        "rows": {"id": "A"},
        "anchors": {"A": [0, 0]},
        "truth": {**TRUTH, "header": True},
    },
    "position": {
        "kind": "position",
        "columns": {"time": "t", "x": {"column": "r"}, "y": "r"},
        "sensors": {"radar": {"position": [0, 0], "yaw": 0.5}},
        "sensor_frame": ["forward", "right", "down"],
        "truth": TRUTH,
    },
}
SOURCES = ("column", "value", "columns", "pattern")
"""Keys of a field of which one must be told."""


def changed(base: dict[str, Any], every: int) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Key, odd value and mapping, for each key that may stand anywhere, of all ``every`` one."""
    count = itertools.count()
    measured = "distance" if base["kind"] == "uwb" else "x"
    for kind, path in (
        (Mapping, []),
        (TimeField, ["columns", "time"]),
        (Field, ["columns", measured]),
        (TruthReading, ["truth"]),
    ):
        for field, odd in itertools.product(fields(kind), ODD):
            if next(count) % every:
                continue
            said = copy.deepcopy(base)
            at = said
            for name in path:
                inner = at[name]
                at[name] = inner if isinstance(inner, dict) else {"column": inner}
                at = at[name]
            if field.name in SOURCES and kind in (TimeField, Field):
                at.clear()
            at[field.name] = odd
            yield "/".join([*path, field.name]), odd, said


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.verification)])
@pytest.mark.parametrize("base", BASES)
def test_odd_values_are_understood_or_refused(tmp_path: Path, base: str, every: int):
    (tmp_path / "b.csv").write_text(LOG)
    (tmp_path / "log.csv").write_text(LOG)
    refused = 0
    for key, odd, said in changed(BASES[base], every):
        try:
            csv.read([tmp_path / "log.csv"], csv.Params(said))
        except EchosetError as error:
            refused += 1
            assert str(error), (key, odd)
        except Exception as error:
            pytest.fail(f"{key}: {odd!r}: {type(error).__name__}: {error}")
    assert refused > 1000 / every
