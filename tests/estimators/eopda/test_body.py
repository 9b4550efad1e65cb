"""Several tags on one body: position and heading from their ranges."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.eopda.batch.body import offsets
from echoset.estimators.eopda.batch.params import Params
from echoset.estimators.run import Estimation
from echoset.models.columns import ACTIVE
from echoset.models.errors import ParameterError
from echoset.models.records import Meta, Recording, Sensor, Stream

ANCHORS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])
TAGS = {"T0": (-0.2, -0.15), "T1": (-0.2, 0.15), "T2": (0.3, 0.0)}
TEXT = "; ".join(f"{name} {x} {y}" for name, (x, y) in TAGS.items())


def drive(n: int, std: float) -> tuple[Recording, np.ndarray]:
    """A body that turns about itself on an ellipse, and its x y heading (n, 3)."""
    rng = np.random.default_rng(1)
    t = np.arange(n) * 0.2
    x = np.stack((3 + 1.5 * np.cos(0.3 * t), 2.5 + np.sin(0.3 * t), 2.0 + 0.4 * t), 1)
    c, s = np.cos(x[:, 2]), np.sin(x[:, 2])
    sensors = {name: Sensor.device(0) for name in TAGS}
    sensors |= {f"A{j}": Sensor.static("anchor", a) for j, a in enumerate(ANCHORS)}
    time, tx, rx, z = [], [], [], []
    for k in range(n):
        for i, (ahead, left) in enumerate(TAGS.values()):
            p = x[k, :2] + [c[k] * ahead - s[k] * left, s[k] * ahead + c[k] * left]
            for j, a in enumerate(ANCHORS):
                time.append(round(t[k] * 1e9))
                tx.append(i)
                rx.append(3 + j)
                z.append(np.linalg.norm(p - a) + std * rng.normal())
    m = len(z)
    scan = {
        "mode": np.full(m, ACTIVE, np.uint8),
        "tx": np.array(tx, np.int32),
        "rx": np.array(rx, np.int32),
    }
    rows = {"distance": np.array(z), "std": np.full(m, std)}
    stream = Stream(
        "uwb", tuple(sensors), {"tags": TEXT}, np.array(time), np.arange(m + 1), scan, rows
    )
    return Recording(Meta("body"), sensors, {"uwb": stream}), x


@pytest.mark.parametrize("std", [1e-3, 0.05])
def test_position_and_heading_are_found(std: float) -> None:
    record, x = drive(100, std)
    settings = {"learn": [], "range_bias_std": 0.0, "noise_time": 0.0}
    run = Estimation("range-ls", (("settings", settings),), 1).on(record.setup(), "body")
    out = list(run.steps(record.scans()))
    found = np.array([e.objects.columns("x", "y", "heading")[0] for e in out])
    e = found - x
    e[:, 2] = np.angle(np.exp(1j * e[:, 2]))
    # twelve ranges of an instant: 0.05 m over the root of six, and over arms of 0.25 m
    assert np.sqrt((e[:, :2] ** 2).sum(1).mean()) < std
    assert np.sqrt((e[:, 2] ** 2).mean()) < 2 * std
    assert "device_x" not in out[0].objects.state_names


def test_places_of_tags_are_a_list() -> None:
    found = offsets(TEXT)
    assert list(found) == list(TAGS)
    for name, place in TAGS.items():
        np.testing.assert_array_equal(found[name], place)
    assert offsets("") == {}
    for wrong in ("T0 1", "T0 1 2 3", "T0 a b", "T0 1 2; T0 3 4", "T0, 1, 2", "T0 1 -e"):
        with pytest.raises(ParameterError, match="tags must be"):
            Params(tags=wrong)
