"""Which parameters hold for which stream of a recording, where some may differ.

For each stream hold, the later winning: defaults, the preset, the stream's own model, what the user
says for all, what the user says of it in ``sensors``. Never the model of another.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, TypeVar

from ..models.errors import ParameterError
from ..models.parameters import Layer, as_dict, is_preset, layered, require, resolve, suggestion

P = TypeVar("P")


def resolved(
    cls: type[P],
    of_one: Collection[str],
    groups: Mapping[str, Sequence[str]],
    stated: Sequence[Layer],
    layers: Sequence[Layer],
) -> P:
    """The parameters of a recording, with what holds for single streams in ``sensors``.

    ``of_one`` are those that may differ; ``groups`` names what they differ for, and of each the
    streams whose models it has.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : a parameter that has no default is not known for a stream
    """
    common = resolve(cls, *layered(stated, layers))
    alike = [(source, {k: v for k, v in x.items() if k != "sensors"}) for source, x in layers]
    models = {source.split("/")[1]: (source, model) for source, model in stated}
    before, after = ([x for x in layers if is_preset(x[0]) is early] for early in (True, False))
    early, late = (_said(cls, of_one, groups, some) for some in (before, after))
    found = {}
    for name, streams in groups.items():
        own = [models[k] for k in streams if k in models]
        presets = [x for x in alike if is_preset(x[0])]
        user = [x for x in alike if not is_preset(x[0])]
        presets.append((f"preset: sensors.{name}", early.get(name, {})))
        user.append((f"sensors.{name}", late.get(name, {})))
        mine = resolve(cls, *presets, *own, *user)
        differs = {k: getattr(mine, k) for k in of_one if getattr(mine, k) != getattr(common, k)}
        if differs:
            found[name] = {k: [*v] if isinstance(v, tuple) else v for k, v in differs.items()}
    return replace(common, sensors=found)  # type: ignore[type-var]


def per_stream(params: P, names: Sequence[str]) -> dict[str, P]:
    """The parameters as they hold for each of the streams ``names``."""
    common, sensors = ("", as_dict(params)), getattr(params, "sensors")  # noqa: B009
    found = {}
    for name in names:
        said = sensors.get(name, {})
        require(isinstance(said, Mapping), f"sensors.{name}", "a mapping", said)
        found[name] = resolve(type(params), common, (f"sensors.{name}", said))
    return found


def _said(
    cls: type[Any],
    of_one: Collection[str],
    groups: Mapping[str, Sequence[str]],
    layers: Sequence[Layer],
) -> dict[str, dict[str, Any]]:
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
            if name not in groups:
                if is_preset(source):
                    continue
                hint = suggestion(str(name), groups)
                raise ParameterError(f"{source}: sensors.{name}: no such stream{hint}")
            for key in values:
                if key not in of_one:
                    known = key in {f.name for f in fields(cls)}
                    what = "does not hold for single streams" if known else "unknown parameter"
                    hint = "" if known else suggestion(str(key), of_one)
                    raise ParameterError(f"{source}: sensors.{name}.{key}: {what}{hint}")
            found[name] = {**found.get(name, {}), **values}
    return found
