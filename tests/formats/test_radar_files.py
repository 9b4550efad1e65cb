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
from echoset.cli.main import main
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


TABLE = """frame,x,y,z,v,snr,size,first,last,far
0,10,1,0.5,-2.5,20,10,-60,60,70
0,12,-1,0.25,3.5,10,-10,-60,60,70
1,,,,,,,-60,60,70
2,9.75,1,0.5,-2.5,20,10,-30,30,70
"""
MAPPING = """kind: position
columns:
  time: {column: frame, scale: 0.1}
  x: x
  y: y
  z: z
  doppler: v
  power: {column: snr, unit: dB}
  amplitude: {column: snr, unit: dB}
  rcs: {column: size, unit: dBsm}
  view_azimuth_min: {column: first, unit: deg}
  view_azimuth_max: {column: last, unit: deg}
  view_range_max: far
model: {doppler_max: 4.0, std_doppler: 0.1}
"""


@pytest.mark.parametrize("format", ["h5", "mcap"])
def test_all_that_a_radar_tells(tmp_path: Path, format: str, capfd: pytest.CaptureFixture[str]):
    """From a table through the mapping to a file, ``validate`` and ``info``."""
    log, said, out = tmp_path / "log.csv", tmp_path / "log.yaml", tmp_path / f"log.{format}"
    log.write_text(TABLE)
    said.write_text(MAPPING)
    convert = ["convert", "--from", "csv", str(log), "--mapping", str(said), "-o", str(out)]
    assert main(convert) == 0
    assert "no estimator or metric takes" not in capfd.readouterr().err
    assert main(["validate", "--strict", str(out)]) == 0
    assert main(["info", str(out)]) == 0
    shown = capfd.readouterr().out
    assert "position, 3 times (1 empty), 3 rows: " in shown
    line = next(line for line in shown.splitlines() if "3 rows" in line)
    assert {"doppler", "rcs", "amplitude", "power", "view_range_max"} <= set(line.split())
    stream = formats.read(out).streams["radar"]
    assert stream.model == {"doppler_max": 4.0, "std_doppler": 0.1}
    np.testing.assert_array_equal(np.diff(stream.row_offset), [2, 0, 1])
    np.testing.assert_array_equal(stream.rows["doppler"], [-2.5, 3.5, -2.5])
    np.testing.assert_allclose(stream.rows["power"], [100, 10, 100], rtol=1e-12)
    np.testing.assert_allclose(stream.rows["amplitude"], [10, 10**0.5, 10], rtol=1e-12)
    np.testing.assert_allclose(stream.rows["rcs"], [10, 0.1, 10], rtol=1e-12)
    views = stream.scan["view_azimuth_max"]
    np.testing.assert_allclose(np.degrees(views), [60, 60, 30], rtol=1e-12)
    said.write_text(MAPPING.replace("4.0", "3.0").replace("0.1}", "0.01}"))
    assert main([*convert, "--overwrite"]) == 4
    assert "rows/doppler[1]: 3.5 is beyond doppler_max" in capfd.readouterr().err
