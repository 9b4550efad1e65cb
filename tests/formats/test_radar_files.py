"""Recordings of radars, simulated and measured, through both formats."""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from echoset import formats
from echoset.formats import windows
from echoset.formats.importers import autoferry
from echoset.models import registry
from echoset.models.errors import FormatError

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


def test_places_beyond_single_precision_are_kept_though_no_viewer_draws_them(tmp_path: Path):
    recording = make("moving-platform")
    (name, stream), *_ = recording.streams.items()
    rows = {**stream.rows, "range": np.full(len(stream.rows["range"]), 1e60)}
    scan = {key: values for key, values in stream.scan.items() if not key.startswith("view_")}
    far = replace(recording, streams={name: replace(stream, scan=scan, rows=rows)})
    formats.write(far, tmp_path / "far.mcap", "mcap")
    back = formats.read(tmp_path / "far.mcap")
    assert (back.streams[name].rows["range"] == 1e60).all()


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


def test_a_scan_whose_values_were_left_out_is_refused(tmp_path: Path, monkeypatch):
    """Scan by scan as well, where no digest is known yet."""
    recording, add, topics = make("moving-platform"), Writer.add_message, {}
    register, time = Writer.register_channel, recording.streams["radar"].time_ns[1]

    def registered(self, topic, *args, **kwargs):
        channel = register(self, topic, *args, **kwargs)
        topics[channel] = topic
        return channel

    def fewer(self, channel, log_time, *args, **kwargs):
        if not (topics[channel].endswith("/scan") and log_time == time):
            add(self, channel, log_time, *args, **kwargs)

    monkeypatch.setattr(Writer, "register_channel", registered)
    monkeypatch.setattr(Writer, "add_message", fewer)
    monkeypatch.setattr(windows, "WINDOW", 2)
    formats.write(recording, tmp_path / "a.mcap", "mcap")
    source = formats.open_source(tmp_path / "a.mcap")
    with closing(source), pytest.raises(FormatError, match="values of the scan do not fit"):
        list(source.scans())
