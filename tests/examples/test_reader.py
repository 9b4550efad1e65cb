"""A reader written from the page on file formats, without echoset, reads what echoset writes."""

from __future__ import annotations

import ast
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset import formats
from echoset.formats import leaves
from echoset.models.records import Estimates, Recording

EXAMPLE = Path(__file__).parents[2] / "examples" / "readers"


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(EXAMPLE))
    monkeypatch.delitem(sys.modules, "reader", raising=False)
    import reader

    return reader


def test_it_does_not_use_echoset() -> None:
    for node in ast.walk(ast.parse((EXAMPLE / "reader.py").read_text())):
        for name in getattr(node, "names", ()):
            assert not (getattr(node, "module", None) or name.name).startswith("echoset")


@pytest.mark.parametrize("suffix", ["h5", "mcap"])
@pytest.mark.parametrize("kind", ["recording", "estimates", "both"])
def test_it_reads_the_same_and_finds_the_same_digest(
    reader: Any,
    recording: Recording,
    estimates: Estimates,
    tmp_path: Path,
    suffix: str,
    kind: str,
) -> None:
    both = replace(estimates, recording=recording)
    record = {"recording": recording, "estimates": estimates, "both": both}[kind]
    path = tmp_path / f"x.{suffix}"
    formats.write(record, path, suffix)
    found, stated = reader.read(str(path))
    expected = leaves.of(record)
    assert found.keys() == expected.keys()
    for name, leaf in expected.items():
        np.testing.assert_array_equal(found[name], leaf, err_msg=name)
    assert reader.content_digest(found) == stated == formats.summary(path)["content_digest"]


@pytest.mark.parametrize("suffix", ["h5", "mcap"])
def test_another_number_is_another_digest(
    reader: Any, recording: Recording, tmp_path: Path, suffix: str
) -> None:
    formats.write(recording, tmp_path / f"x.{suffix}", suffix)
    found, stated = reader.read(str(tmp_path / f"x.{suffix}"))
    for name in ("streams/uwb/rows/distance", "truth/objects/state", "sensors/R/position"):
        changed = {**found, name: found[name] + 1e-15 * np.abs(found[name]).max()}
        assert reader.content_digest(changed) != stated
    assert reader.content_digest({**found, "frame": "mop"}) != stated
