"""From range-angle maps to tracks: ``python benchmarks/bench_jsc.py``.

Six stations and eight targets, drawn by ``map_scene``, and births at 30 places. The parts of the
chain by the definitions on NumPy (DBSCAN: scikit-learn) and as they run; then the filters with
preset ``paper``, maps in memory and everything compiled beforehand. Prints milliseconds per scan
of the fastest run and their ratio to the calibration kernel.
"""

from __future__ import annotations

import os
import tempfile
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import map_scene
import numpy as np
from calibration import fastest, kernel
from sklearn.cluster import DBSCAN

from echoset.estimators import mbm, phd
from echoset.estimators.maps import detector as front
from echoset.estimators.maps.kernels import fusion, pixels
from echoset.estimators.maps.kernels.compiled import pixels as compiled
from echoset.formats import weights
from echoset.models.parameters import resolve, sensor_model
from echoset.models.random import generator
from echoset.models.records import Array, Recording

SCANS, STATIONS = 40, 6


def scene() -> tuple[Recording, Array]:
    """The recording, and where its targets are at first."""
    rng = generator(1, "bench", "jsc")
    start, velocity = rng.uniform(-15, 15, (8, 2)), rng.normal(0, 1.0, (8, 2))
    tracks = start + np.arange(SCANS)[:, None, None] * 0.05 * velocity
    shapes = 4 * [map_scene.PEDESTRIAN] + 4 * [map_scene.VEHICLE]
    places = np.vstack((start, rng.uniform(-19, 19, (22, 2))))
    births = np.array([[0.02, *p, 0, 0, *(0.1**0.5,) * 4] for p in places])
    return map_scene.recording(tracks, shapes, STATIONS, rng, births), start


def line(name: str, unit: float, *seconds: float) -> None:
    """A row of the table: milliseconds, then ratios."""
    print(f"{name:24s}", *(f"{1e3 * s:8.2f} {s / unit:7.4f}" for s in seconds))


def parts(recording: Recording, where: Array, chain: front.Chain, unit: float) -> None:
    """The parts of the chain for one scan."""
    scans = [scan for scan in recording.scans() if scan.time_ns == 0]
    stations = chain.fuse.args[0]  # type: ignore[attr-defined]
    soft = chain.fuse(0, scans)

    def definition() -> None:
        out = np.zeros_like(soft)
        for scan in scans:
            t = stations[scan.stream].table
            fusion.add(out, scan.scan["map"], t.pixel, t.corner, t.u, t.v)

    gate, room = np.full(len(where), 4.0), np.zeros(len(where))
    mask = soft > chain.params.excision * STATIONS
    bright, some = np.argwhere(mask), mask & (np.indices(mask.shape).sum(0) % 4 == 0)
    print("part                      NumPy ms  ratio  as it runs")
    line("fusion", unit, fastest(definition), fastest(lambda: chain.fuse(0, scans)))
    point = 0.1 * bright
    line(
        f"1-NN, {len(bright)} pixels",
        unit,
        fastest(lambda: pixels.nearest(point, where, gate, room)),
        fastest(lambda: compiled.nearest(point, where, gate, room)),
    )
    rest = np.argwhere(some)
    line(
        f"DBSCAN, {len(rest)} pixels",
        unit,
        fastest(lambda: DBSCAN(eps=30.0, min_samples=50).fit(rest), 1),
        fastest(lambda: compiled.dbscan(some, 900, 50)),
    )
    print("part                            ms  ratio")
    assert chain.identify is not None
    told = chain.identify
    line("identification", unit, fastest(lambda: told(0, soft, where)))
    known = where, gate, room
    line("clustering, all known", unit, fastest(lambda: chain.cluster(0, soft, *known)))
    none = [a[:0] for a in known]
    line("clustering, none known", unit, fastest(lambda: chain.cluster(0, soft, *none)))


def main() -> None:
    """Print both tables."""
    unit = fastest(kernel)
    print(f"calibration kernel {1e3 * unit:.1f} ms")
    recording, where = scene()
    scans = list(recording.scans())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "byhand.npz"
        weights.write(path, map_scene.classifier())
        for module in (phd, mbm):
            layers = ("preset", module.PRESETS["paper"]), ("here", {"weights": str(path)})
            params = resolve(module.Params, *sensor_model(recording, module.Params), *layers)
            context = module.context(recording.setup(), params)
            if module is phd:
                list(module.run(context, iter(scans)))
                parts(recording, where, context.source, unit)
                print("filter                          ms  ratio")
            seconds = fastest(lambda: list(module.run(context, iter(scans))))  # noqa: B023
            line(module.__name__.rpartition(".")[2], unit, seconds / SCANS)
            store = {t: context.source.fuse(t, [s for s in scans if s.time_ns == t])
                     for t in {s.time_ns for s in scans}}  # fmt: skip
            chain = replace(context.source, fuse=lambda t, _: store[t])  # noqa: B023
            shared = replace(context, source=chain)
            seconds = fastest(lambda: list(module.run(shared, iter(scans))))  # noqa: B023
            line("  soft maps from a store", unit, seconds / SCANS)


if __name__ == "__main__":
    main()
