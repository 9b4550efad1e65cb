"""The readers that are fuzzed: how each reads a file, and what it may make of a changed one."""

from __future__ import annotations

import csv as csv_module
import json
import math
import re
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import fuzz_corpus as corpus
import yaml
from fuzz_corpus import Files

from echoset import formats
from echoset.campaign.layers import load as load_config
from echoset.campaign.scenarios import find
from echoset.formats import leaves, weights
from echoset.formats import scores as score_files
from echoset.formats.importers import autoferry, labyrinth
from echoset.formats.importers.csv import importer as csv
from echoset.formats.importers.csv import mapping
from echoset.models.errors import FormatError, ParameterError
from echoset.models.parameters import resolve
from echoset.models.records import Estimates, Recording

Read = Callable[[list[Path]], Any]


@dataclass(frozen=True)
class Target:
    """A reader: its corpus, how it reads, and of which kind its changes are.

    ``content`` of what is read must not differ from that of the sound input, where it is given;
    what ``broken`` finds must be refused. ``refusal`` is the error that a refusal is.
    """

    corpus: Callable[[], tuple[Files, ...]]
    read: Read
    kind: str
    content: Callable[[Any], object] | None = None
    broken: Callable[[str, Files], bool] | None = None
    refusal: type[Exception] = FormatError


def digest(record: Recording | Estimates) -> str:
    """The content digest of a record, found anew."""
    return leaves.content_digest(record)


def _record(paths: list[Path]) -> Recording | Estimates:
    """Read whole; every fourth input also scan by scan and in windows, which must agree."""
    path = paths[0]
    also = zlib.crc32(path.read_bytes()) % 4 == 0
    try:
        record = formats.read(path)
    except FormatError:
        if also:
            _tried(lambda: _scans(path))
            _tried(lambda: list(_windows(path)))
            _tried(lambda: formats.header(path))
        raise
    if also:
        assert formats.header(path)["content_digest"] == digest(record)
        if isinstance(record, Recording):
            assert _scans(path) == sum(map(len, record.streams.values()))
        alone = replace(record, recording=None) if isinstance(record, Estimates) else record
        (window,) = _windows(path)
        assert digest(window) == digest(alone)
    return record


def _scores_h5(paths: list[Path]) -> Any:
    _tried(lambda: formats.header(paths[0]))
    return score_files.read(paths[0])


def _tried(read: Callable[[], object]) -> None:
    """Read in a way that may pass, as it may leave out what is damaged: scans know no truth."""
    with suppress(FormatError):
        read()


def _scans(path: Path) -> int:
    with closing(formats.open_source(path)) as source:
        return sum(1 for _ in source.scans())


def _windows(path: Path) -> Iterator[Recording | Estimates]:
    with closing(formats.open_windows(path)) as parts:
        yield from parts


def _table(scores: Any) -> object:
    names = ("recording", "estimator", "metric", "part")
    numbers = (getattr(scores, n).tobytes() for n in ("time", "value", "n", "stderr"))
    return [*(getattr(scores, n) for n in names), *numbers, json.dumps(dict(scores.provenance))]


def _csv(paths: list[Path]) -> Recording:
    return csv.read(paths[:1], csv.Params(json.loads(paths[1].read_text())))


def _scenario(paths: list[Path]) -> Any:
    found = find(str(paths[0]))
    return resolve(found.module.Params, *found.layers)


def _mapping(paths: list[Path]) -> Any:
    return mapping.Mapping.of(mapping.load(str(paths[0]))[0], paths[0])


_NUMBER = re.compile(r"\s*[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?\s*", re.ASCII)


def _is_number(field: str, least: float = -math.inf) -> bool:
    return bool(_NUMBER.fullmatch(field)) and math.isfinite(float(field)) and float(field) >= least


def _text(data: bytes) -> str | None:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None


_FIELDS = {"range2": (6, 7), "point2": (7,), "odom2diff": (8,), "odom2": (7,), "angle": (3,)}
"""How many fields stand behind the keywords of libRSF."""


def _labyrinth_broken(name: str, files: Files) -> bool:
    text = _text(files[name])
    if text is None:
        return True
    for line in re.split("\r\n|\r|\n", text):
        word, *fields = line.split() or [""]
        if word and len(fields) not in _FIELDS.get(word, ()):
            return True
        checked = fields[:5] if word == "range2" else fields
        if not all(map(_is_number, checked)):
            return True
        if word == "range2" and float(fields[1]) >= 0 >= float(fields[2]):
            return True
        if word and abs(float(fields[0] if fields else 0)) > 9.3e9:
            return True
    return False


def _csv_broken(name: str, files: Files) -> bool:
    text, known = _text(files[name]), json.loads(files["m.json"])
    if text is None:
        return True
    if '"' in text or "\r" in text:
        return False
    lines = (line for line in text.split("\n") if line.strip() and line.strip()[0] != "#")
    rows = [line.split(",") for line in lines]
    if not rows:
        return True
    header = [field.strip() for field in rows[0]]
    wanted = known["columns"]
    if any(header.count(column) != 1 for column in wanted.values()):
        return True
    for row in rows[1:]:
        if len(row) != len(header):
            return True
        of = {key: row[header.index(column)].strip() for key, column in wanted.items()}
        measured = [of[k] for k in ("distance", "range", "azimuth") if k in of]
        if not _is_number(of["time"]) or abs(float(of["time"])) > 9.3e9:
            return True
        if any(measured) and not all(map(_is_number, measured)):
            return True
        if of.get("anchor", "A") not in known.get("anchors", "A"):
            return True
        if any(measured) and float(measured[0]) < 0:
            return True
    return False


def _strict_json(data: bytes) -> Any:
    def refuse(constant: str) -> None:
        raise ValueError(constant)

    return json.loads(data.decode("utf-8-sig"), parse_constant=refuse)


def _numbers(value: Any) -> Iterator[float]:
    if isinstance(value, list | dict):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _numbers(item)
    elif not isinstance(value, str):
        yield math.nan if value is None or isinstance(value, bool) else float(value)


def _autoferry_broken(name: str, files: Files) -> bool:
    try:
        content = _strict_json(files[name])
        records = content if "detections" in name else [r for step in content for r in step]
        for r in records:
            if "detections" in name and r["sensorID"] in (3, 4):
                continue
            used = {k: r[k] for k in ("time", *_PLACES[name])}
            if not all(map(math.isfinite, _numbers(used))):
                return True
            if "detections" in name and not isinstance(r["ownshipPosition"], list):
                return True
    except (ValueError, LookupError, TypeError, OverflowError, RecursionError):
        return True
    return False


_PLACES = {
    "x_detections.json": ("ownshipPosition", "measurement", "sensorID"),
    "x_groundTruth.json": ("position", "targetID"),
}
_COLUMNS = ["recording", "estimator", "metric", "part", "time", "value", "n", "stderr"]


def _row_is_bad(time: str, value: str, n: str, stderr: str) -> bool:
    good = (not time or _is_number(time)) and _is_number(value)
    good = good and bool(re.fullmatch(r"\d{1,18}", n, re.ASCII))
    return not (good and (not stderr or _is_number(stderr, 0.0)))


def _scores_csv_broken(name: str, files: Files) -> bool:
    text = _text(files[name])
    if text is None:
        return True
    if '"' in text.partition("\n")[2] or "\r" in text:
        return False
    lines = text.split("\n")
    rows = [next(csv_module.reader([line]), []) for line in lines if line[:1] != "#"]
    if rows[:1] != [_COLUMNS]:
        return True
    return any(
        len(row) != len(_COLUMNS) or _row_is_bad(*row[4:])
        for row, line in zip(rows[1:], lines[2:], strict=False)
        if line
    )


def _scores_json_broken(name: str, files: Files) -> bool:
    try:
        content = _strict_json(files[name])
        for row in content["scores"]:
            numbers = [row["value"], *(row[k] for k in ("time", "stderr") if row[k] is not None)]
            if not all(isinstance(v, int | float) and math.isfinite(v) for v in numbers):
                return True
            if not isinstance(row["n"], int) or row["n"] < 0 or set(row) != set(_COLUMNS):
                return True
    except (ValueError, LookupError, TypeError, OverflowError, RecursionError, AttributeError):
        return True
    return False


def _yaml_broken(name: str, files: Files) -> bool:
    try:
        found = yaml.safe_load(files[name].decode("utf-8-sig"))
        return not isinstance(found, dict | None)
    except (yaml.YAMLError, ValueError, RecursionError, TypeError):
        return True


def _whole(data: bytes, name: str) -> Callable[[], tuple[Files, ...]]:
    return lambda: ({name: data},)


TARGETS: dict[str, Target] = {
    "h5": Target(lambda: corpus.binary("h5"), _record, "h5", digest),
    "mcap": Target(lambda: corpus.binary("mcap"), _record, "mcap", digest),
    "scores-h5": Target(lambda: corpus.scores("h5"), _scores_h5, "h5", _table),
    "scores-csv": Target(
        lambda: corpus.scores("csv"),
        lambda paths: score_files.read(paths[0]),
        "text",
        broken=_scores_csv_broken,
    ),
    "scores-json": Target(
        lambda: corpus.scores("json"),
        lambda paths: score_files.read(paths[0]),
        "text",
        broken=_scores_json_broken,
    ),
    "weights": Target(corpus.archives, lambda paths: weights.read(paths[0]), "zip"),
    "labyrinth": Target(
        corpus.labyrinth,
        lambda paths: labyrinth.read(paths, labyrinth.Params()),
        "text",
        broken=_labyrinth_broken,
    ),
    "csv": Target(corpus.delimited, _csv, "text", broken=_csv_broken),
    "autoferry": Target(
        corpus.autoferry,
        lambda paths: autoferry.read(paths, autoferry.Params()),
        "text",
        broken=_autoferry_broken,
    ),
    "yaml-scenario": Target(
        _whole(corpus.SCENARIO, "a.yaml"),
        _scenario,
        "text",
        broken=_yaml_broken,
        refusal=ParameterError,
    ),
    "yaml-mapping": Target(
        _whole(corpus.MAPPING, "a.yaml"),
        _mapping,
        "text",
        broken=_yaml_broken,
        refusal=ParameterError,
    ),
    "yaml-config": Target(
        _whole(corpus.CONFIG, "a.yaml"),
        lambda paths: load_config(paths[0]),
        "text",
        broken=_yaml_broken,
        refusal=ParameterError,
    ),
}
