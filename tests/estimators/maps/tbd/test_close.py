"""Targets close together, and what tells one explanation from another."""

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from support.straight import straight

from echoset.estimators.maps.tbd import filter as tbd
from echoset.estimators.maps.tbd.moves import clear, needed, overlapping, without
from echoset.estimators.maps.tbd.params import Params
from echoset.estimators.maps.tbd.scene import Layout, View
from echoset.estimators.maps.tbd.targets import Targets, predict

PARAMS = Params()


def targets(*rows):
    """Rows of class, x, y, heading, existence."""
    rows = np.array(rows, float)
    n = len(rows)
    m = np.zeros((n, 7))
    m[:, [0, 1, 4]] = rows[:, 1:4]
    P = np.tile(np.diag([0.1, 0.1, 1.0, 1.0, 0.1, 0.1, 0.1]) ** 2, (n, 1, 1))
    kind, label = rows[:, 0].astype(np.int64), np.arange(n)
    return Targets(m, P, kind, rows[:, 4], 5.0 * (2 * kind - 1), label, np.full(n, 20))


@pytest.mark.parametrize(
    ("one", "other", "free"),
    [
        ((0, 0.0, 0.0, 0.0), (0, 0.6, 0.0, 0.0), True),
        ((0, 0.0, 0.0, 0.0), (0, 0.3, 0.3, 0.0), False),
        ((1, 0.0, 0.0, 0.0), (0, 2.6, 0.0, 0.0), True),
        ((1, 0.0, 0.0, 0.0), (0, 2.4, 1.0, 0.0), False),
        ((1, 0.0, 0.0, np.pi / 2), (0, 1.3, 0.0, 0.0), True),
        ((1, 0.0, 0.0, np.pi / 2), (0, 0.0, 2.4, 0.0), False),
        ((1, 0.0, 0.0, 0.0), (1, 0.0, 2.0, 0.0), True),
        ((1, 0.0, 0.0, 0.0), (1, 4.7, 0.0, 0.0), True),
        ((1, 0.0, 0.0, 0.0), (1, 2.0, 1.0, 0.3), False),
    ],
)
def test_bodies_do_not_overlap(one, other, free):
    for a, b in ((one, other), (other, one)):
        scene = targets((*a, 5.0))
        m = np.array([b[1], b[2], 0.0, 0.0, b[3], 0.0, 0.0])
        assert clear(b[0], m, scene, PARAMS) == free
    both = targets((*one, 5.0), (*other, 1.0))
    assert overlapping(both, PARAMS).tolist() == [False, not free]


def test_prediction_is_linear_motion():
    """Mean and covariance after 0.4 s are those of eight steps of 0.05 s."""
    start = targets((1, 1.0, 2.0, 0.3, 5.0), (0, -3.0, 4.0, 0.0, 5.0))
    start.m[:, 2:4] = 1.5, -0.5
    once, step = predict(start, PARAMS, 0.4), start
    for _ in range(8):
        step = predict(step, PARAMS, 0.05)
    np.testing.assert_allclose(once.m, step.m, atol=1e-9)
    np.testing.assert_allclose(once.P, step.P, atol=1e-9)
    np.testing.assert_allclose(once.m[:, :2], start.m[:, :2] + 0.4 * np.array([1.5, -0.5]))


def test_what_is_needed_and_what_is_not():
    """A pedestrian before a vehicle adds to the score; a ghost at its corner does not."""
    recording = straight([0, 1], [[7.0, 0.0], [3.5, 0.0]], [0.0, 0.0], [0.0, 0.0], 1, scans=4)
    layout = Layout.of(recording.setup(), list(recording.streams), PARAMS)
    scans = [s for s in recording.scans() if s.time_ns == 50_000_000]
    view = View.of(layout, scans, recording.setup())
    true = targets((0, 7.0, 0.0, 0.0, 5.0), (1, 3.5, 0.0, 0.0, 5.0))
    mean = view.mean(true.kind, true.vectors)
    assert needed(true, view, mean, 0, PARAMS) > 1.0
    assert needed(true, view, mean, 1, PARAMS) > 10.0
    kept, rest = without(true, view, mean, np.array([0]))
    np.testing.assert_allclose(rest, np.maximum(view.mean(kept.kind, kept.vectors), 1), rtol=1e-9)
    ghost = true.join(targets((0, 1.0, 1.4, 0.0, 5.0)))
    mean = view.mean(ghost.kind, ghost.vectors)
    assert needed(ghost, view, mean, 2, PARAMS) < 1.0


def shares(recording):
    """Share of the scans, from 12 on, in which all are found within 0.6 m, and false in a scan."""
    found, false, n = 0, 0, 0
    o = recording.truth.objects
    steps = tbd.estimate(recording.setup(), recording.scans(), PARAMS, None)
    for k, step in enumerate(steps):
        if k < 11:
            continue
        true = o.state[o.row_offset[k] : o.row_offset[k + 1], :2]
        d = np.hypot(*(step.objects.state[:, None, :2] - true).T).T
        i, j = linear_sum_assignment(d)
        right = int((d[i, j] < 0.6).sum())
        found, false, n = found + (right == len(true)), false + d.shape[0] - right, n + 1
    return found / n, false / n


CLOSE = {
    "vehicles side by side 3 m": ((1, 1), (0.0, 3.0), (1.5, 1.5)),
    "a pedestrian 3 m in front of a vehicle": ((0, 1), (3.0, 0.0), (0.7, 0.7)),
    "a pedestrian 3 m beside a vehicle": ((0, 1), (0.0, 3.0), (0.7, 0.7)),
    "two pedestrians 1.2 m apart": ((0, 0), (0.0, 1.2), (1.0, 1.0)),
}


@pytest.mark.verification
@pytest.mark.parametrize("name", CLOSE)
def test_those_close_together_are_found(name):
    """In four fifths of the scans and more, at five places, with hardly a false one."""
    kinds, offset, speed = CLOSE[name]
    found = []
    for seed in range(5):
        rng = np.random.default_rng(500 + seed)
        a, c = rng.uniform(0, np.pi), rng.uniform(-12, 12, 2)
        way = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        place = [c + np.array(offset) @ way, c]
        found.append(shares(straight(kinds, place, [a, a], speed, seed, scans=40)))
    share, false = np.mean(found, axis=0)
    assert share >= 0.8 and false <= 0.1, found
