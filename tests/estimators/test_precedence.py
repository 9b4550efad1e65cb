"""Which layer decides a parameter, for every estimator: a table of all combinations of layers.

defaults < preset < the stream's own model < --config < --set < what is said of one stream; and
what one stream states is never another's.
"""

from __future__ import annotations

import dataclasses
from itertools import product

import numpy as np
import pytest

from echoset.estimators.run import Estimation
from echoset.models.errors import InputError, ParameterError
from echoset.models.parameters import REQUIRED
from echoset.models.records import Meta, Recording, Sensor, Stream
from echoset.models.registry import load, names

GROUP = "echoset.estimators"
OURS = names(GROUP)
PER_STREAM = [n for n in OURS if "sensors" in load(GROUP, n).Params.__dataclass_fields__]
NEEDED = {"clutter_region": [0.0, 9.0, 0.0, 9.0], "p_detect": 0.9, "clutter_rate": 1.0}
LEVELS = ("preset", "model", "config", "set", "sensors")


def free(module) -> str:
    """A number that may have any positive value, of single streams where some may differ."""
    fields = [
        f
        for f in dataclasses.fields(module.Params)
        if f.metadata.get("within") in ("[0, inf)", "(0, inf)") and isinstance(f.default, float)
    ]
    first = [f.name for f in fields if f.name in ("max_range", "std_position")]
    return (first or [f.name for f in fields])[0]


def recording(kind: str, models: dict[str, dict]) -> Recording:
    time = np.zeros(0, np.int64)
    streams = {
        name: Stream(kind, ("radar",), model, time, np.zeros(1, np.int64), {}, {})
        for name, model in models.items()
    }
    return Recording(Meta("test"), {"radar": Sensor.static("radar", np.zeros(3))}, streams, None)


def params(name, models, *layers):
    """The parameters of an estimator on streams with these models."""
    module = load(GROUP, name)
    required = [f.name for f in dataclasses.fields(module.Params) if f.default is REQUIRED]
    needed = {k: NEEDED.get(k, 1.0) for k in required}
    setup = recording(module.STREAMS[0], {k: {**needed, **m} for k, m in models.items()})
    return Estimation(name, layers).on(setup, "test").params


def of(found, stream, key):
    """A parameter as it holds for a stream."""
    return getattr(found, "sensors", {}).get(stream, {}).get(key, getattr(found, key))


@pytest.mark.parametrize("name", OURS)
def test_the_later_wins(name):
    module = load(GROUP, name)
    key, default = free(module), getattr(module.Params, free(module), None)
    default = module.Params.__dataclass_fields__[key].default
    levels = LEVELS if name in PER_STREAM else LEVELS[:-1]
    for there in product((False, True), repeat=len(levels)):
        value = {k: 0.1 * (i + 1) for i, k in enumerate(levels) if there[i]}
        layers = [
            (source, {key: value[k]})
            for k, source in (("preset", "--preset x"), ("config", "--config"), ("set", "--set"))
            if k in value
        ]
        if "sensors" in value:
            layers.append(("--set", {"sensors": {"a": {key: value["sensors"]}}}))
        model = {key: value["model"]} if "model" in value else {}
        expected = value[max(value, key=levels.index)] if value else default
        assert of(params(name, {"a": model}, *layers), "a", key) == expected, value


@pytest.mark.parametrize("name", PER_STREAM)
def test_no_stream_has_the_model_of_another(name):
    module = load(GROUP, name)
    key = free(module)
    default = module.Params.__dataclass_fields__[key].default
    for streams in (("a", "b"), ("b", "a")):
        models = {streams[0]: {key: 3.0}, streams[1]: {}}
        found = params(name, models)
        assert [of(found, s, key) for s in streams] == [3.0, default]
        found = params(name, models, ("--preset x", {key: 2.0}))
        assert [of(found, s, key) for s in streams] == [3.0, 2.0]
        one = {"sensors": {streams[1]: {key: 4.0}}}
        found = params(name, models, ("--preset x", {key: 2.0, **one}))
        assert [of(found, s, key) for s in streams] == [3.0, 4.0]
        found = params(name, models, ("--set", one))
        assert [of(found, s, key) for s in streams] == [3.0, 4.0]
        found = params(name, models, ("--set", one), ("--set", {key: 5.0}))
        assert [of(found, s, key) for s in streams] == [5.0, 4.0]
        with pytest.raises(ParameterError, match="no such stream"):
            params(name, models, ("--set", {"sensors": {"c": {key: 4.0}}}))


@pytest.mark.parametrize("name", ["di-gsncp", "dbscan", "oracle"])
def test_streams_with_different_regions_ask_which(name):
    models = {"a": {"clutter_region": [0, 9, 0, 9]}, "b": {"clutter_region": [0, 5, 0, 5]}}
    with pytest.raises(InputError, match=r"state the regions .*: give one"):
        params(name, models)
    found = params(name, models, ("--set", {"clutter_region": [0, 7, 0, 7]}))
    assert found.clutter_region == (0, 7, 0, 7)
