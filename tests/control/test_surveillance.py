"""The closed loop: who looks where, what is recorded, and that it can be run over again."""

import dataclasses
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml

from echoset.control import surveillance
from echoset.control.runs import Runs, campaign, join, mean_over, numbers, paired
from echoset.estimators.points import phd
from echoset.estimators.presets import preset
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import as_dict, resolve
from echoset.models.random import generator
from echoset.models.registry import load
from echoset.simulate import surveillance as scene

SHORT = {"steps": 40, "first_step": 2}


def run(name="run", **changes):
    params = resolve(surveillance.Params, ("here", {**SHORT, **changes}))
    return params, surveillance.simulate(params, generator(1, "test", name), name)


def looks(recording):
    first = recording.streams["radar"].scan["view_azimuth_min"]
    return np.unique(first, return_inverse=True)[1]


def test_the_recording_is_sound_and_states_the_radar():
    params, recording = run()
    check(recording)
    stream = recording.streams["radar"]
    assert stream.model["p_detect"] == 0.6 and stream.kind == "range_bearing"
    assert len(stream) == params.steps == len(recording.truth.objects.time_ns)
    view = recording.sensors["radar"]
    assert view.position[0].tolist() == [500.0, 700.0, 0.0]


def test_the_naive_policy_takes_turns():
    assert looks(run(policy="naive")[1]).tolist() == [k % 3 for k in range(40)]


def test_the_variance_policy_looks_where_the_variance_was_largest():
    params = surveillance.Params(**SHORT)
    world = scene.world(params, generator(1, "test", "run"))
    steps = list(surveillance.loop(params, world))
    assert steps[0].view == 0
    for before, after in pairwise(steps):
        assert after.view == int(np.argmax(before.variance))
    assert looks(run()[1]).tolist() == [s.view for s in steps]


def test_equals_go_to_the_lowest_index():
    choose = load("echoset.policies", "variance").choose
    assert choose(7, np.zeros(3), np.array([1.0, 2.0, 2.0])) == 1


def test_the_filter_over_the_recording_finds_what_the_loop_knew():
    params, recording = run()
    world = scene.world(params, generator(1, "test", "run"))
    steps = list(surveillance.loop(params, world))
    model = recording.streams["radar"].model
    filter_ = resolve(phd.Params, ("preset", preset("phd", "surveillance")), ("model", model))
    again = phd.estimate(recording.setup(), recording.scans(), filter_, np.random.default_rng(0))
    for estimates, step in zip(again, steps, strict=True):
        for b, name in enumerate(params.names()):
            assert estimates.steps[f"region_mean_{name}"][0] == step.mean[b]
            assert estimates.steps[f"region_variance_{name}"][0] == step.variance[b]


def test_another_policy_has_the_same_targets_and_the_same_luck():
    one, other = run(policy="naive")[1], run(policy="variance")[1]
    assert np.array_equal(one.truth.objects.state, other.truth.objects.state)
    a, b = looks(one), looks(other)
    assert (a != b).any()
    for k in np.flatnonzero(a == b):
        rows = [
            np.split(r.streams["radar"].rows["range"], r.streams["radar"].row_offset[1:-1])[k]
            for r in (one, other)
        ]
        assert np.array_equal(*rows)


def test_views_cover_their_regions_and_do_not_overlap():
    params = surveillance.Params()
    rng = np.random.default_rng(1)
    position = np.array(params.radar)
    views = [params.view(v) for v in range(3)]
    for b, (x0, x1, y0, y1) in enumerate(params.regions):
        points = rng.uniform((x0, y0), (x1, y1), (1000, 2)) - position
        south = np.stack((-points[:, 1], points[:, 0]), 1)
        distance, azimuth = scene.polar(south)
        seen = np.array([view.contains(distance, azimuth) for view in views])
        assert seen[b].mean() > 0.99
        assert (seen.sum(0) <= 1).all()


def test_detections_are_lost_and_clutter_comes_at_the_stated_rates():
    params = surveillance.Params(
        mean_size=200.0, clutter_rate=7.0, std_range=1e-3, std_azimuth=1e-6
    )
    world = scene.world(params, generator(3, "test", "rates"))
    found = [scene.detections(params, world, k, 0) for k in range(params.steps)]
    origin = np.concatenate([rows["origin_id"] for rows in found])
    false = (origin < 0).sum()
    assert abs(false - 7.0 * 250) < 4.5 * np.sqrt(7.0 * 250)
    o = world.objects
    local = o.columns("x", "y") - params.radar
    view = params.view(0)
    inside = view.contains(*scene.polar(np.stack((-local[:, 1], local[:, 0]), 1)))
    n = inside.sum()
    assert abs((origin >= 0).sum() - 0.6 * n) < 4.5 * np.sqrt(n * 0.24)
    rows = found[60]
    k = np.flatnonzero(rows["origin_id"] >= 0)[0]
    row = o.row_offset[60] + np.flatnonzero(o.label[o.row_offset[60] :] == rows["origin_id"][k])[0]
    x, y = o.state[row, :2] - params.radar
    assert rows["range"][k] == pytest.approx(np.hypot(x, y), abs=0.01)
    assert rows["azimuth"][k] == pytest.approx(np.arctan2(x, -y), abs=1e-4)


def test_waves_come_at_intervals_and_a_group_is_poisson():
    waves = scene.Params(groups="waves", steps=2000)
    objects = scene.targets(waves, generator(1, "test", "waves"))
    labels, first = np.unique(objects.label, return_index=True)
    step = np.searchsorted(objects.row_offset, first, side="right")
    starts = np.unique(step)
    assert starts[0] == 10
    assert ((np.diff(starts) >= 40) & (np.diff(starts) <= 90)).all()
    n = len(starts)
    assert abs(len(labels) - 15.0 * n) < 4.5 * np.sqrt(15.0 * n)
    x = objects.state[first, 0]
    assert (x == 0).all()
    assert objects.state[:, 0].max() <= 1000.0


def test_numbers_of_targets_in_regions():
    params = surveillance.Params(**SHORT)
    objects = scene.targets(params, generator(1, "test", "numbers"))
    true = numbers(objects, params.regions)
    k = 35
    x, y = objects.state[objects.row_offset[k] : objects.row_offset[k + 1], :2].T
    assert true[k, 0] == ((x >= 100) & (x <= 300) & (y >= 100) & (y <= 300)).sum() > 0
    assert (true[:, 1:] == 0).all()


def test_a_campaign_in_parts_is_the_campaign():
    params = surveillance.Params(**{**SHORT, "steps": 12})
    whole = campaign(params, range(2), seed=5)
    halves = join([campaign(params, [0], seed=5), campaign(params, [1], seed=5)])
    for field in dataclasses.fields(Runs):
        assert np.array_equal(getattr(whole, field.name), getattr(halves, field.name))
    assert whole.looks().sum(1) == pytest.approx(1.0)


def test_means_over_some_steps_and_their_paired_error():
    values = np.array([[1.0, 3.0], [5.0, 7.0], [9.0, 9.0]])
    where = np.array([[True, True], [False, True], [False, False]])
    mean = mean_over(values, where)
    assert mean[:2].tolist() == [2.0, 7.0] and np.isnan(mean[2])
    assert paired(mean) == (4.5, 2.5)


@pytest.mark.parametrize("name", ["surveillance", "surveillance-waves"])
def test_the_scenario_files_hold_every_parameter(name):
    module = load("echoset.scenarios", name)
    file = Path(module.__file__).parent / "scenarios" / f"{name}.yaml"
    found = yaml.safe_load(file.read_text())
    assert found["scenario"] == name
    params = resolve(module.Params, (name, found["parameters"]))
    assert set(found["parameters"]) == set(as_dict(params))


def test_impossible_scenes_are_refused():
    for changes, name in (
        ({"policy": "best"}, "policy"),
        ({"groups": "some"}, "groups"),
        ({"regions": ((0.0, 1.0, 0.0, 1.0),)}, "regions"),
        ({"filter": {"gait": 3}}, "gait"),
        ({"views": ((10.0, -10.0),) * 3}, "views"),
    ):
        with pytest.raises(ParameterError, match=name):
            run(**changes)
