"""Mappings in YAML, and the further tables that they name."""

from __future__ import annotations

import math
from collections import abc
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from ....models.errors import FormatError, ParameterError
from ....models.parameters import require, resolve, suggestion
from ....models.plain_yaml import parse
from ..text import TextFile, read_text
from .table import Dialect, Log, fields, read_table

MEASUREMENT = {"uwb": ("distance",), "position": ("x", "y"), "range_bearing": ("range", "azimuth")}
_RADAR = ("doppler", "power", "amplitude", "time_offset", "scan", "sensor")
OPTIONAL = {
    "uwb": ("amplitude", "std", "anchor", "device", "tx", "rx"),
    "position": ("z", *_RADAR),
    "range_bearing": ("elevation", "std_range", "std_azimuth", *_RADAR),
}
UNUSED = {
    "uwb": ("sensors", "sensor_frame"),
    "position": ("anchors", "devices"),
    "range_bearing": ("anchors", "devices"),
}


def load(source: object) -> tuple[dict[str, Any], Path | None]:
    """The mapping itself, or that in the YAML file ``source``, and the folder of the file.

    Raises
    ------
    ParameterError : the file is unreadable, no YAML or no mapping
    """
    if isinstance(source, abc.Mapping):
        return _plain(source, "mapping"), None
    path = Path(str(source))
    try:
        file = read_text(path)
    except FormatError as error:
        raise ParameterError(f"mapping {error}") from error
    found = parse(file.text, f"mapping {path}")
    if not isinstance(found, dict):
        raise ParameterError(f"mapping {path}: must map keys to values")
    return _plain(found, f"mapping {path}"), path.parent


def _plain(value: Any, where: str) -> Any:
    """``value`` with names as keys, if it is made of mappings, lists, finite numbers and text."""
    if isinstance(value, abc.Mapping):
        return {str(k): _plain(v, f"{where}: {k}") for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v, where) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise ParameterError(f"{where}: {value} is not finite")
    if value is not None and not isinstance(value, str | bool | int | float):
        raise ParameterError(f"{where}: {value!r} is neither a number nor a text")
    return value


@dataclass(frozen=True, slots=True)
class Mapping(Dialect):
    """A mapping; its keys are explained in :mod:`echoset.formats.importers.csv.importer`."""

    kind: str = ""
    columns: Any = None
    epoch: str = "1970-01-01T00:00:00Z"
    frame: tuple[str, ...] = ("east", "north", "up")
    sensor_frame: tuple[str, ...] = ()
    anchors: Any = field(default_factory=dict)
    devices: Any = field(default_factory=dict)
    sensors: Any = field(default_factory=lambda: {"radar": [0.0, 0.0]})
    scans: Any = None
    truth: Any = None
    model: Any = field(default_factory=dict)

    def __post_init__(self) -> None:
        Dialect.__post_init__(self)
        hint = suggestion(self.kind, MEASUREMENT)
        require(
            self.kind in MEASUREMENT, "kind", f"one of {' '.join(MEASUREMENT)}{hint}", self.kind
        )
        for key in ("anchors", "devices", "sensors", "model"):
            value = getattr(self, key)
            require(isinstance(value, abc.Mapping), key, "a mapping", value)
        try:
            datetime.fromisoformat(self.epoch)
        except ValueError:
            require(False, "epoch", "a time in ISO 8601", self.epoch)

    @staticmethod
    def of(content: abc.Mapping[str, Any], source: object = "") -> Mapping:
        """The mapping with this content of the file ``source``, without keys of other kinds."""
        try:
            mapping = resolve(Mapping, ("mapping", content))
            for key in UNUSED[mapping.kind]:
                if key in content:
                    reason = f"{key!r} has no meaning for kind {mapping.kind!r}"
                    raise ParameterError(f"mapping: {reason}")
        except ParameterError as error:
            raise ParameterError(f"{source}: {error}" if source else str(error)) from None
        return mapping


@dataclass(frozen=True, slots=True)
class _Reference(Dialect):
    """A further table: its file and the meaning of its columns."""

    file: str = ""
    columns: Any = None


@dataclass(frozen=True, slots=True)
class Tables:
    """Reads the tables of a mapping, written in ``dialect`` unless they say otherwise.

    ``files`` collects those that were read, for the provenance.
    """

    folder: Path
    dialect: Dialect
    files: list[TextFile]

    def read(
        self, spec: object, required: Sequence[str], optional: Sequence[str], where: str
    ) -> Log:
        """The table that the part ``where`` of the mapping describes."""
        if not isinstance(spec, abc.Mapping):
            raise ParameterError(f"{where} must have file and columns, got {spec!r}")
        parent = {k: getattr(self.dialect, k) for k in Dialect.__dataclass_fields__}
        reference = resolve(_Reference, ("mapping", parent), (where, spec))
        if not reference.file:
            raise ParameterError(f"{where}: 'file' is missing")
        found = fields(reference.columns, required, optional, f"{where}.columns")
        file = read_text(self.folder / reference.file)
        self.files.append(file)
        return read_table(file, reference, found)
