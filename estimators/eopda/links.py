"""The links of a UWB network as estimators see them: who hears whom, and how well.

Nodes become indices: anchors 0 ... J - 1 and J for the device that is tracked.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ...models.columns import ACTIVE, PASSIVE
from ...models.errors import InputError
from ...models.geometry.poses import pose_at
from ...models.records import Array, Recording, Scan, Sensor
from ...models.uwb import range_std


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """Anchors of a stream and the noise of its ranges.

    ``stream`` is its name, ``sensors`` are its J anchors; ``index`` maps the nodes of the stream to
    0 ... J, other devices to -1. ``rms_bandwidth`` [Hz], ``amplitude_threshold``, ``sigma`` [m] and
    ``sigma_factor`` serve to find the standard deviation of a range, see :func:`link_steps`;
    ``range_bias`` [m] is taken off all ranges.
    """

    name: str
    stream: str
    sensors: tuple[Sensor, ...]
    index: Array
    rms_bandwidth: float | None
    amplitude_threshold: float
    sigma: float | None
    sigma_factor: float
    range_bias: float

    def anchors(self, time_ns: int) -> Array:
        """Positions (J, 3) [m] of the anchors at a time."""
        still = [len(s.time_ns) == 1 for s in self.sensors]
        if all(still):
            return np.array([s.position[0] for s in self.sensors])
        return np.array([pose_at(s, time_ns)[0] for s in self.sensors])

    @property
    def has_heights(self) -> bool:
        """Whether any anchor stands above or below the plane."""
        return any(s.position[:, 2].any() for s in self.sensors)


class Links(NamedTuple):
    """Link events of one time and mode, in order of receivers; fields as the kernels take them.

    ``tx`` (L,) is J for the device, ``rx`` (L,), ``offset`` (L + 1,) into ``z`` (M,) [m] and
    ``variance`` (M,) [m^2]. Of differences (TDOA) ``tx`` is the anchor that is taken off.
    """

    tx: Array
    rx: Array
    offset: Array
    z: Array
    variance: Array

    @property
    def empty(self) -> bool:
        """Whether there is no event."""
        return len(self.tx) == 0


NO_LINKS = Links(
    np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0), np.zeros(0)
)


def network(
    setup: Recording,
    device: str | None,
    rms_bandwidth: float | None,
    amplitude_threshold: float,
    sigma: float | None,
    sigma_factor: float = 1.0,
    range_bias: float = 0.0,
) -> Network:
    """The one UWB network of a recording, with the device to track.

    Raises
    ------
    InputError : no UWB stream or several, no anchor, no such device, or several and none chosen
    """
    streams = {name: s for name, s in setup.streams.items() if s.kind == "uwb"}
    if len(streams) != 1:
        raise InputError(f"{setup.meta.name}: needs one UWB stream, has {len(streams)}")
    ((name, stream),) = streams.items()
    kinds = [setup.sensors[node].kind for node in stream.nodes]
    anchors = [node for node, kind in zip(stream.nodes, kinds, strict=True) if kind == "anchor"]
    devices = [node for node, kind in zip(stream.nodes, kinds, strict=True) if kind == "device"]
    if not anchors:
        raise InputError(f"{setup.meta.name}: anchors missing in stream {name!r}")
    if device is not None and device not in devices:
        raise InputError(f"{setup.meta.name}: no device {device!r}, has {' '.join(devices)}")
    if device is None and len(devices) > 1:
        raise InputError(
            f"{setup.meta.name}: has {len(devices)} devices, choose one of "
            f"{' '.join(devices)} by --set device=..., or locate a body that carries them: "
            "range-ls with 'tags'"
        )
    tracked = device or (devices[0] if devices else None)
    rank = {node: j for j, node in enumerate(anchors)}
    index = [len(anchors) if n == tracked else rank.get(n, -1) for n in stream.nodes]
    sensors = tuple(setup.sensors[a] for a in anchors)
    noise = rms_bandwidth, amplitude_threshold, sigma, sigma_factor, range_bias
    return Network(setup.meta.name, name, sensors, np.array(index), *noise)


def link_steps(
    net: Network, scans: Iterable[Scan]
) -> Iterator[tuple[int, tuple[Links, Links, Links]]]:
    """Each time [ns] with its active and passive links and its differences, one time in memory.

    The standard deviation of a range follows from its amplitude (not below the threshold) by
    Fisher information; without amplitudes it is the column ``std``, without that ``sigma``; in any
    case times ``sigma_factor``.

    Raises
    ------
    InputError : nothing tells the standard deviation, or it is not positive
    """
    own = (scan for scan in scans if scan.stream == net.stream)
    for time_ns, events in groupby(own, lambda scan: scan.time_ns):
        active: list[Scan] = []
        passive: list[Scan] = []
        differences: list[Scan] = []
        for scan in events:
            if scan.scan["mode"] == PASSIVE:
                passive.append(scan)
            elif net.index[scan.scan["tx"]] >= 0:
                (active if scan.scan["mode"] == ACTIVE else differences).append(scan)
        yield time_ns, (_links(net, active), _links(net, passive), _links(net, differences, True))


def _links(net: Network, scans: list[Scan], differences: bool = False) -> Links:
    """The links of one kind; differences are in order of what is taken off."""
    first, last = ("reference", "rx") if differences else ("rx", "tx")
    scans = sorted(scans, key=lambda s: (net.index[s.scan[first]], net.index[s.scan[last]]))
    ends = ("reference", "rx") if differences else ("tx", "rx")
    tx, rx = (np.array([net.index[s.scan[k]] for s in scans], np.int64) for k in ends)
    bias = 0.0 if differences else net.range_bias
    z = [np.asarray(s.rows["distance"], float) - bias for s in scans]
    offset = np.concatenate(([0], np.cumsum([len(d) for d in z]))).astype(np.int64)
    std = [net.sigma_factor * _std(net, s) for s in scans]
    none = np.zeros(0)
    return Links(tx, rx, offset, np.concatenate((none, *z)), np.concatenate((none, *std)) ** 2)


def _std(net: Network, scan: Scan) -> Array:
    rows = scan.rows
    if "amplitude" in rows:
        if net.rms_bandwidth is None:
            raise InputError("ranges have amplitudes, yet no 'rms_bandwidth' is known: set it")
        amplitude = np.maximum(rows["amplitude"], net.amplitude_threshold)
        return np.asarray(range_std(amplitude, net.rms_bandwidth))
    if "std" in rows:
        if not (rows["std"] > 0).all():
            raise InputError(f"'std' must be positive at {scan.time_ns} ns")
        return np.asarray(rows["std"])
    if net.sigma is None:
        raise InputError("ranges have neither amplitude nor std: set 'sigma' [m]")
    return np.full(len(rows["distance"]), net.sigma)
