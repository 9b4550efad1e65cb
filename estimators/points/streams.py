"""Which parameters hold for which stream of a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from ...models.errors import ParameterError
from ...models.parameters import Layer, as_dict, require, resolve, suggestion
from ...models.records import Recording
from .sensing import STREAMS, SensorParams
from .source import MADE

OF_ONE = tuple(f.name for f in fields(SensorParams) if f.name != "sensors")
"""Parameters that may differ from stream to stream."""
P = TypeVar("P", bound=SensorParams)


def resolved(cls: type[P], setup: Recording, stated: Sequence[Layer], layers: Sequence[Layer]) -> P:
    """The parameters of a recording, with what holds for single streams in ``sensors``.

    For each stream hold its own model among ``stated``, then what the ``layers`` say for all, then
    what their ``sensors`` say of it: never the model of another. All that is no detection stream
    is one, by the name of what a source makes.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : a parameter that has no default is not known for a stream
    """
    said = _said(cls, setup, layers)
    common = resolve(cls, *stated, *layers)
    alike = tuple((source, _but(layer, "sensors")) for source, layer in layers)
    models = {source.split("/")[1]: layer for source, layer in stated}
    kinds = {name: s.kind for name, s in setup.streams.items()}
    streams = {name: [name] for name, kind in sorted(kinds.items()) if kind in STREAMS}
    others = [name for name, kind in sorted(kinds.items()) if kind not in STREAMS]
    streams |= {MADE: others} if others else {}
    found = {}
    for name, of in streams.items():
        own = tuple((f"streams/{k}/model", models.get(k, {})) for k in of)
        mine = resolve(cls, *own, *alike, (f"sensors.{name}", said.get(name, {})))
        differs = {k: getattr(mine, k) for k in OF_ONE if getattr(mine, k) != getattr(common, k)}
        if differs:
            found[name] = {k: [*v] if isinstance(v, tuple) else v for k, v in differs.items()}
    return replace(common, sensors=found)


def _said(cls: type[Any], setup: Recording, layers: Sequence[Layer]) -> dict[str, dict[str, Any]]:
    """What the layers say of single streams; what a preset says of those that are not here is not.

    Raises
    ------
    ParameterError : no such stream, or no parameter of one
    """
    found: dict[str, dict[str, Any]] = {}
    for source, layer in layers:
        sensors = layer.get("sensors", {})
        require(isinstance(sensors, Mapping), "sensors", "a mapping", sensors)
        for name, values in sensors.items():
            require(isinstance(values, Mapping), f"sensors.{name}", "a mapping", values)
            if name not in setup.streams:
                if source.lstrip("-").startswith("preset"):
                    continue
                hint = suggestion(str(name), setup.streams)
                raise ParameterError(f"{source}: sensors.{name}: no such stream{hint}")
            for key in values:
                if key not in OF_ONE:
                    known = key in {f.name for f in fields(cls)}
                    what = "does not hold for single streams" if known else "unknown parameter"
                    hint = "" if known else suggestion(str(key), OF_ONE)
                    raise ParameterError(f"{source}: sensors.{name}.{key}: {what}{hint}")
            found[name] = {**found.get(name, {}), **values}
    return found


def _but(layer: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in layer.items() if key != name}


def per_stream(params: P, setup: Recording) -> dict[str, P]:
    """The parameters as they hold for each stream, and for what a source makes."""
    common = ("", as_dict(params))
    found = {}
    for name in (*sorted(setup.streams), MADE):
        said = params.sensors.get(name, {})
        require(isinstance(said, Mapping), f"sensors.{name}", "a mapping", said)
        found[name] = resolve(type(params), common, (f"sensors.{name}", said))
    return found
