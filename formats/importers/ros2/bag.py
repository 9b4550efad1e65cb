"""Bags as topics and messages: MCAP or sqlite3, plain or compressed, and the types in them.

What a type is stands in the bag, in ``.msg`` files that are told, or among those that ROS ships;
``radar_msgs`` are here, since bags of drivers often lack them.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from ....models.errors import EchosetError, FormatError, ParameterError

_log = logging.getLogger(__name__)
_DEFINITIONS = {
    "radar_msgs/msg/RadarReturn": "float32 range\nfloat32 azimuth\nfloat32 elevation\n"
    "float32 doppler_velocity\nfloat32 amplitude\n",
    "radar_msgs/msg/RadarScan": "std_msgs/Header header\nradar_msgs/RadarReturn[] returns\n",
    "radar_msgs/msg/RadarTrack": "uint16 NO_CLASSIFICATION=0\nuint16 STATIC=1\nuint16 DYNAMIC=2\n"
    "unique_identifier_msgs/UUID uuid\ngeometry_msgs/Point position\n"
    "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 acceleration\n"
    "geometry_msgs/Vector3 size\nuint16 classification\nfloat32[6] position_covariance\n"
    "float32[6] velocity_covariance\nfloat32[6] acceleration_covariance\n"
    "float32[6] size_covariance\n",
    "radar_msgs/msg/RadarTracks": "std_msgs/Header header\nradar_msgs/RadarTrack[] tracks\n",
}


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic: its type, such as ``sensor_msgs/PointCloud2``, and how many messages it has."""

    name: str
    type: str
    count: int


class Bag:
    """An open bag; ``recover`` makes it end at the first damage, which is told, and not fail."""

    def __init__(self, path: Path, definitions: Sequence[Path] = (), recover: bool = False) -> None:
        """Open the file or folder ``path``.

        Raises
        ------
        ParameterError : rosbags is not installed, or a definition is none
        FormatError : it is no bag, or damaged
        """
        try:
            from rosbags.rosbag2 import Reader
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        except ImportError:
            reason = "ROS bags need rosbags: pip install 'echoset[ros]'"
            raise ParameterError(reason) from None
        self.path, self._recover = path, recover
        self._types = get_typestore(Stores.ROS2_HUMBLE)
        reader = None
        try:
            reader = self._reader = Reader(path)
            self._reader.open()
            self._connections = list(self._reader.connections)
        except Exception as error:
            _close(getattr(reader, "storage", None))
            raise FormatError(path, "", f"no bag of ROS 2: {_reason(error)}") from error
        try:
            self._register(definitions, get_types_from_msg)
        except BaseException:
            self.close()
            raise
        count: dict[str, int] = {}
        kind: dict[str, str] = {}
        for c in self._connections:
            count[c.topic] = count.get(c.topic, 0) + c.msgcount
            kind[c.topic] = c.msgtype.replace("/msg/", "/")
        self.topics = {name: Topic(name, kind[name], count[name]) for name in sorted(count)}

    def _register(self, definitions: Sequence[Path], parse: Callable[[str, str], Any]) -> None:
        """Learn the types that ROS does not ship: told ones, then those of the bag."""
        told = list(_DEFINITIONS.items())
        told += [(f"{p.parent.parent.name}/msg/{p.stem}", _text(p)) for p in definitions]
        own = [
            (c.msgtype, c.msgdef.data)
            for c in self._connections
            if c.msgdef.data and c.msgdef.format.name == "MSG"
        ]
        known: dict[str, Any] = {}
        for name, text in (*told, *own):
            try:
                known |= parse(text, name)
            except Exception as error:
                reason = f"definition of {name}: {_reason(error)}"
                if (name, text) in told:
                    raise ParameterError(reason) from error
                raise FormatError(self.path, "", reason) from error
        self._types.register({k: v for k, v in known.items() if k not in self._types.fielddefs})

    def close(self) -> None:
        """Close the file or folder."""
        try:
            self._reader.close()
        except Exception as broken:
            _log.debug("%s: %s", self.path, broken)

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def knows(self, topic: Topic) -> bool:
        """Whether the type of a topic is defined anywhere."""
        return topic.type.replace("/", "/msg/") in self._types.fielddefs

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """Topic, log time [ns] and message, in the order of log times.

        Raises
        ------
        FormatError : the bag is damaged, or a message is not of its type
        """
        chosen = [c for c in self._connections if c.topic in topics]
        if not chosen:
            return
        number = 0
        try:
            for connection, time, raw in self._reader.messages(connections=chosen):
                number += 1
                yield connection.topic, time, self._types.deserialize_cdr(raw, connection.msgtype)
        except (EchosetError, GeneratorExit):
            raise
        except Exception as error:
            part = str(error.args[0]) if isinstance(error, KeyError) and error.args else ""
            if "/msg/" in part and part not in self._types.fielddefs:
                reason = f"the type {part} is not defined: tell its .msg file by definitions="
                raise ParameterError(reason) from error
            if not self._recover:
                where = f"message {number}"
                raise FormatError(self.path, where, _reason(error)) from error
            text = "%s: recovered %d messages, to the damage: %s"
            _log.warning(text, self.path, max(number - 1, 0), _reason(error))

    @property
    def duration(self) -> int:
        """Nanoseconds from the first message to the last."""
        return int(self._reader.duration) if any(t.count for t in self.topics.values()) else 0

    @property
    def provenance(self) -> list[dict[str, str]]:
        """Name and digest of the files."""
        folder = self.path.is_dir()
        files = sorted(p for p in self.path.iterdir() if p.is_file()) if folder else [self.path]
        return [{"name": p.name, "sha256": _digest(p)} for p in files]


def stamp(message: Any, log: int, time: str) -> int:
    """The time [ns] of a message: that of its header, if it has one, or else of the log."""
    if time == "log" or not hasattr(message, "header"):
        return log
    told = message.header.stamp
    return int(told.sec) * 10**9 + int(told.nanosec)


def _close(storage: object) -> None:
    """Close what a reader that failed has left open."""
    for held in list(vars(storage).values()) if storage is not None else []:
        if hasattr(held, "close"):
            held.close()


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"definition {path}: {_reason(error)}") from error


def _reason(error: Exception) -> str:
    text = " ".join(str(error).split())
    return text[:200] or type(error).__name__
