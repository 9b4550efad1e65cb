"""What is told to the importer of bags."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ....models.parameters import parameter, require


@dataclass(frozen=True, slots=True)
class Params:
    """What a bag does not say of itself."""

    mapping: Any = parameter("", "", "YAML file (or its content) that says what messages mean")
    time: str = parameter("header", "", "times of scans: header, stamps of the messages, or log")
    frame: str = parameter("", "", "the fixed frame; by default map, odom, or the only root")
    topics: tuple[str, ...] = parameter((), "", "topics that come in; by default all that can")
    truth: str = parameter("", "", "topic of the true pose of one object")
    tracks: str = parameter(
        "", "", "topic of tracks (radar_msgs/RadarTracks), which are written as estimates"
    )
    definitions: tuple[str, ...] = parameter((), "", ".msg files of types, PACKAGE/msg/TYPE.msg")
    recover: bool = parameter(False, "", "of a damaged bag, take what comes before the damage")

    def __post_init__(self) -> None:
        require(self.time in ("header", "log"), "time", "header or log", self.time)
