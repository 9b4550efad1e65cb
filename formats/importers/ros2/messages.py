"""Messages of any type as a table of text, which a mapping describes as it does a log.

A path such as ``pose.position.x`` or ``ranges[].distance`` is the name of a column; a message with
a list makes a row for each of its elements. The column ``time`` is that of the message in seconds.
"""

from __future__ import annotations

import csv as text
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....models.errors import ParameterError
from ....models.parameters import suggestion
from ....models.records import Recording
from ..csv import importer as csv
from ..text import TextFile
from .bag import Bag, stamp

_LONGEST = 10_000_000
"""Rows of a table, which is held whole."""


def described(bag: Bag, content: Mapping[str, Any], folder: Path | None, time: str) -> Recording:
    """The recording that a mapping makes of the messages in a bag; ``time``: header or log."""
    streams = content.get("streams")
    if isinstance(streams, Mapping) and len(streams) == 1:
        (own,) = streams.values()
        common = {key: value for key, value in content.items() if key != "streams"}
        content = {**common, **own} if isinstance(own, Mapping) else content
    files: dict[Path, TextFile] = {}
    said = _filed(content, bag, time, files)
    if "file" not in said and "streams" not in said:
        raise ParameterError("mapping: 'topic' is missing")
    first = Path(said.pop("file")) if "file" in said else next(iter(files), bag.path)
    found = csv.build(said, folder or bag.path.parent, first, files, "ros2")
    provenance = {**found.meta.provenance, "files": bag.provenance}
    provenance["parameters"] = {"mapping": dict(content), "time": time}
    return replace(found, meta=replace(found.meta, name=bag.path.stem, provenance=provenance))


def _filed(value: Any, bag: Bag, time: str, files: dict[Path, TextFile]) -> Any:
    """``value`` with a file for each topic in it."""
    if isinstance(value, list):
        return [_filed(v, bag, time, files) for v in value]
    if not isinstance(value, Mapping):
        return value
    made = {k: _filed(v, bag, time, files) for k, v in value.items() if k != "topic"}
    if "topic" in value:
        topic = str(value["topic"])
        if topic not in bag.topics:
            raise ParameterError(f"the bag has no topic {topic!r}{suggestion(topic, bag.topics)}")
        named = {*_paths(value.get("columns", {})), *_quoted(value.get("skip", ""))}
        paths = sorted(named - {"time"})
        place = Path("/", topic.strip("/"), *(["#"] if Path("/", topic) in files else []))
        files[place] = _table(bag, topic, paths, time, place)
        made["file"] = str(place)
    return made


def _paths(columns: Any) -> Iterator[str]:
    """The paths that the ``columns`` of a mapping speak of."""
    if isinstance(columns, str):
        yield columns
    elif isinstance(columns, Mapping):
        for key, value in columns.items():
            if key in ("unit", "scale", "value", "format", "zone", "date", "rate", "bits"):
                continue
            yield from _paths(value)
    elif isinstance(columns, list):
        for value in columns:
            yield from _paths(value)


def _quoted(skip: Any) -> list[str]:
    """The paths that stand in the conditions of a mapping, between backticks."""
    texts = [skip] if isinstance(skip, str) else skip if isinstance(skip, list) else []
    return [path for text in texts for path in re.findall(r"`([^`]+)`", str(text))]


def _table(bag: Bag, topic: str, paths: Sequence[str], time: str, place: Path) -> TextFile:
    kind = bag.topics[topic].type
    if not bag.knows(bag.topics[topic]):
        reason = "tell its .msg file by definitions="
        raise ParameterError(f"{topic}: the type {kind} is not defined in the bag: {reason}")
    out = io.StringIO()
    writer = text.writer(out, lineterminator="\n")
    writer.writerow(["time", *paths])
    rows = 0
    for _, log, message in bag.messages({topic}):
        at = stamp(message, log, time)
        told = f"{at // 10**9}.{at % 10**9:09d}"
        values = [_values(message, path, f"{topic} ({kind})") for path in paths]
        many = [v for v in values if isinstance(v, list)]
        if len({len(v) for v in many}) > 1:
            raise ParameterError(f"{topic}: the lists of its columns are of unlike lengths")
        for k in range(len(many[0]) if many else 1):
            row = [v[k] if isinstance(v, list) else v for v in values]
            writer.writerow([told, *map(_text, row)])
            rows += 1
        if rows > _LONGEST:
            raise ParameterError(f"{topic}: more than {_LONGEST} rows")
    return TextFile(place, out.getvalue(), "")


def _values(message: Any, path: str, where: str) -> Any:
    """What stands at a path; a list where the path leads through one."""
    at: Any = message
    parts = path.split(".")
    for k, part in enumerate(parts):
        name = part.removesuffix("[]")
        if not hasattr(at, name):
            fields = [f for f in getattr(at, "__dataclass_fields__", ()) if f[0] != "_"]
            hint = suggestion(name, fields) or f": there are {', '.join(fields)}"
            raise ParameterError(f"{where} has no {path!r}{hint}")
        at = getattr(at, name)
        if part.endswith("[]"):
            rest = ".".join(parts[k + 1 :])
            return [_values(item, rest, where) if rest else item for item in at]
    return at


def _text(value: Any) -> str:
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float):
        return repr(value) if value == value and abs(value) != float("inf") else ""
    if not isinstance(value, str | int):
        raise ParameterError(f"{type(value).__name__} is neither a number nor a text")
    return " ".join(str(value).split())
