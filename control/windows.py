"""Windows of soft maps about targets whose class is known: what the classifier learns from.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section III-A:
the true position is displaced at random, as that of a filter would be. Every scene has
trajectories of its own and only a few scans, far apart; of the stations a random number takes part,
so that one network serves any number.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..estimators.maps.kernels.cnn import windows
from ..estimators.maps.kernels.fusion import Pixels
from ..estimators.maps.stations import Station, fuse
from ..models.classifier import CELL
from ..models.names import natural
from ..models.random import generator
from ..models.records import Array, Recording
from ..simulate import jsc


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Powers (n, 60, 60), the class (n,) of the target in their middle, and whence they are.

    ``stations`` (n,) is how many stations were fused, ``scene`` (n,) the number of the scene.
    """

    power: Array
    kind: Array
    stations: Array
    scene: Array

    @property
    def sha256(self) -> str:
        """SHA-256 of all four, in hexadecimal digits: what was learnt from, wherever it is made."""
        digest = hashlib.sha256()
        for column in (self.power, self.kind, self.stations, self.scene):
            digest.update(np.ascontiguousarray(column).data)
        return digest.hexdigest()


def join(parts: Iterable[Windows]) -> Windows:
    """The windows of all parts."""
    columns = zip(*((p.power, p.kind, p.stations, p.scene) for p in parts), strict=True)
    return Windows(*map(np.concatenate, columns))


def scenes(
    params: jsc.Params,
    numbers: Iterable[int],
    seed: int,
    stage: str,
    scans: int,
    displacement: float,
    eirp: tuple[float, float] | None = None,
    circle: tuple[float, float] = (1.0, 1.0),
) -> Iterator[Windows]:
    """The windows of scenes: for each target and scan one, displaced by ``displacement`` [m].

    Stations of a scene have a power in ``eirp`` [dBm] (None: that of ``params``), and stand a share
    in ``circle`` of their distances from the middle of the area, both uniform.
    ``stage`` keys the random streams, so that scenes to train on and to test on differ.
    """
    spread = params.scans * params.dt / scans
    sparse = replace(params, scans=scans, dt=spread)
    for number in numbers:
        name = f"scene-{number}"
        rng = generator(seed, stage, name)
        recording = jsc.simulate(_varied(sparse, eirp, circle, rng), rng, name)
        yield _windows(recording, params.area, number, displacement, rng)


def _varied(
    params: jsc.Params,
    eirp: tuple[float, float] | None,
    circle: tuple[float, float],
    rng: np.random.Generator,
) -> jsc.Params:
    """The scene with the power and the layout drawn."""
    if eirp is not None:
        params = replace(params, eirp=float(rng.uniform(*eirp)))
    if circle == (1.0, 1.0):
        return params
    share = float(rng.uniform(*circle))
    if not params.stations:
        return replace(params, station_radius=share * params.station_radius)
    x0, x1, y0, y1 = params.area
    x, y = (x0 + x1) / 2, (y0 + y1) / 2
    there = tuple((x + share * (a - x), y + share * (b - y), yaw) for a, b, yaw in params.stations)
    return replace(params, stations=there)


def _windows(
    recording: Recording,
    area: tuple[float, ...],
    number: int,
    displacement: float,
    rng: np.random.Generator,
) -> Windows:
    pixels = Pixels.of(area, CELL)
    streams = recording.streams
    stations = {
        name: Station.of(recording.sensors[name], stream.model, pixels)
        for name, stream in streams.items()
    }
    assert recording.truth is not None
    truth = recording.truth.objects
    assert truth.class_index is not None
    scans = [
        list(stream.scans(name))
        for name, stream in sorted(streams.items(), key=lambda item: natural(item[0]))
    ]
    power, kind, count = [], [], []
    for k, t in enumerate(truth.time_ns.tolist()):
        here = slice(truth.row_offset[k], truth.row_offset[k + 1])
        where, kinds = truth.columns("x", "y")[here], truth.class_index[here]
        several = rng.permutation(np.resize(np.arange(1, len(scans) + 1), len(where)))
        where = where + rng.normal(scale=displacement, size=where.shape)
        for n in np.unique(several):
            chosen = several == n
            soft = fuse(stations, pixels, t, [scan[k] for scan in scans[:n]])
            power.append(windows(soft, where[chosen], pixels))
            kind.append(kinds[chosen])
            count.append(several[chosen])
    scene = np.full(sum(map(len, kind)), number)
    return Windows(np.concatenate(power), np.concatenate(kind), np.concatenate(count), scene)
