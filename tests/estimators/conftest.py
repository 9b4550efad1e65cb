"""Recordings of point targets for the tests of filters."""

import numpy as np
import pytest

from echoset.models.records import Meta, Recording, Sensor, Stream

SECOND = 10**9


def _recording(detections, kind="position", model=None, dt=1.0, sensor=None, scan=None):
    """One radar and a list of arrays (n, 2), one a scan, ``dt`` [s] apart."""
    names = ("x", "y") if kind == "position" else ("range", "azimuth")
    rows = np.vstack([np.zeros((0, 2)), *(np.reshape(d, (-1, 2)) for d in detections)])
    offset = np.cumsum([0, *map(len, detections)])
    stream = Stream(
        kind,
        ("radar",),
        model or {},
        np.rint(np.arange(len(detections)) * dt * SECOND).astype(np.int64),
        offset,
        scan or {},
        dict(zip(names, rows.T.copy(), strict=True)),
    )
    sensors = {"radar": sensor or Sensor.static("radar", np.zeros(2))}
    return Recording(Meta("example"), sensors, {"radar": stream})


@pytest.fixture
def make_recording():
    return _recording
