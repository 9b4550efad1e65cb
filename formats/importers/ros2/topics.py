"""Which topics of a bag become what, and what a mapping says of them."""

from __future__ import annotations

import logging
from collections import abc
from collections.abc import Mapping
from typing import Any

from ....models.errors import InputError, ParameterError
from ....models.parameters import require, resolve, shown, suggestion
from ..csv.units import check_unit
from .bag import Bag, Topic
from .clouds import KINDS, NAMES, Wanted
from .params import Params
from .tracks import TRACKS

TRANSFORMS = "tf2_msgs/TFMessage"
ODOMETRY = "nav_msgs/Odometry"
_log = logging.getLogger(__name__)


def use(topic: Topic) -> str:
    if topic.type in KINDS:
        return f"stream {legal(topic.name)} ({KINDS[topic.type]})"
    if topic.type == TRACKS:
        return f"estimates, by --set tracks={topic.name}"
    if topic.type in (TRANSFORMS, ODOMETRY):
        return "poses"
    return "left out, unless it is the truth or a mapping describes it"


def legal(topic: str) -> str:
    """The name of the stream of a topic."""
    return topic.strip("/").replace("/", "_").replace("~", "_") or "radar"


def descriptions(content: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """What the mapping says of each topic."""
    for key in content:
        if key != "topics":
            raise ParameterError(f"mapping: unknown key {shown(key)}{suggestion(key, ['topics'])}")
    topics = content.get("topics", {})
    ok = isinstance(topics, abc.Mapping)
    ok = ok and all(isinstance(v, abc.Mapping) for v in topics.values())
    require(ok, "topics", "a mapping of topics to what they are", topics)
    for name, own in topics.items():
        for key, value in own.items():
            known = ("columns", "model", "sensor")
            if key not in known:
                hint = suggestion(key, known)
                raise ParameterError(f"topics.{name}: unknown key {shown(key)}{hint}")
            if key != "sensor":
                require(isinstance(value, abc.Mapping), f"topics.{name}.{key}", "a mapping", value)
        for key in own.get("columns", {}):
            if key not in NAMES:
                hint = suggestion(key, NAMES)
                raise ParameterError(f"topics.{name}.columns: unknown {shown(key)}{hint}")
    found = {}
    for name, own in topics.items():
        wanted = {k: _wanted(k, v, name) for k, v in own.get("columns", {}).items()}
        found[name] = {**own, "columns": wanted}
    return found


def _wanted(key: str, value: Any, topic: str) -> Wanted:
    where = f"topics.{topic}.columns.{key}"
    said = value if isinstance(value, abc.Mapping) else {"field": value}
    found = resolve(Wanted, (where, said))
    check_unit(found.unit, key, where)
    require(found.scale != 0, f"{where}: scale", "other than 0", found.scale)
    return found


def chosen(bag: Bag, params: Params, told: Mapping[str, Any]) -> dict[str, Topic]:
    """The topics that become streams; what is left out is said."""
    for name in (*params.topics, *told, *([params.truth] if params.truth else [])):
        if name not in bag.topics:
            hint = suggestion(name, bag.topics)
            raise ParameterError(f"the bag has no topic {name!r}{hint}")
    wanted = params.topics or tuple(bag.topics)
    found = {n: t for n, t in bag.topics.items() if n in wanted and t.type in KINDS and t.count}
    if not found:
        types = ", ".join(f"{t.name} ({t.type})" for t in bag.topics.values()) or "no topics"
        raise InputError(f"{bag.path}: nothing of a radar in it, there are {types[:300]}")
    used = {TRANSFORMS, ODOMETRY}
    left = [
        f"{t.name} ({t.type}, {t.count})"
        for t in bag.topics.values()
        if t.name not in found and t.type not in used and t.name != params.truth
    ]
    if left:
        _log.warning("%s: left out %s", bag.path, ", ".join(left))
    return found
