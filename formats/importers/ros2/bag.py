"""Bags as topics and messages: MCAP or sqlite3, plain or compressed, and the types in them.

What a type is stands in the bag, in ``.msg`` files that are told, or among those that ROS ships;
``radar_msgs`` are here, since bags of drivers often lack them.
"""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import Any

from ....models.errors import EchosetError, FormatError, ParameterError
from .damage import files, rescued, verify

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
    """An open bag; with ``recover`` of a damaged one what comes before the damage, which is told.

    ``damage`` is what is wrong with it, and ``held`` how many messages come before.
    """

    def __init__(
        self,
        path: Path,
        definitions: Sequence[Path] = (),
        recover: bool = False,
        prove: bool = True,
    ) -> None:
        """Open the file or folder ``path``, and ``prove`` its checksums.

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
        self.path, self.damage, self.held = path, "", 0
        self._types = get_typestore(Stores.ROS2_HUMBLE)
        self._reader: Any = None
        try:
            self._reader = self._open(Reader)
            if prove:
                self._prove()
            found = self._reader.connections
            kinds = [(_text_of(c.topic), _text_of(c.msgtype), int(c.msgcount)) for c in found]
            own = [(c.msgtype, c.msgdef.data) for c in found if _is_msg(c)]
        except Exception as error:
            self.close()
            if not recover:
                raise FormatError(path, "", f"no whole bag of ROS 2: {_reason(error)}") from error
            self.damage = _reason(error)
            kinds, own = [], []
        try:
            self._register(definitions, own, get_types_from_msg)
            if recover and not self.damage:
                self._try(kinds)
            if self.damage:
                kinds = self._rescue(get_types_from_msg)
        except BaseException:
            self.close()
            raise
        count: dict[str, int] = {}
        kind: dict[str, str] = {}
        for topic, name, n in kinds:
            count[topic] = count.get(topic, 0) + n
            kind[topic] = name.replace("/msg/", "/")
        self.topics = {name: Topic(name, kind[name], count[name]) for name in sorted(count)}

    def _open(self, kind: Any) -> Any:
        found = None
        try:
            found = kind(self.path)
            found.open()
        except Exception:
            _close(getattr(found, "storage", None))
            raise
        return found

    def _prove(self) -> None:
        checked = [verify(path) for path in files(self.path)]
        if not all(checked):
            _log.info("%s: has no checksums: damage of numbers does not show", self.path)

    def _try(self, kinds: Sequence[tuple[str, str, int]]) -> None:
        """Find damage that shows in messages alone."""
        try:
            for _ in self._read({topic for topic, _, _ in kinds}):
                pass
        except FormatError as error:
            self.damage = error.reason
            self.close()

    def _rescue(self, parse: Callable[[str, str], Any]) -> list[tuple[str, str, int]]:
        """Count the messages before the damage by topic and type, and learn their types."""
        self._reader = None
        count: dict[tuple[str, str], int] = {}
        learnt: set[str] = set()
        try:
            for path in files(self.path):
                for kind, _, raw in rescued(path):
                    if kind.type not in learnt:
                        learnt.add(kind.type)
                        own = [(kind.type, kind.definition)] if kind.definition else []
                        self._register((), own, parse)
                    if kind.type in self._types.fielddefs:
                        self._types.deserialize_cdr(raw, kind.type)
                    key = kind.topic, kind.type
                    count[key] = count.get(key, 0) + 1
                    self.held += 1
        except Exception as error:
            self.damage = _reason(error)
        if not self.held:
            raise FormatError(self.path, "", f"nothing is whole in it: {self.damage}")
        text = "%s: recovered %d messages, to the damage: %s"
        _log.warning(text, self.path, self.held, self.damage)
        return [(topic, name, n) for (topic, name), n in count.items()]

    def _register(
        self,
        definitions: Sequence[Path],
        own: Sequence[tuple[str, str]],
        parse: Callable[[str, str], Any],
    ) -> None:
        """Learn the types that ROS does not ship: told ones, then ``own``, those of the bag."""
        told = list(_DEFINITIONS.items())
        told += [(f"{p.parent.parent.name}/msg/{p.stem}", _text(p)) for p in definitions]
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
        if self._reader is None:
            return
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
        """Topic, log time [ns] and message, in the order of log times; of a damaged bag as it is.

        Raises
        ------
        FormatError : the bag is damaged, or a message is not of its type
        """
        return self._before(topics) if self.damage else self._read(topics)

    def _before(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        """The messages before the damage."""
        every = (m for path in files(self.path) for m in rescued(path))
        for kind, time, raw in islice(every, self.held):
            if kind.topic in topics:
                yield kind.topic, time, self._types.deserialize_cdr(raw, kind.type)

    def _read(self, topics: Collection[str]) -> Iterator[tuple[str, int, Any]]:
        chosen = [c for c in self._reader.connections if c.topic in topics]
        if not chosen:
            return
        number = 0
        try:
            for connection, time, raw in self._reader.messages(connections=chosen):
                number += 1
                if connection.msgtype in self._types.fielddefs:
                    message = self._types.deserialize_cdr(raw, connection.msgtype)
                    yield connection.topic, time, message
            declared = sum(c.msgcount for c in chosen)
            if number != declared:
                raise ValueError(f"{declared} messages are declared, there are {number}")
        except (EchosetError, GeneratorExit):
            raise
        except Exception as error:
            part = str(error.args[0]) if isinstance(error, KeyError) and error.args else ""
            if "/msg/" in part and part not in self._types.fielddefs:
                reason = f"the type {part} is not defined: tell its .msg file by definitions="
                raise ParameterError(reason) from error
            raise FormatError(self.path, f"message {number}", _reason(error)) from error

    @property
    def duration(self) -> int:
        """Nanoseconds from the first message to the last."""
        known = self._reader is not None and any(t.count for t in self.topics.values())
        return int(self._reader.duration) if known else 0

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


def _text_of(value: object) -> str:
    """A name that is one, as those of a damaged database need not be."""
    if not isinstance(value, str) or not value:
        raise ValueError("a topic has no name or no type")
    return value


def _is_msg(connection: Any) -> bool:
    return bool(connection.msgdef.data) and connection.msgdef.format.name == "MSG"


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
