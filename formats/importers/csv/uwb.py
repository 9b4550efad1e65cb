"""Tables of UWB ranges as the link events of a stream."""

from __future__ import annotations

import numpy as np

from ....models.columns import ACTIVE, PASSIVE, TDOA
from ....models.errors import ParameterError
from ....models.records import Array, Sensor, Stream
from ..rows import pad, to_stream
from . import plausible
from .log import Log
from .mapping import Mapping, Tables
from .poses import anchors

Built = tuple[dict[str, Sensor], dict[str, Stream]]


def uwb(mapping: Mapping, table: Log, F: Array, tables: Tables, carried: bool, name: str) -> Built:
    """The nodes and the stream ``name`` of the link events in ``table``.

    The only device of a log is ``carried`` by the true object 0, if the truth tells devices.
    """
    fixed = anchors(mapping.anchors, F, tables)
    if not fixed:
        raise ParameterError("mapping: anchors are missing")
    links = ("anchor", "device", "tx", "rx")
    parts = [table]
    if mapping.scans is not None:
        parts.append(tables.read(mapping.scans, ("time",), links, "scans"))
    devices = dict(mapping.devices)
    for part in parts:
        if "anchor" in part and "device" in part:
            devices |= {d: -1 for d in sorted(set(part.columns["device"])) if d not in devices}
        elif "anchor" in part and not devices:
            devices["device"] = -1
    if carried and len(devices) == 1 and not mapping.devices:
        devices = dict.fromkeys(devices, 0)
    for node in devices:
        if node in fixed:
            reason = f"{node!r} is an anchor and a device: tell them apart by 'rename', such as"
            raise ParameterError(f"mapping: {reason} rename: {{device: {{{node}: tag}}}}")
    sensors = {name: Sensor.device(label) for name, label in devices.items()} | fixed
    nodes = tuple(sensors)
    ends = [_ends(part, nodes, len(devices)) for part in parts]
    tx, rx = (np.concatenate(column) for column in zip(*ends, strict=True))
    differences = "reference" in table
    if differences and len(parts) > 1:
        raise ParameterError("mapping: differences (reference) and scans do not go together")
    others = [key for key in ("amplitude", "std") if key in table]
    rows, detected = pad(*table.detections(["distance"], others), len(tx) - len(table))
    if not differences:
        table.refuse("distance", rows["distance"][: len(table)] < 0, "is negative")
    own = table.time()
    table.check_shared(own)
    plausible.rows(table, own)
    n = len(table)
    plausible.links(table, own, tx[:n] * len(nodes) + rx[:n], rows["distance"][:n])
    mode = np.where(tx < len(devices), ACTIVE, PASSIVE).astype(np.uint8)
    if differences:
        table.refuse("reference", tx >= len(devices), "is told, yet an anchor sends")
        mode = np.full(len(tx), TDOA, np.uint8)
    time = np.concatenate([own, *(part.time() for part in parts[1:])])
    keys = {"mode": mode, "rx": rx, "tx": tx}
    if differences:
        of = table.index("reference", nodes[len(devices) :]) + np.int32(len(devices))
        table.refuse("reference", of == rx, "is the anchor itself")
        keys["reference"] = of
    stream = to_stream("uwb", nodes, mapping.model, time, keys, rows, detected)
    plausible.geometry(table.path, stream, sensors)
    return sensors, {name: stream}


def _ends(table: Log, nodes: tuple[str, ...], n_devices: int) -> tuple[Array, Array]:
    """Indices of transmitter and receiver of every row."""
    given = [key for key in ("anchor", "device", "tx", "rx") if key in table]
    if given not in (["anchor"], ["anchor", "device"], ["tx", "rx"]):
        name = table.path.name
        raise ParameterError(f"{name}: columns need either anchor (and device), or tx and rx")
    if "anchor" in table:
        rx = table.index("anchor", nodes[n_devices:]) + np.int32(n_devices)
        if "device" in table:
            return table.index("device", nodes[:n_devices]), rx
        if n_devices > 1:
            raise ParameterError("mapping: several devices need the column 'device'")
        return np.zeros(len(table), np.int32), rx
    tx, rx = table.index("tx", nodes), table.index("rx", nodes)
    table.refuse("rx", rx < n_devices, "receives, yet is no anchor")
    return tx, rx
