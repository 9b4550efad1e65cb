"""Detections by templates: where they are, how sure, whose they are, and what they need."""

from dataclasses import replace

import numpy as np
import pytest
from support.straight import straight

from echoset.estimators import mbm, phd
from echoset.estimators.maps.templates import LOG_ODDS, STATE, Templates
from echoset.models.errors import InputError
from echoset.models.parameters import sensor_model

FILTERS = pytest.mark.parametrize("module", [phd, mbm])


def params(module, recording, **changes):
    stated = sensor_model(recording, module.Params)
    layers = (("preset templates", module.PRESETS["templates"]), ("here", changes))
    return module.resolved(module.Params, recording, stated, layers)


@pytest.fixture(scope="module")
def recording():
    """A pedestrian 4 m beside a vehicle, both at 1 m/s along x, and one far away."""
    kinds, where = [0, 1, 0], [[-8.0, 4.0], [-8.0, 0.0], [9.0, -7.0]]
    return straight(kinds, where, [0.0, 0.0, 0.0], [1.0, 1.0, 0.7], 4, scans=14)


def true_at(recording, k):
    o = recording.truth.objects
    rows = slice(o.row_offset[k], o.row_offset[k + 1])
    return o.state[rows, :2], o.class_index[rows]


@pytest.mark.parametrize("predicted", [False, True])
def test_a_scan_alone_shows_where_targets_are(recording, predicted):
    """Each within 0.3 m and 4.5 deviations, its class right, seen anew or followed to there."""
    source = Templates.of(recording.setup(), params(mbm, recording))
    time_ns = recording.truth.objects.time_ns[6]
    scans = [s for s in recording.scans() if s.time_ns == time_ns]
    state, kind = true_at(recording, 6)
    label, where, kept = np.zeros(0, np.int64), np.zeros((0, 2)), {}
    if predicted:
        label, where = np.array([4, 7, 9]), state + 0.1
        seen = source.see(scans, label[:0], where[:0], {})
        kept = seen.recognise(label, state, {})
        assert [(kept[l][LOG_ODDS] > 0) == (k == 1) for l, k in zip(label, kind, strict=True)]
    sight = source.see(scans, label, where, kept)
    d = np.hypot(*(sight.z[:, None] - state).T)
    order = d.argmin(1)
    assert d.shape == (3, 3) and (d.min(1) < 0.3).all()
    off = sight.z[order] - state
    q = (off * np.linalg.solve(sight.R[order], off[..., None])[..., 0]).sum(1)
    assert (q < 4.5**2).all()
    found = sight.recognise(np.array([1, 2, 3]), state, {})
    assert [found[1 + k][LOG_ODDS] > 0 for k in range(3)] == (kind == 1).tolist()
    np.testing.assert_array_equal(found[2][STATE : STATE + 2], state[1])
    assert source.see([], label, where, kept) is None


def test_what_is_followed_where_nothing_is_makes_no_detection(recording):
    source = Templates.of(recording.setup(), params(mbm, recording))
    scans = [s for s in recording.scans() if s.time_ns == recording.truth.objects.time_ns[0]]
    ghost = np.array([[-12.0, -14.0]])
    sight = source.see(scans, np.array([0]), ghost, {})
    assert len(sight.z) == 3 and np.hypot(*(sight.z - ghost).T).min() > 3
    assert 0 not in sight.recognise(np.array([0]), ghost, {})


@FILTERS
def test_filters_follow_them(module, recording):
    """From the tenth scan on all three, with their classes and labels."""
    steps = list(
        module.estimate(recording.setup(), recording.scans(), params(module, recording), None)
    )
    labels = set()
    for k, step in enumerate(steps[9:], 9):
        state, kind = true_at(recording, k)
        d = np.hypot(*(step.objects.state[:, None, :2] - state).T)
        assert d.shape == (3, 3) and (d.min(1) < 0.3).all()
        assert (step.objects.class_index[d.argmin(1)] == kind).all()
        labels.add(tuple(step.objects.label[d.argmin(1)].tolist()))
    assert len(labels) == 1


@FILTERS
def test_they_are_the_default_where_the_waveform_is_stated(module, recording):
    stated = sensor_model(recording, module.Params)
    bare = module.resolved(module.Params, recording, stated, ())
    assert bare == params(module, recording) and bare.detector == "templates"
    assert module.files(recording.setup(), bare) == {}
    first = recording.streams["S0"]
    model = {k: v for k, v in first.model.items() if k != "carrier"}
    mute = replace(recording, streams={**recording.streams, "S0": replace(first, model=model)})
    assert module.resolved(module.Params, mute, stated, ()).detector == "clusters"
    with pytest.raises(InputError, match="S0: does not state its waveform: carrier missing"):
        module.context(mute.setup(), params(module, mute))
