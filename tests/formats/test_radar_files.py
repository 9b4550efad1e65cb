"""Recordings of radars, simulated and measured, through both formats."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoset import formats
from echoset.formats import autoferry
from echoset.models import registry

SCENARIOS = ("crossing", "meeting", "many", "moving-platform")


def make(name: str):
    if name in SCENARIOS:
        module = registry.load("echoset.scenarios", name)
        return module.simulate(module.Params(), np.random.default_rng(4), f"{name}-s4-0000")
    data = Path(os.environ.get("ECHOSET_DATA", Path(__file__).parents[3] / "shared/data"))
    folder = data / "autoferry" / "scenario13"
    if not folder.is_dir():
        pytest.skip(f"the measured recordings are not at {data} ($ECHOSET_DATA)")
    return autoferry.read([folder], autoferry.Params())


@pytest.mark.parametrize("name", [*SCENARIOS, "autoferry"])
def test_there_and_back_gives_equal_bytes(tmp_path: Path, name: str):
    recording = make(name)
    first, stream, second = (tmp_path / f for f in ("a.h5", "a.mcap", "b.h5"))
    formats.write(recording, first, "h5")
    formats.write(formats.read(first), stream, "mcap")
    formats.write(formats.read(stream), second, "h5")
    assert first.read_bytes() == second.read_bytes()
    digest = formats.observed_digest(recording)
    for path in (first, stream):
        assert formats.observed_digest(path) == digest
        source = formats.open_source(path)
        scans = list(source.scans())
        source.close()
        assert [(s.stream, s.time_ns) for s in scans] == [
            (s.stream, s.time_ns) for s in recording.scans()
        ]
        for scan, expected in zip(scans, recording.scans(), strict=True):
            assert scan.scan.keys() == expected.scan.keys()
            for key, values in expected.rows.items():
                np.testing.assert_array_equal(scan.rows[key], values)


@pytest.mark.parametrize("format", ["h5", "mcap"])
@pytest.mark.parametrize("scans", [0, 3])
def test_recordings_without_scans_or_detections(tmp_path: Path, format: str, scans: int):
    module = registry.load("echoset.scenarios", "moving-platform")
    params = module.Params(targets=(), clutter_rate=0.0)
    recording = module.simulate(params, np.random.default_rng(5), "nothing-s5-0000")
    radar = recording.streams["radar"]
    recording = replace(recording, streams={"radar": radar.part(0, scans)})
    formats.write(recording, tmp_path / "a", format)
    read = formats.read(tmp_path / "a").streams["radar"]
    assert (len(read), read.row_offset[-1]) == (scans, 0)
    source = formats.open_source(tmp_path / "a")
    assert len(list(source.scans())) == scans
    source.close()
    assert source.observed_digest == formats.observed_digest(recording)
