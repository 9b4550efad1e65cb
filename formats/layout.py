"""Records to trees and back: the one place that names what files hold."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..models.checks import NAME
from ..models.columns import COLUMNS
from ..models.errors import FormatError
from ..models.records import Estimates, Meta, Objects, Recording, Sensor, Stream, Truth
from . import tree as trees
from .tree import Tree

FORMAT_VERSION = 1
CONVENTIONS = "ECHOSET-1.0"
_UNITS = {
    "time_ns": "ns",
    "time": "s",
    "position": "m",
    "semi_axes": "m",
    "rotation": "rad",
    "tx": "1",
    "rx": "1",
}


def unit(path: str) -> str:
    """CF unit of the array at ``path``; ``state`` and ``covariance`` have one per column."""
    *group, name = path.split("/")
    if group[-1:] in (["rows"], ["scan"]) and name in COLUMNS:
        return COLUMNS[name].unit
    if name in ("state", "covariance"):
        return "see state_units"
    return _UNITS.get(name, "1")


def attributes(path: str) -> dict[str, Any]:
    """The attributes of the dataset at ``path``."""
    attributes: dict[str, Any] = {"units": unit(path)}
    *group, name = path.split("/")
    if group[-1:] in (["rows"], ["scan"]) and name in COLUMNS:
        column = COLUMNS[name]
        attributes["long_name"] = column.long_name
        if column.flags:
            attributes["flag_meanings"] = " ".join(column.flags)
            attributes["flag_values"] = ",".join(map(str, range(len(column.flags))))
    return attributes


def to_tree(record: Recording | Estimates) -> Tree:
    """The record as a tree. What is None or empty by design has no leaf."""
    kind = "recording" if isinstance(record, Recording) else "estimates"
    m = record.meta
    tree: Tree = {
        "kind": kind,
        "name": m.name,
        "epoch": m.epoch,
        "frame": m.frame,
        "origin": m.origin,
        "provenance": provenance(m),
    }
    if isinstance(record, Estimates):
        tree["objects"] = objects_to_tree(record.objects)
        tree["steps"] = {k: np.asarray(v) for k, v in record.steps.items()}
        if record.recording is not None:
            tree["recording"] = to_tree(record.recording)
        return tree
    tree["sensors"] = {
        name: {
            "kind": s.kind,
            "object": s.object,
            "time_ns": s.time_ns,
            "position": s.position,
            "quaternion": s.quaternion,
        }
        for name, s in record.sensors.items()
    }
    tree["streams"] = {name: stream_to_tree(s) for name, s in record.streams.items()}
    if record.truth is not None:
        t = record.truth
        tree["truth"] = {
            "objects": objects_to_tree(t.objects),
            "blocked": {"time_ns": t.blocked_time_ns, "tx": t.blocked_tx, "rx": t.blocked_rx},
        }
    return tree


def provenance(meta: Meta) -> str:
    """Provenance as files hold it."""
    return json_of(meta.provenance)


def json_of(provenance: Mapping[str, Any]) -> str:
    """Plain data as canonical JSON."""
    return json.dumps(provenance, sort_keys=True, allow_nan=False)


def stream_to_tree(s: Stream) -> Tree:
    """A stream as a tree; lists in its model become arrays."""
    return {
        "kind": s.kind,
        "nodes": s.nodes,
        "model": {k: _plain(v) for k, v in s.model.items()},
        "time_ns": s.time_ns,
        "row_offset": s.row_offset,
        "scan": dict(s.scan),
        "rows": dict(s.rows),
    }


def _plain(value: Any) -> Any:
    """Lists of numbers as arrays, NumPy's scalars as Python's."""
    if isinstance(value, list | tuple):
        return np.asarray(value, float)
    return value.item() if isinstance(value, np.generic) else value


_OPTIONAL = ("covariance", "existence", "class_index", "class_probability", "semi_axes", "rotation")


def objects_to_tree(o: Objects) -> Tree:
    """Objects as a tree."""
    tree: Tree = {
        "time_ns": o.time_ns,
        "row_offset": o.row_offset,
        "label": o.label,
        "state_names": o.state_names,
        "state_units": o.state_units,
        "state": o.state,
    }
    tree |= {k: getattr(o, k) for k in _OPTIONAL if getattr(o, k) is not None}
    if o.class_names:
        tree["class_names"] = o.class_names
    if o.extent_kind:
        tree["extent_kind"] = o.extent_kind
    return tree


def from_tree(tree: Mapping[str, Any], path: object) -> Recording | Estimates:
    """The record that ``tree`` holds.

    Raises
    ------
    FormatError : a leaf is missing, of another type or not known
    """
    try:
        return _from_tree(dict(tree), path)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(path, "", f"not an echoset record: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    return f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)


def _from_tree(tree: Tree, path: object) -> Recording | Estimates:
    kind = tree.pop("kind")
    texts = {k: _text(tree.pop(k), k) for k in ("name", "epoch", "frame", "origin")}
    meta = Meta(**texts, provenance=json.loads(tree.pop("provenance")))
    record: Recording | Estimates
    if kind == "estimates":
        carried = tree.pop("recording", None)
        recording = None if carried is None else from_tree(carried, path)
        if isinstance(recording, Estimates):
            raise ValueError("estimates inside estimates")
        objects = objects_from_tree(tree.pop("objects"))
        record = Estimates(meta, objects, tree.pop("steps", {}), recording)
    elif kind == "recording":
        sensors = {_name(k): Sensor(**v) for k, v in tree.pop("sensors", {}).items()}
        streams = {_name(k): stream_from_tree(v) for k, v in tree.pop("streams", {}).items()}
        truth = tree.pop("truth", None)
        record = Recording(meta, sensors, streams)
        if truth is not None:
            b = truth["blocked"]
            objects = objects_from_tree(truth["objects"])
            record = replace(record, truth=Truth(objects, b["time_ns"], b["tx"], b["rx"]))
    else:
        raise ValueError(f"kind {kind!r}")
    if tree:
        raise ValueError(f"{', '.join(map(repr, tree))} has no place in {kind}")
    return record


def _text(value: object, name: str) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{name} is not text")
    return value


def _name(name: str) -> str:
    if not NAME.fullmatch(name):
        raise ValueError(f"{name!r} is not a legal name")
    return name


def stream_from_tree(tree: Mapping[str, Any]) -> Stream:
    """The stream that ``tree`` holds; an empty group has no leaf and may be absent."""
    return Stream(**{"model": {}, "scan": {}, "rows": {}, **tree})


def objects_from_tree(tree: Mapping[str, Any]) -> Objects:
    """The objects that ``tree`` holds."""
    return Objects(**tree)


def grows(path: str) -> bool:
    """Whether the array at ``path`` has one value per scan, step or row."""
    top, *rest = path.split("/")
    if top == "recording":
        return grows("/".join(rest))
    if top == "streams":
        return rest[1] in ("time_ns", "row_offset", "scan", "rows")
    return top in ("truth", "objects", "steps")


def table(path: str) -> str:
    """The group whose ``time_ns`` the growing array at ``path`` goes by."""
    top, *rest = path.split("/")
    if top == "recording":
        return f"recording/{table('/'.join(rest))}"
    return "objects" if top in ("objects", "steps") else f"{top}/{rest[0]}"


def per_row(path: str) -> bool:
    """Whether the growing array at ``path`` has one value per row, not per scan or step."""
    *group, name = path.removeprefix("recording/").split("/")
    if group[0] == "streams":
        return group[-1] == "rows"
    return group[-1] == "objects" and name not in ("time_ns", "row_offset")


def observed_digest(record: Recording) -> str:
    """Digest of what an estimator may see of ``record``: equal with and without its truth."""
    leaves = trees.flatten(to_tree(record.observed()))
    return trees.digest(trees.tokens({p: leaves[p] for p in trees.observed(leaves)}))


def content_digest(record: Recording | Estimates) -> str:
    """Digest of all that ``record`` holds."""
    return trees.digest(trees.tokens(trees.flatten(to_tree(record))))
