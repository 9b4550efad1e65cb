"""Bad recordings of radars: one line that names the place, exit code 4, nothing left behind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset import formats
from echoset.formats import windows
from echoset.models.errors import FormatError
from echoset.models.records import Meta, Recording, Sensor, Stream

SCANS = 20


def recording(kind="position", **changes):
    """One radar, two detections in each of some scans."""
    n = 2 * SCANS
    names = ("x", "y") if kind == "position" else ("range", "azimuth")
    rows = {names[0]: np.linspace(10.0, 20.0, n), names[1]: np.linspace(-0.4, 0.4, n)}
    model = {"p_detect": 0.9, "clutter_rate": 1.0, "max_range": 50.0}
    model |= (
        {"std_position": 1.0} if kind == "position" else {"std_range": 1.0, "std_azimuth": 0.01}
    )
    time, offset = np.arange(SCANS) * 10**9, np.arange(SCANS + 1) * 2
    stream = Stream(kind, ("radar",), model, time, offset, {}, {**rows, **changes.pop("rows", {})})
    sensors = {"radar": Sensor.static("radar", np.zeros(2))}
    return Recording(Meta("log"), sensors, {"radar": replace(stream, **changes)})


def times(*changed):
    time = np.arange(SCANS) * 10**9
    for index, value in changed:
        time[index] = value * 10**9
    return time


def covariance(index, xy):
    cov_xy = np.zeros(2 * SCANS)
    cov_xy[index] = xy
    return {"cov_xx": np.ones(2 * SCANS), "cov_xy": cov_xy, "cov_yy": np.ones(2 * SCANS)}


BAD = {
    "out of order": recording(time_ns=times((12, 3))),
    "out of order in a new window": recording(time_ns=times((8, 3), (9, 9))),
    "second scan": recording(time_ns=times((12, 11))),
    "second scan in a new window": recording(time_ns=times((8, 7))),
    "covariance": recording(rows=covariance(25, 1.2)),
    "range of the view": recording("range_bearing", scan={"view_range_max": np.full(SCANS, 12.0)}),
    "view's azimuths": recording(
        "range_bearing",
        scan={
            "view_azimuth_min": np.full(SCANS, -0.1),
            "view_azimuth_max": np.full(SCANS, 0.1),
        },
    ),
    "no scans": recording().setup(),
}


@pytest.fixture(autouse=True)
def small_windows(monkeypatch):
    monkeypatch.setattr(windows, "WINDOW", 8)


@pytest.mark.parametrize("estimator", ["phd", "mbm", "pmb"])
@pytest.mark.parametrize("form", ["h5", "mcap"])
@pytest.mark.parametrize("name", BAD)
def test_bad_recording(run, tmp_path, empty, monkeypatch, name, form, estimator):
    path = tmp_path / f"bad.{form}"
    with monkeypatch.context() as patch:
        patch.setattr(formats.files, "check", lambda record: None)
        formats.write(BAD[name], path, form)
    result = run("estimate", "-e", estimator, path, "-o", tmp_path / "out/x.h5")
    assert result.code == 4 and empty(), result
    lines = [line for line in result.err.splitlines() if "compiling" not in line]
    assert len(lines) == 1 and lines[0].startswith("echoset: error: "), result.err
    assert f"bad.{form}" in result.err and name.removesuffix(" in a new window") in result.err


@pytest.mark.parametrize("form", ["h5", "mcap"])
@pytest.mark.parametrize("name", [key for key in BAD if key != "no scans"])
def test_bad_recording_is_not_written(tmp_path, name, form):
    with pytest.raises(FormatError, match=name.removesuffix(" in a new window")):
        formats.write(BAD[name], tmp_path / f"bad.{form}", form)


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_sound_recording_passes_the_windows(run, tmp_path, form):
    formats.write(recording(), tmp_path / f"good.{form}", form)
    assert (
        run("estimate", "-e", "phd", tmp_path / f"good.{form}", "-o", tmp_path / "x.h5").code == 0
    )
    assert len(formats.read(tmp_path / "x.h5").objects.time_ns) == SCANS
