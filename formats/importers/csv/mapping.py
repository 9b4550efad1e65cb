"""Mappings in YAML, and the further tables that they name."""

from __future__ import annotations

import math
from collections import abc
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from ....models.errors import FormatError, ParameterError
from ....models.parameters import require, resolve, shown, suggestion
from ....models.plain_yaml import parse
from ..matlab import read_mat
from ..text import TextFile, read_text
from . import columns, geodetic
from .log import Log
from .reading import Dialect, Reading
from .table import read_table
from .times import epoch_ns

MEASUREMENT = {"uwb": ("distance",), "position": ("x", "y"), "range_bearing": ("range", "azimuth")}
MEASUREMENT |= {"odometry": ()}
VIEW = ("view_azimuth_min", "view_azimuth_max", "view_range_min", "view_range_max")
_DOPPLER = ("doppler", "std_doppler")
_RADAR = (*_DOPPLER, "power", "amplitude", "rcs", "time_offset", "scan", "sensor", *VIEW)
_MOTION = ("velocity_x", "velocity_y", "turn_rate", "heading")
ODOMETRY = ("left", "right", *_MOTION, *(f"std_{name}" for name in _MOTION))
OPTIONAL = {
    "uwb": ("amplitude", "std", "anchor", "device", "tx", "rx", "reference"),
    "odometry": ODOMETRY,
    "position": ("z", *_RADAR),
    "range_bearing": ("elevation", "std_range", "std_azimuth", *_RADAR),
}
UNUSED = {
    "uwb": ("sensors", "sensor_frame"),
    "position": ("anchors", "devices"),
    "range_bearing": ("anchors", "devices"),
    "odometry": ("anchors", "sensors", "sensor_frame"),
}
MATLAB = ".mat"
R = TypeVar("R", bound=Reading)


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
class Mapping(Reading):
    """A mapping; its keys are explained in :mod:`echoset.formats.importers.csv.importer`."""

    kind: str = ""
    epoch: str = "1970-01-01T00:00:00Z"
    frame: tuple[str, ...] = ("east", "north", "up")
    origin: Any = None
    sensor_frame: tuple[str, ...] = ()
    anchors: Any = field(default_factory=dict)
    devices: Any = field(default_factory=dict)
    sensors: Any = field(default_factory=lambda: {"radar": [0.0, 0.0]})
    scans: Any = None
    wheel_distance: Any = None
    streams: Any = field(default_factory=dict)
    truth: Any = None
    model: Any = field(default_factory=dict)

    def __post_init__(self) -> None:
        Reading.__post_init__(self)
        hint = suggestion(self.kind, MEASUREMENT)
        require(
            self.kind in MEASUREMENT, "kind", f"one of {' '.join(MEASUREMENT)}{hint}", self.kind
        )
        for key in ("anchors", "devices", "sensors", "model"):
            value = getattr(self, key)
            require(isinstance(value, abc.Mapping), key, "a mapping", value)
        for name, label in self.devices.items():
            ok = isinstance(label, int) and not isinstance(label, bool) and label >= -1
            require(ok, f"devices.{name}", "the label of an object, or -1", label)
        epoch_ns(self.epoch)

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
class Tables:
    """Reads the tables of a mapping, written in ``dialect`` unless they say otherwise.

    ``files`` collects those that were read, for the provenance, and ``skipped`` by the part of the
    mapping how many rows were left out, and why.
    """

    folder: Path
    dialect: Dialect
    epoch: int
    plane: geodetic.Plane
    files: dict[Path, TextFile] = field(default_factory=dict)
    skipped: dict[str, dict[str, int]] = field(default_factory=dict)

    def read(
        self, spec: object, required: Sequence[str], optional: Sequence[str], where: str
    ) -> Log:
        """The table that the part ``where`` of the mapping describes."""
        return self.log(self.reading(spec, Reading, where), required, optional, where)

    def reading(self, spec: object, kind: type[R], where: str) -> R:
        """How to read the table that the part ``where`` of the mapping describes."""
        if not isinstance(spec, abc.Mapping):
            raise ParameterError(f"{where} must have file and columns, got {shown(spec)}")
        parent = {f.name: getattr(self.dialect, f.name) for f in fields(Dialect)}
        found = resolve(kind, ("mapping", parent), (where, spec))
        if not found.file:
            raise ParameterError(f"{where}: 'file' is missing")
        return found

    def log(
        self, reading: Reading, required: Sequence[str], optional: Sequence[str], where: str
    ) -> Log:
        """The table that is read so, from one file or from several that are written alike."""
        names = reading.file if isinstance(reading.file, list) else [reading.file]
        ok = bool(names) and all(isinstance(name, str) and name for name in names)
        require(ok, f"{where}: file", "the name of a file, or a list of them", reading.file)
        names_of = geodetic.instead(reading.columns, required, optional)
        found = columns.fields(reading.columns, *names_of, f"{where}.columns")
        files = [self.file(self.folder / name) for name in names]
        return self.table(files, reading, found, f"{where}.columns")

    def file(self, path: Path) -> TextFile:
        """The text file at ``path``, read once."""
        if path not in self.files:
            self.files[path] = read_mat(path) if path.suffix == MATLAB else read_text(path)
        return self.files[path]

    def table(
        self,
        files: Sequence[TextFile],
        reading: Reading,
        found: abc.Mapping[str, columns.Field | columns.TimeField],
        where: str,
    ) -> Log:
        """The columns of files; what was left out of them is noted."""
        if all(file.path.suffix == MATLAB for file in files):
            reading = replace(reading, delimiter=",", decimal=".", header=False)
        log = read_table(files, reading, found, where, self.epoch)
        if any(log.skipped.values()):
            part = where.removeprefix("mapping: ").removesuffix("columns").strip(".") or "log"
            self.skipped[part.removeprefix("streams.")] = dict(log.skipped)
        return self.plane.flat(log)
