"""Contents of a file, without reading all of it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePath
from typing import Any

from .. import formats
from ..formats import foreign, weights
from ..formats import scores as tables
from ..models.names import printable
from .files.inputs import SCORES, label, spooled

WEIGHTS = ".npz"
"""The suffix of weights of a classifier, unless it is that of a format."""


def inspect(file: str) -> dict[str, Any]:
    """Header and shapes by path; of scores, the names in them."""
    listed = foreign.listing(file)
    if listed is not None:
        return listed
    with spooled(file) as path:
        if PurePath(file).suffix == WEIGHTS and not formats.suffix_format(Path(file), ""):
            made = weights.read(path).made
            return {"kind": "weights", "sha256": weights.sha256(path), "made": made}
        if PurePath(file).suffix not in SCORES:
            found = formats.summary(path)
            if found["kind"] != "scores":
                provenance = {k: json.loads(v) for k, v in found.items() if _is_provenance(k)}
                return {**found, **provenance}
        scores = tables.read(path, label(file))
    columns = ("recording", "estimator", "metric", "part")
    names = {f"{c}s": list(dict.fromkeys(filter(None, getattr(scores, c)))) for c in columns}
    return {"kind": "scores", "rows": len(scores), **names, "provenance": scores.provenance}


def _is_provenance(path: str) -> bool:
    return path.rpartition("/")[2] == "provenance"


def lines(found: Mapping[str, Any]) -> Iterator[str]:
    """The result of :func:`inspect` for the file ``found["file"]`` as text."""
    yield f"{printable(found['file'])}: {found['kind']}"
    shapes: Mapping[str, tuple[int, ...]] = found.get("shapes", {})
    for path, shape in sorted(shapes.items()):
        if path.endswith("/time_ns") and "sensors/" not in path:
            yield _entry(path.removesuffix("/time_ns"), _table(path, shape[0], found, shapes))
    sensors = {k.split("/")[1]: v for k, v in found.items() if _is_sensor_kind(k)}
    if sensors:
        yield _entry("sensors", ", ".join(f"{name} ({kind})" for name, kind in sensors.items()))
    for topic, about in found.get("topics", {}).items():
        rate = f", {about['rate']:g} a second" if about["rate"] is not None else ""
        yield _entry(topic, f"{about['type']}, {about['messages']} messages{rate}: {about['use']}")
    for key in ("rows", "recordings", "estimators", "metrics", "parts"):
        if key in found:
            value = found[key]
            yield _entry(key, " ".join(value) if isinstance(value, list) else str(value))
    for key in ("name", "epoch", "frame", "origin", "observed_digest", "content_digest"):
        if found.get(key):
            yield _entry(key.replace("_", " "), str(found[key]))
    if found["kind"] == "weights":
        yield _entry("sha256", found["sha256"])
        for key, value in found["made"].items():
            yield _entry(key, json.dumps(value))
        if not found["made"]:
            yield _entry("made", "nobody has said how")
    for path in sorted(filter(_is_provenance, found)):
        for key, value in sorted(found[path].items()):
            yield _entry(f"{path.removesuffix('provenance')}{key}", json.dumps(value))


def _is_sensor_kind(path: str) -> bool:
    return path.startswith("sensors/") and path.endswith("/kind")


def _table(
    path: str, times: int, found: Mapping[str, Any], shapes: Mapping[str, tuple[int, ...]]
) -> str:
    """How many times and rows the table has whose times are at ``path``."""
    group = path.removesuffix("time_ns")
    rows = next((s[0] for p, s in shapes.items() if p.startswith(f"{group}rows/")), None)
    rows = shapes.get(f"{group}label", (rows,))[0]
    kind = f"{found[f'{group}kind']}, " if f"{group}kind" in found else ""
    empty = found.get("empty", {}).get(group[:-1], 0) if rows is not None else 0
    text = f"{kind}{times} times" + (f" ({empty} empty)" if empty else "")
    text += f", {rows} rows" if rows is not None else ""
    below = f"{group}rows/", f"{group}scan/"
    columns = [p.rpartition("/")[2] for p in shapes if p.startswith(below)]
    radar = found.get(f"{group}kind") in ("position", "range_bearing", "range_angle_map")
    return f"{text}: {' '.join(columns)}" if columns and radar else text


def _entry(name: str, text: str) -> str:
    return f"  {printable(name):<16} {printable(text)}"
