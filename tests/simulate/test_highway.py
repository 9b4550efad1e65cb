"""Scenario ``highway``: Doppler is the change of the distance, and cars keep to their lanes."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from echoset import formats
from echoset.models import registry
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.simulate import highway


def made(**parameters):
    params = highway.Params(**{"noise_density": 0.0, **parameters})
    recording = highway.simulate(params, np.random.default_rng(1), "run")
    check(recording)
    return params, recording


@pytest.mark.parametrize("limit", [60.0, 15.0])
def test_doppler_is_how_the_distance_changes_modulo_its_limit(limit):
    params, recording = made(std_doppler=1e-9, std_range=0.0, std_azimuth=0.0, doppler_max=limit)
    stream = recording.streams["radar"]
    step = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
    origin, z = stream.rows["origin_id"], stream.rows["doppler"]
    assert np.abs(z).max() <= limit
    truth, tried, dt = recording.truth.objects, 0, 1e-4
    for k in range(0, params.steps, 9):
        now = truth.at(np.array([k]))
        for label, x in zip(now.label, now.state, strict=True):
            rows = np.flatnonzero((step == k) & (origin == label))
            ends = [np.hypot(*(x[:2] + s * x[2:])) for s in (-dt, dt)]
            expected = (ends[1] - ends[0]) / (2 * dt)
            error = (z[rows] - expected + limit) % (2 * limit) - limit
            np.testing.assert_allclose(error, 0.0, atol=1e-5)
            tried += len(rows)
    assert tried > 100


def test_clutter_has_any_doppler():
    _, recording = made()
    stream = recording.streams["radar"]
    z = stream.rows["doppler"][stream.rows["origin_id"] < 0]
    assert abs(z.mean()) < 4.5 * 60 / np.sqrt(3 * len(z))
    assert (z**2).mean() == pytest.approx(60**2 / 3, rel=4.5 * np.sqrt(0.8 / len(z)))


def test_cars_keep_their_lanes_and_enter_and_leave_the_road():
    params, recording = made()
    truth = recording.truth.objects
    x, y, vx, vy = truth.state.T
    assert set(y) == {*params.lanes, *params.oncoming} and not vy.any()
    assert (np.sign(vx) == np.where(y < 0, 1, -1)).all()
    assert (np.abs(vx) >= 22).all() and (np.abs(vx) <= 38).all()
    assert x.min() >= 20 and x.max() <= 240
    count = np.diff(truth.row_offset)
    # About 220 m on six lanes with gaps of 60 m, at the start and at the end.
    assert 12 < count[:20].mean() < 32 and 12 < count[-20:].mean() < 32
    first = truth.at(np.array([0]))
    assert len(set(truth.label)) > 1.5 * len(first.label)


def test_nobody():
    _, recording = made(lanes=(), oncoming=())
    assert len(recording.truth.objects.label) == 0


def test_the_file_states_the_defaults_of_every_parameter():
    module = registry.load("echoset.scenarios", "highway")
    path = Path(module.__file__).parent / "scenarios" / "highway.yaml"
    content = yaml.safe_load(path.read_text())
    assert content["scenario"] == "highway"
    resolved = resolve(module.Params, ("file", content["parameters"]))
    assert resolved == module.Params()
    assert content["parameters"].keys() == asdict(resolved).keys()


@pytest.mark.parametrize(("name", "value"), [("road", [240.0, 20.0]), ("speeds", [38.0, 22.0])])
def test_refused(name, value):
    with pytest.raises(ParameterError, match=name):
        resolve(highway.Params, ("here", {name: value}))


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_both_formats_hold_doppler_and_its_ambiguity(form, tmp_path):
    _, recording = made(steps=5)
    stream = recording.streams["radar"]
    rows = {**stream.rows, "std_doppler": np.full(len(stream.rows["doppler"]), 0.3)}
    recording = replace(recording, streams={"radar": replace(stream, rows=rows)})
    formats.write(recording, tmp_path / f"x.{form}", form)
    found = formats.read(tmp_path / f"x.{form}").streams["radar"]
    for name in ("doppler", "std_doppler"):
        np.testing.assert_array_equal(found.rows[name], rows[name])
    assert (found.model["doppler_max"], found.model["std_doppler"]) == (60.0, 0.2)
