"""A truth that was turned, shifted and delayed comes back by its ranges."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import EchosetError, InputError, ParameterError

ANCHORS = np.array([[0.0, 0.0], [8.0, 0.5], [7.5, 6.0], [-0.5, 5.5]])


def walked(t: np.ndarray) -> np.ndarray:
    """A walk that is no figure of symmetry."""
    x = 4 + 2.5 * np.sin(0.21 * t) + 0.8 * np.sin(0.53 * t + 1)
    return np.column_stack([x, 3 + 1.8 * np.cos(0.17 * t) + 0.7 * np.sin(0.41 * t)])


def read(
    folder: Path, mode: str, angle: float, shift: Any, delay: float, height: float, epoch: int
) -> Any:
    rng = np.random.default_rng(3)
    t = np.arange(0, 120, 0.05)
    a = np.arange(len(t)) % 4
    r = np.hypot(np.linalg.norm(walked(t) - ANCHORS[a], axis=1), height) + 0.15
    r += 0.05 * rng.standard_normal(len(t)) + 2.0 * (rng.random(len(t)) < 0.1)
    log = "".join(f"{epoch + t[k]:.3f},{a[k]},{r[k]:.4f}\n" for k in range(len(t)))
    (folder / "log.csv").write_text("t,a,r\n" + log)
    # The reference's frame: what was walked, seen from a frame that is turned and shifted.
    s = np.arange(-5, 126, 0.1)
    c, d = math.cos(angle), math.sin(angle)
    seen = (walked(s) - shift) @ np.array([[c, -d], [d, c]])
    rows = zip(s - delay, *seen.T, strict=True)
    table = "".join(f"{epoch + u:.3f},{x:.5f},{y:.5f}\n" for u, x, y in rows)
    (folder / "g.csv").write_text("t,x,y\n" + table)
    columns = {"time": "t", "device_x": "x", "device_y": "y"}
    said = {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "a", "distance": "r"},
        "anchors": dict(enumerate(ANCHORS.tolist())),
        "truth": {"file": "g.csv", "columns": columns, "align": mode},
    }
    return csv.read([folder / "log.csv"], csv.Params(said))


@pytest.mark.parametrize(
    ("mode", "angle", "shift", "delay", "height", "epoch"),
    [
        ("both", math.pi, (3.0, -2.0), 0.7, 0.0, 1_700_000_000),
        ("both", 1.0, (3.0, -2.0), -6.7, 2.0, 0),
        ("rigid", -2.5, (-1.0, 4.0), 0.0, 1.0, 1_700_000_000),
        ("time", 0.0, (0.0, 0.0), 0.7, 0.0, 0),
    ],
)
def test_frame_and_clock_come_back(tmp_path: Path, mode, angle, shift, delay, height, epoch):
    log = read(tmp_path, mode, angle, np.array(shift), delay, height, epoch)
    found = log.meta.provenance["truth_aligned"]
    assert abs(math.remainder(found["rotation"] - angle, 2 * math.pi)) < math.radians(0.1)
    assert found["translation"] == pytest.approx(shift, abs=0.01)
    assert found["delay"] == pytest.approx(delay, abs=0.01)
    # Without a height, the offset alone explains the ranges.
    assert found["fitted"] == {"both": 6, "rigid": 5, "time": 3}[mode] - (height == 0)
    o = log.truth.objects
    off = o.columns("device_x", "device_y") - walked((o.time_ns - epoch * 10**9) * 1e-9)
    assert np.linalg.norm(off.mean(axis=0)) < 0.01
    assert np.linalg.norm(off, axis=1).max() < 0.03


def test_what_cannot_be_aligned_is_refused(tmp_path: Path):
    log, truth = tmp_path / "log.csv", {"file": "g.csv", "align": "both"}
    log.write_text("t,a,r\n0,A,1\n1,A,2\n")
    (tmp_path / "g.csv").write_text("t,x,y\n0,1,2\n1,2,3\n")
    said: dict[str, Any] = {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "a", "distance": "r"},
        "anchors": {"A": [0, 0]},
    }
    columns = {"time": "t", "device_x": "x", "device_y": "y"}
    wrong: list[tuple[dict[str, Any], type[EchosetError], str]] = [
        (
            {"columns": columns},
            InputError,
            "needs 30 ranges",
        ),
        ({"columns": {"time": "t", "x": "x", "y": "y"}}, InputError, "needs device_x"),
        ({"align": "affine"}, ParameterError, "align must be rigid, time or both"),
    ]
    for more, error, message in wrong:
        with pytest.raises(error, match=message):
            csv.read([log], csv.Params(said | {"truth": truth | more}))
