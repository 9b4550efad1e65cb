"""``score --align``: a truth in another frame and on another clock is fitted, and it is said."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from echoset import formats
from echoset.models.records import Estimates, Meta, Objects, Recording, Sensor, Truth


def objects(t: np.ndarray, place: np.ndarray) -> Objects:
    n = len(t)
    return Objects(
        np.round(t * 1e9).astype(np.int64), np.arange(n + 1), np.zeros(n, np.int64),
        ("device_x", "device_y"), ("m", "m"), place,
    )  # fmt: skip


def walked(t: np.ndarray) -> np.ndarray:
    return np.column_stack([2 * np.sin(0.21 * t) + t / 40, np.cos(0.37 * t) - 0.3 * t / 40])


@pytest.fixture
def told(tmp_path: Path) -> tuple[Path, Path]:
    """Estimates with errors of 5 cm, and their recording, whose truth is turned, shifted, late."""
    rng = np.random.default_rng(4)
    t = np.arange(20, 140, 0.05)
    s = np.arange(0, 160, 0.1)
    seen = -(walked(s) - [3.0, -2.0])
    sensors = {"A": Sensor.static("anchor", np.zeros(2))}
    truth = Truth(objects(s - 0.7, seen))
    recording = Recording(Meta("la", provenance={"importer": "x"}), sensors, {}, truth)
    formats.write(recording, tmp_path / "lab.h5", "h5")
    making = {"name": "lab.h5", "digest": formats.observed_digest(recording)}
    off = 0.05 * rng.standard_normal((len(t), 2))
    about = Meta("la", provenance={"estimator": "e", "input": making})
    formats.write(Estimates(about, objects(t, walked(t) + off), {}), tmp_path / "e.h5", "h5")
    return tmp_path / "e.h5", tmp_path / "lab.h5"


def test_a_truth_comes_back(run, told, tmp_path: Path):
    est, rec = told
    out = tmp_path / "s.json"
    done = run("score", est, "--truth", rec, "-m", "rmse", "--align", "both", "-o", out)
    assert done.code == 0
    assert "fitted to the estimates: turned by" in done.err
    assert "4 numbers from" in done.err and "too small by a factor of about 0.99" in done.err
    table = json.loads(out.read_text())
    found = table["provenance"]["truth_aligned"]
    # 2400 errors of 0.05 m: the fit is better than 1 cm, 0.1 degree and 10 ms.
    assert abs(abs(found["rotation"]) - math.pi) < math.radians(0.1)
    assert math.hypot(found["translation"][0] - 3, found["translation"][1] + 2) < 0.01
    assert found["delay"] == pytest.approx(0.7, abs=0.01)
    scores = formats.scores.read(out, str(out)).where(metric="rmse", timed=False)
    assert scores.value[0] == pytest.approx(0.05 * math.sqrt(2), abs=4.5 * 0.05 / math.sqrt(2400))


def test_without_a_fit_the_truth_stays(run, told, tmp_path: Path):
    est, rec = told
    done = run("score", est, "--truth", rec, "-m", "rmse", "-o", tmp_path / "s.csv")
    assert done.code == 0 and "fitted" not in done.err
    scores = formats.scores.read(tmp_path / "s.csv", "").where(metric="rmse", timed=False)
    assert scores.value[0] > 1


def test_what_was_fitted_on_import_is_said(run, told, tmp_path: Path):
    est, rec = told
    record = formats.read(rec)
    aligned = {
        "mode": "rigid", "fitted": 5, "ranges": 1000, "rotation": 0.5, "translation": [1.0, 2.0],
        "delay": 0.0,
    }  # fmt: skip
    about = Meta("la", provenance={"importer": "csv", "truth_aligned": aligned})
    formats.write(Recording(about, record.sensors, {}, record.truth), tmp_path / "a.h5", "h5")
    done = run("score", est, "--truth", tmp_path / "a.h5", "-m", "rmse", "-o", tmp_path / "s.csv")
    assert "fitted to the ranges: turned by 28.65 degrees" in done.err
    assert "5 numbers from 1000 ranges" in done.err


def test_sets_cannot_be_fitted(run, told, tmp_path: Path):
    est, rec = told
    found = formats.read(est)
    o = found.objects
    offset = np.append(o.row_offset[:-2], o.row_offset[-1])
    two = Objects(o.time_ns[:-1], offset, o.label + np.arange(len(o.label)),
                  o.state_names, o.state_units, o.state)  # fmt: skip
    formats.write(Estimates(found.meta, two, {}), tmp_path / "two.h5", "h5")
    done = run("score", tmp_path / "two.h5", "--truth", rec, "--align", "rigid")
    assert done.code == 4 and "there are several" in done.err
