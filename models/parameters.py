"""Parameters of scenarios and estimators: declared once, resolved from layers, described as YAML.

A ``Params`` class is a frozen dataclass whose fields are made by :func:`parameter`. What a value
may be stands with the field and is checked by :func:`resolve`; ``__post_init__`` checks what ties
fields, and raises :class:`ParameterError` by :func:`require`.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import inspect
import math
import types
import typing
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

from .errors import InputError, ParameterError

if TYPE_CHECKING:
    from .records import Recording

P = TypeVar("P")
Layer = tuple[str, Mapping[str, Any]]
"""Values of parameters and where they come from."""


_LARGEST = 1 << 53
"""Whole numbers are below: to it each has a float of its own."""


class _Required:
    """Marks a parameter without a default: it comes from the recording or from the user."""

    def __repr__(self) -> str:
        return "required"


REQUIRED: Any = _Required()


def parameter(default: Any, unit: str, doc: str, within: str | tuple[str, ...] = "") -> Any:
    """A field of a ``Params`` class with its default, unit, meaning and what its value may be.

    ``within`` is an interval such as ``"[0, 1)"`` or ``"(0, inf)"``, of every entry where the value
    has several, or the words that may be chosen; None, where a field may be it, is always within.
    """
    metadata = {"unit": unit, "doc": doc, "within": within}
    if isinstance(default, list | dict):
        return dataclasses.field(default_factory=lambda: default, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def rule(within: str | tuple[str, ...]) -> str:
    """The rule for a value, in words: ``positive``, ``in [0, 1)``, ``one of a b``, or nothing."""
    if isinstance(within, tuple):
        return f"one of {' '.join(within)}"
    if not within:
        return ""
    low, high = within[1:-1].split(", ")
    if high == "inf":
        if within[0] == "[":
            return f"at least {low}"
        return "positive" if low == "0" else f"more than {low}"
    return f"in {within}"


def is_within(value: Any, within: str | tuple[str, ...]) -> bool:
    """Whether ``value``, or every entry of it, is what ``within`` says."""
    if not within or value is None:
        return True
    if isinstance(value, tuple | list):
        return all(is_within(entry, within) for entry in value)
    if isinstance(within, tuple):
        return value in within
    low, high = map(float, within[1:-1].split(", "))
    above = value > low or (value == low and within[0] == "[")
    below = value < high or (value == high and within[-1] == "]")
    return bool(above and below)


def groups(cls: type[Any]) -> list[tuple[type[Any], list[dataclasses.Field[Any]]]]:
    """The fields of ``cls`` by the class that declares them, in their order.

    A class says in ``TITLE`` what its parameters are about, and in ``STREAMS``, if it has one, to
    which kinds of stream they apply.
    """
    owner: dict[str, type[Any]] = {}
    for base in reversed(cls.__mro__):
        owner |= dict.fromkeys(inspect.get_annotations(base), base)
    found: dict[type[Any], list[dataclasses.Field[Any]]] = {}
    for f in dataclasses.fields(cls):
        found.setdefault(owner[f.name], []).append(f)
    return list(found.items())


def require(ok: bool, name: str, rule: str, value: object) -> None:
    """Raise :class:`ParameterError` with name, rule and value unless ``ok``."""
    if not ok:
        raise ParameterError(f"{name} must be {rule}, got {shown(value)}")


def shown(value: object) -> str:
    """``value`` as a message quotes it, shortened where it is long."""
    text = repr(value)
    return text if len(text) <= 200 else f"{text[:200]}..."


def listed(names: Iterable[str]) -> str:
    """``names`` as a message lists them, the first of them where they are many or long."""
    text = ", ".join(names)
    return text if len(text) <= 200 else f"{text[:200]}..."


def suggestion(name: str, known: Iterable[str]) -> str:
    """`` (did you mean ...?)`` for a misspelt name, or nothing."""
    known = list(known)
    if name in known:
        return ""
    close = difflib.get_close_matches(name, known, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""


def resolve(cls: type[P], *layers: Layer) -> P:
    """Make ``cls`` from layers of (source, values), the later ones winning.

    Raises
    ------
    ParameterError : an unknown key, a value of the wrong type, an impossible value
    InputError : a required parameter that no layer gives
    """
    types_ = _hints(cast(Hashable, cls))
    values: dict[str, Any] = {}
    sources: dict[str, str] = {}
    for source, layer in layers:
        for key, value in layer.items():
            if key not in types_:
                hint = suggestion(key, types_)
                raise ParameterError(f"{source}: unknown parameter {shown(key)}{hint}")
            values[key] = _coerce(value, types_[key], f"{source}: {key}")
            sources[key] = source
    for f in dataclasses.fields(cls):  # type: ignore[arg-type]
        if f.default is REQUIRED and f.name not in values:
            raise InputError(
                f"the recording's sensor model has no {f.name!r}: give it by --set {f.name}=..."
            )
    try:
        for f in dataclasses.fields(cls):  # type: ignore[arg-type]
            within = f.metadata.get("within", "")
            if f.name in values:
                require(is_within(values[f.name], within), f.name, rule(within), values[f.name])
        return cls(**values)
    except ParameterError as error:
        place = sources.get(str(error).partition(" ")[0].partition(".")[0])
        raise ParameterError(f"{place}: {error}" if place else str(error)) from None


@functools.cache
def _hints(cls: Hashable) -> dict[str, Any]:
    """The types of the fields, evaluated once a class."""
    return typing.get_type_hints(cls)


def sensor_model(recording: Recording, cls: type[Any]) -> tuple[Layer, ...]:
    """Layers of the values that the recording's streams state for parameters of ``cls``."""
    fields = {f.name for f in dataclasses.fields(cls)}
    return tuple(
        (f"streams/{name}/model", {k: v for k, v in stream.model.items() if k in fields})
        for name, stream in sorted(recording.streams.items())
    )


def is_preset(source: str) -> bool:
    """Whether a layer of this source is a preset, which what a recording states overrules."""
    return source.lstrip("-").startswith("preset")


def layered(stated: Sequence[Layer], layers: Sequence[Layer]) -> list[Layer]:
    """The layers with what a recording has ``stated`` over presets and under what the user says."""
    presets = [layer for layer in layers if is_preset(layer[0])]
    return [*presets, *stated, *(layer for layer in layers if not is_preset(layer[0]))]


def resolved_by_stream(
    cls: type[P],
    of_one: Collection[str],
    groups: Mapping[str, Sequence[str]],
    stated: Sequence[Layer],
    layers: Sequence[Layer],
) -> P:
    """The parameters of a recording, with what holds for single streams in ``sensors``.

    For each stream hold, the later winning: defaults, the preset, the stream's own model, what the
    user says for all, what the user says of it in ``sensors``. Never the model of another.

    ``of_one`` are those that may differ; ``groups`` names what they differ for, and of each the
    streams whose models it has.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : a parameter that has no default is not known for a stream
    """
    alike = [(source, {k: v for k, v in x.items() if k != "sensors"}) for source, x in layers]
    models = {source.split("/")[1]: (source, model) for source, model in stated}
    before, after = ([x for x in layers if is_preset(x[0]) is early] for early in (True, False))
    early, late = (_said(cls, of_one, groups, some) for some in (before, after))
    needed = _needed(cls)
    # What every stream is told for itself need not be told for all.
    any_ = {k: v for x in (*early.values(), *late.values()) for k, v in x.items() if k in needed}
    common = resolve(cls, ("sensors", any_), *layered(stated, layers))
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
    return dataclasses.replace(common, sensors=found)  # type: ignore[type-var]


def per_stream(params: P, names: Sequence[str]) -> dict[str, P]:
    """The parameters as they hold for each of the streams ``names``."""
    common, sensors = ("", as_dict(params)), getattr(params, "sensors")  # noqa: B009
    found = {}
    for name in names:
        said = sensors.get(name, {})
        require(isinstance(said, Mapping), f"sensors.{name}", "a mapping", said)
        found[name] = resolve(type(params), common, (f"sensors.{name}", said))
    return found


def _needed(cls: type[Any]) -> set[str]:
    """The parameters without a default."""
    return {f.name for f in dataclasses.fields(cls) if f.default is REQUIRED}


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
                    known = key in {f.name for f in dataclasses.fields(cls)}
                    what = "does not hold for single streams" if known else "unknown parameter"
                    hint = "" if known else suggestion(str(key), of_one)
                    raise ParameterError(f"{source}: sensors.{name}.{key}: {what}{hint}")
            found[name] = {**found.get(name, {}), **values}
    return found


def _coerce(value: Any, kind: Any, where: str) -> Any:
    """``value`` as the type ``kind`` of a field, or ParameterError."""
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return value
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in args:
            return None
        return _coerce(value, next(a for a in args if a is not type(None)), where)
    if origin is tuple:
        if isinstance(value, str) or not isinstance(value, Iterable):
            value = (value,)
        items = list(value)
        inner = [args[0]] * len(items) if len(args) == 2 and args[1] is Ellipsis else list(args)
        if len(inner) != len(items):
            raise ParameterError(f"{where}: needs {len(inner)} values, got {len(items)}")
        return tuple(_coerce(v, a, where) for v, a in zip(items, inner, strict=True))
    if kind is bool and isinstance(value, bool):
        return value
    if kind is str and isinstance(value, str):
        return value
    if kind is int and not isinstance(value, bool):
        whole = isinstance(value, int) or (isinstance(value, float) and value.is_integer())
        if whole and abs(value) < _LARGEST:
            return int(value)
    if kind is float and not isinstance(value, bool):
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if math.isfinite(number):
            return number
    name = getattr(kind, "__name__", str(kind))
    raise ParameterError(f"{where}: must be a {name}, got {shown(value)}")


def as_dict(params: Any) -> dict[str, Any]:
    """The parameters as plain JSON: tuples become lists."""
    return {f.name: _plain(getattr(params, f.name)) for f in dataclasses.fields(params)}


def _plain(value: Any) -> Any:
    return [_plain(v) for v in value] if isinstance(value, tuple | list) else value
