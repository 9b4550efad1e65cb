"""Records as named leaves, which all formats hold, and the digests over them.

A leaf's *digest* is a text: its type, shape and the SHA-256 of its bytes. The *content digest* is
the SHA-256 over all paths and their digests, so that it covers datasets and attributes alike and
is the same in every format. The *observed digest* leaves out what no estimator may see. What each
leaf is stands in :mod:`echoset.models.columns`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..models.checks import NAME
from ..models.columns import COLUMNS, INTEGER, OBJECTS, TEXT, TEXTS, UNITS, VALUE, declared
from ..models.errors import FormatError
from ..models.records import Array, Estimates, Meta, Objects, Recording, Sensor, Stream, Truth
from .plain_json import json_object

FORMAT_VERSION = 1
CONVENTIONS = "ECHOSET-1.0"
Leaf = str | bool | int | float | tuple[str, ...] | Array
Leaves = Mapping[str, Leaf]

_TYPES: dict[str, tuple[type, ...]] = {
    TEXT: (str,),
    TEXTS: (tuple,),
    INTEGER: (int,),
    VALUE: (str, bool, int, float, np.ndarray),
}
_ARRAY = (np.ndarray,)


def of(record: Recording | Estimates) -> dict[str, Leaf]:
    """The leaves of ``record`` by path, in the order of the names.

    What is None or empty by design has no leaf.
    """
    return dict(sorted(_of(record).items(), key=lambda item: item[0].split("/")))


def _of(record: Recording | Estimates) -> dict[str, Any]:
    m = record.meta
    found: dict[str, Any] = {
        name: getattr(m, name) for name in ("name", "epoch", "frame", "origin")
    }
    found["provenance"] = json_of(m.provenance)
    if isinstance(record, Estimates):
        found["kind"] = "estimates"
        found |= _objects("objects", record.objects)
        found |= {f"steps/{name}": np.asarray(values) for name, values in record.steps.items()}
        if record.recording is not None:
            found |= {f"recording/{path}": v for path, v in _of(record.recording).items()}
        return found
    found["kind"] = "recording"
    for name, s in record.sensors.items():
        for field in ("kind", "object", "time_ns", "position", "quaternion"):
            found[f"sensors/{name}/{field}"] = getattr(s, field)
    for name, stream in record.streams.items():
        for field in ("kind", "nodes", "time_ns", "row_offset"):
            found[f"streams/{name}/{field}"] = getattr(stream, field)
        for group in ("model", "scan", "rows"):
            for key, value in getattr(stream, group).items():
                found[f"streams/{name}/{group}/{key}"] = (
                    _plain(value) if group == "model" else value
                )
    if record.truth is not None:
        t = record.truth
        found |= _objects("truth/objects", t.objects)
        links = {"time_ns": t.blocked_time_ns, "tx": t.blocked_tx, "rx": t.blocked_rx}
        found |= {f"truth/blocked/{name}": values for name, values in links.items()}
    return found


def _objects(group: str, o: Objects) -> dict[str, Any]:
    found = ((leaf, getattr(o, leaf.name)) for leaf in OBJECTS)
    return {
        f"{group}/{leaf.name}": value
        for leaf, value in found
        if not leaf.optional or isinstance(value, np.ndarray) or value
    }


def _plain(value: Any) -> Any:
    """Lists of numbers as arrays, NumPy's scalars as Python's."""
    if isinstance(value, list | tuple):
        return np.asarray(value, float)
    return value.item() if isinstance(value, np.generic) else value


def json_of(provenance: Mapping[str, Any]) -> str:
    """Plain data as canonical JSON."""
    return json.dumps(provenance, sort_keys=True, allow_nan=False)


def record(leaves: Leaves, path: object) -> Recording | Estimates:
    """The record that ``leaves`` make up.

    Raises
    ------
    FormatError : a leaf is missing, of another type or not known
    """
    for name, leaf in leaves.items():
        _verify(name, leaf, path)
    own = {p: v for p, v in leaves.items() if not p.startswith("recording/")}
    kind = own.get("kind")
    top = {"recording": ("sensors", "streams", "truth"), "estimates": ("objects", "steps")}
    if kind not in top:
        raise FormatError(path, "kind", f"{kind!r} is neither recording nor estimates")
    for name in own:
        if "/" in name and not name.startswith(top[str(kind)]):
            raise FormatError(path, name, f"has no place in a record of kind {kind!r}")
    try:
        texts = {name: str(own[name]) for name in ("name", "epoch", "frame", "origin")}
        meta = Meta(**texts, provenance=provenance(str(own["provenance"]), path))
        if kind == "estimates":
            beside = below(leaves, "recording")
            return Estimates(
                meta,
                Objects(**below(own, "objects")),
                below(own, "steps"),
                _recording(beside, path) if beside else None,
            )
        return Recording(
            meta,
            {name: Sensor(**fields) for name, fields in _each(own, "sensors", path).items()},
            {name: _stream(fields) for name, fields in _each(own, "streams", path).items()},
            _truth(own),
        )
    except KeyError as error:
        raise FormatError(path, str(error.args[0]), "is missing") from error
    except (TypeError, ValueError) as error:
        raise FormatError(path, "/", f"not an echoset record: {error}") from error


def provenance(text: str, path: object) -> dict[str, Any]:
    """The provenance that files hold as ``text``: a JSON object of plain data.

    Raises
    ------
    FormatError : it is none
    """
    try:
        return json_object(text, path)
    except FormatError as error:
        raise FormatError(path, "provenance", f"{error.reason} ({error.where})") from error


def _verify(name: str, leaf: Leaf, path: object) -> None:
    """Refuse a leaf that is not declared, or not as it is."""
    known = declared(name)
    if known is None:
        raise FormatError(path, name[:200], "has no place in a record")
    if type(leaf) not in _TYPES.get(known.type, _ARRAY) or getattr(leaf, "ndim", 1) == 0:
        wanted = known.type if known.type in _TYPES else "an array"
        raise FormatError(path, name[:200], f"is of type {type(leaf).__name__}, needs {wanted}")


def _recording(leaves: Leaves, path: object) -> Recording:
    found = record(leaves, path)
    if not isinstance(found, Recording):
        raise FormatError(path, "recording", "holds estimates inside estimates")
    return found


def below(leaves: Mapping[str, Any], group: str) -> dict[str, Any]:
    """The leaves of ``group``, by what their paths are in it."""
    start = f"{group}/"
    return {p[len(start) :]: v for p, v in leaves.items() if p.startswith(start)}


def _each(leaves: Leaves, group: str, where: object) -> dict[str, dict[str, Any]]:
    """The leaves of each named thing in ``group``."""
    found: dict[str, dict[str, Any]] = {}
    for path, leaf in below(leaves, group).items():
        name, _, rest = path.partition("/")
        if not NAME.fullmatch(name):
            raise FormatError(where, group, f"{name[:40]!r} is not a legal name")
        found.setdefault(name, {})[rest] = leaf
    return found


def _stream(fields: dict[str, Any]) -> Stream:
    groups: dict[str, Any] = {group: below(fields, group) for group in ("model", "scan", "rows")}
    own: dict[str, Any] = {p: v for p, v in fields.items() if "/" not in p}
    return Stream(**own, **groups)


def _truth(leaves: Leaves) -> Truth | None:
    objects, b = below(leaves, "truth/objects"), below(leaves, "truth/blocked")
    if not objects and not b:
        return None
    return Truth(Objects(**objects), b["time_ns"], b["tx"], b["rx"])


def attributes(path: str) -> dict[str, Any]:
    """The attributes of the dataset at ``path``: its CF unit, and what its column means."""
    *group, name = path.split("/")
    if group[-1:] not in (["rows"], ["scan"]) or name not in COLUMNS:
        return {"units": "s" if name == "time" else UNITS.get(name, "1")}
    column = COLUMNS[name]
    found: dict[str, Any] = {"units": column.unit, "long_name": column.long_name}
    if column.flags:
        found["flag_meanings"] = " ".join(column.flags)
        found["flag_values"] = ",".join(map(str, range(len(column.flags))))
    return found


def states(path: str, found: Mapping[str, Any]) -> bool:
    """Whether the dataset at ``path`` has its attributes.

    A file may know fewer codes than there are today: those that have come are behind them.
    """
    wanted = attributes(path)
    if "flag_meanings" in wanted:
        known = len(str(found.get("flag_meanings", "")).split())
        flags = COLUMNS[path.rpartition("/")[2]].flags[:known]
        wanted["flag_meanings"] = " ".join(flags)
        wanted["flag_values"] = ",".join(map(str, range(len(flags))))
    return dict(found) == wanted


def grows(path: str) -> bool:
    """Whether the leaf at ``path`` is an array of one value per scan, step or row."""
    known = declared(path)
    return known is not None and known.grows


def per_row(path: str) -> bool:
    """Whether the growing array at ``path`` has one value per row, not per scan or step."""
    known = declared(path)
    return known is not None and known.per_row


def table(path: str) -> str:
    """The group whose ``time_ns`` the growing array at ``path`` goes by."""
    top, *rest = path.split("/")
    if top == "recording":
        return f"recording/{table('/'.join(rest))}"
    return "objects" if top in ("objects", "steps") else f"{top}/{rest[0]}"


class ArrayDigest:
    """The digest of an array that arrives in parts along its first axis."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._dtype, self._tail, self._length = "", (), 0

    def update(self, part: Array) -> None:
        """Take in the next rows."""
        self._dtype, self._tail = part.dtype.newbyteorder("<").str, part.shape[1:]
        self._length += len(part)
        self._hash.update(np.ascontiguousarray(part, part.dtype.newbyteorder("<")).tobytes())

    def __str__(self) -> str:
        shape = ",".join(map(str, (self._length, *self._tail)))
        return f"{self._dtype}[{shape}]:{self._hash.hexdigest()}"


def digest_of(leaf: Leaf) -> str:
    """The digest of one leaf."""
    if isinstance(leaf, np.ndarray):
        whole = ArrayDigest()
        whole.update(leaf)
        return str(whole)
    value = list(leaf) if isinstance(leaf, tuple) else leaf
    return f"{type(leaf).__name__}:{json.dumps(value)}"


def digests(leaves: Leaves) -> dict[str, str]:
    """The digests of all leaves."""
    return {path: digest_of(leaf) for path, leaf in leaves.items()}


def digest(digests: Mapping[str, str]) -> str:
    """SHA-256 over paths and digests."""
    text = json.dumps(sorted(digests.items()))
    return hashlib.sha256(text.encode()).hexdigest()


def observed(paths: Iterable[str]) -> list[str]:
    """Those paths of a recording that an estimator may see."""
    return [p for p in paths if (known := declared(p)) is None or not known.hidden]


def header(digests: Mapping[str, str]) -> dict[str, Any]:
    """What a file with leaves of these digests says of itself.

    The observed digest is empty for all but recordings.
    """
    seen = ""
    if digests.get("kind") == digest_of("recording"):
        seen = digest({p: digests[p] for p in observed(digests)})
    return {
        "Conventions": CONVENTIONS,
        "format_version": FORMAT_VERSION,
        "content_digest": digest(digests),
        "observed_digest": seen,
    }


def observed_digest(record: Recording) -> str:
    """Digest of what an estimator may see of ``record``: equal with and without its truth."""
    return str(header(digests(_of(record)))["observed_digest"])


def content_digest(record: Recording | Estimates) -> str:
    """Digest of all that ``record`` holds."""
    return digest(digests(_of(record)))
