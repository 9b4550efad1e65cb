"""The recording of estimates is found by its digest, and each header read once."""

from __future__ import annotations

import numpy as np

from echoset import formats
from echoset.campaign import truth
from echoset.models.records import Meta, Recording, Sensor


def test_each_header_is_read_once(tmp_path, monkeypatch):
    files = [tmp_path / f"{k}.h5" for k in range(6)]
    digests = []
    for k, path in enumerate(files):
        sensors = {"r": Sensor.static("radar", np.array([k, 0.0]))}
        recording = Recording(Meta(f"n{k}"), sensors, {})
        formats.write(recording, path, "h5")
        digests.append(formats.observed_digest(recording))
    seen: list[str] = []
    header = formats.header
    monkeypatch.setattr(formats, "header", lambda path: seen.append(path.name) or header(path))
    places = tuple(map(str, files))
    for digest, path in zip(digests, files, strict=True):
        provenance = {"estimator": "e", "input": {"name": "x", "digest": digest}}
        estimates = truth.Estimates(Meta("x", provenance=provenance), None, {})  # type: ignore[arg-type]
        assert truth.find(estimates, "e.h5", places) == path
    assert sorted(seen) == [p.name for p in files]
