"""The start against grids and geometry: inside, outside, ambiguous, above, moving."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scene import simulated

import echoset
from echoset.estimators.eopda import geo, position
from echoset.estimators.eopda.cloud.modes import Ranges, modes
from echoset.estimators.eopda.cloud.start import start
from echoset.estimators.eopda.links import Links
from echoset.estimators.eopda.state import Belief, Event, Height
from echoset.estimators.presets import presets
from echoset.estimators.run import Estimation
from echoset.formats.windows import concatenate
from echoset.models.uwb import Region

NO_LINKS = Links(np.zeros(0, int), np.zeros(0, int), np.zeros(1, int), np.zeros(0), np.zeros(0))
CORNERS = np.array([[0.0, 0.0, 0.0], [4.5, 0.0, 0.0], [4.5, 4.0, 0.0], [0.0, 4.0, 0.0]])
PLANE = Belief(Height(0.0, 0.0, 0.0, np.inf), np.zeros(0), np.zeros((0, 0)))


def event(anchors, z, sigma=0.05, time=0.0) -> Event:
    """One range to each anchor."""
    n = len(anchors)
    v = np.full(n, sigma**2)
    links = Links(np.full(n, n), np.arange(n), np.arange(n + 1), np.asarray(z, float), v)
    return Event(round(time * 1e9), np.asarray(anchors, float), links, NO_LINKS)


def begin(events, before=PLANE, seed=1, **settings):
    params = position.Params(**{"particles": 2000, "max_range": 12.0, "range_bias_std": 0.0}
                             | settings)  # fmt: skip
    rng = np.random.default_rng(seed)
    return start(events, position.DEVICE.target, params, before, rng)


def distances(p, anchors=CORNERS):
    return np.linalg.norm(np.array([*p, 0.0])[: len(anchors[0])] - anchors, axis=1)


@pytest.mark.parametrize("p", [(2.0, 1.0), (7.0, 2.0), (-3.0, 6.0)])
def test_three_anchors_or_more_give_a_point_inside_and_outside_their_box(p):
    states, _ = begin([event(CORNERS, distances(p))])
    y = states[0].y[:2]
    assert np.abs(y.mean(1) - p).max() < 0.1 and y.std(1).max() < 0.2


def test_two_anchors_give_two_modes_and_one_gives_a_ring():
    two = CORNERS[:2]
    y = begin([event(two, distances((2.0, 3.0), two))])[0][0].y
    assert abs((y[1] > 0).mean() - 0.5) < 0.1
    assert np.abs(np.abs(y[1]) - 3.0).mean() < 0.2
    y = begin([event(CORNERS[:1], [3.0])])[0][0].y
    # a range that is false with the probability of clutter leaves some particles elsewhere
    assert (np.abs(np.hypot(*y[:2]) - 3.0) < 0.3).mean() > 0.75
    share = np.histogram(np.arctan2(y[1], y[0]), 8, (-np.pi, np.pi))[0] / 2000
    assert share.min() > 0.05 and share.max() < 0.25


@pytest.mark.parametrize("seed", range(3))
def test_the_evidence_is_the_integral_over_a_grid(seed):
    anchors, z = CORNERS[:2], distances((2.0, 3.0), CORNERS[:2])
    region = Region(anchors[:, :2], 1.25 * z.max())
    grid = np.stack(np.meshgrid(np.arange(-8, 12, 0.01), np.arange(-8, 8, 0.01)))
    p = grid.reshape(2, -1)
    log_l = np.zeros(p.shape[1])
    floor, sigma = 0.1 / 12.0, 0.05
    for a, d in zip(anchors, z, strict=True):
        t = (np.hypot(*(p - a[:2, None])) - d) / sigma
        log_l += np.log(floor + np.exp(-0.5 * t**2) / sigma / np.sqrt(2 * np.pi))
    exact = np.log(np.sum(np.exp(log_l) * region.contains(p)) * 1e-4 / region.area())
    _, log_z = begin([event(anchors, z, sigma)], seed=seed)
    assert abs(log_z - exact) < 0.25


def test_a_moving_device_is_found_from_ranges_one_after_another():
    p, v = np.array([1.0, 3.0]), np.array([0.8, -0.5])
    events = []
    for k in range(8):
        t, j = 0.1 * k, k % 4
        one = event(CORNERS[j : j + 1], distances(p + t * v)[j : j + 1], 0.02, t)
        links = one.active._replace(tx=np.array([4]), rx=np.array([j]))
        events.append(Event(one.time_ns, CORNERS, links, NO_LINKS))
    last = begin(events, acceleration_std=0.1)[0][-1].y
    assert np.abs(last[:2].mean(1) - (p + 0.7 * v)).max() < 4.5 * last[:2].std(1).max() < 0.5
    assert np.abs(last[2:4].mean(1) - v).max() < 4.5 * last[2:4].std(1).max() < 1.5


def test_a_height_that_is_not_known_is_found():
    up = CORNERS + np.array([0.0, 0.0, 2.5])
    before = Belief(Height(1.25, np.inf, 0.0, 2.5), np.zeros(0), np.zeros((0, 0)))
    z = np.linalg.norm(np.array([1.5, 1.0, 0.7]) - up, axis=1)
    y = begin([event(up, z, 0.02)], before)[0][0].y
    assert np.abs(y[[0, 1, -1]].mean(1) - [1.5, 1.0, 0.7]).max() < 0.1


def test_a_body_stands_back_from_the_device():
    """Modes are of the device: ranges of 60 draws with false ones among them hold the truth."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        p = rng.uniform(-2, 6, 2)
        z = np.concatenate((distances(p) + 0.03 * rng.normal(size=4), rng.uniform(0, 9, 8)))
        anchor = CORNERS[np.concatenate((np.arange(4), rng.integers(0, 4, 8)))]
        found = modes(
            Ranges(anchor, np.zeros(12), z, np.full(12, 0.03**2)), 0.3, 1.0, (0.0, 0.0), 10.0
        )
        assert np.linalg.norm(found.mean[:, :2] - p, axis=1).min() < 0.15


def test_the_side_of_a_body_that_nothing_tells_is_any():
    """From reflections alone the device is all around the body, and swings keep that law."""
    pairs = np.array([(0, 1), (1, 2), (2, 3), (0, 3)])
    z = (distances((2.0, 1.5))[pairs] - 0.2).sum(1)
    reflected = Links(*pairs.T, np.arange(5), z, np.full(4, 0.1**2))
    seen = Event(0, CORNERS, NO_LINKS, reflected)
    params = geo.Params(particles=4000, max_range=12.0, mean_clutter=1.0, mean_scatter=1.0)
    states, _ = start([seen], geo.CIRCLE, params, PLANE, np.random.default_rng(1))
    angle = states[0].y[5]
    # a quarter of the draws counts as independent, as moves decorrelate what resampling copied
    for k in (1, 2):
        assert abs(np.exp(1j * k * angle).mean()) < 4.5 / np.sqrt(len(angle) / 4)


@pytest.mark.parametrize("run", [76, 77])
def test_the_device_is_found_on_its_side_of_the_body(run):
    """Recordings of which a start without swings held the device on the other side, 0.5 m off."""
    record = simulated("uwb-olos", f"uwb-olos-s1-{run:04d}")
    tuned = ("--preset tuned", presets("eopda-geo")["tuned"])
    steps = Estimation("eopda-geo", (tuned,), seed=1).on(record.setup(), record.meta.name)
    found = concatenate(list(islice(steps.steps(record.scans()), 12)))
    errors = echoset.score(found, record, "rmse").where(metric="rmse", part="device", timed=True)
    assert errors.value[-4:].max() < 0.2


def test_the_region_is_where_an_anchor_can_hear():
    region = Region(np.array([[0.0, 0.0], [1.0, 0.0]]), 2.0)
    # two discs less their lens, by the formula of the circular segment
    lens = 2 * 4 * np.arccos(0.25) - 0.5 * np.sqrt(16 - 1)
    assert np.isclose(region.area(), 2 * np.pi * 4 - lens, rtol=0.01)
    p = region.draw(500, np.random.default_rng(1))
    assert region.contains(p).all() and p.shape == (2, 500)
    assert Region(np.zeros((1, 2)), 2.0, (0.0, 0.0, 1.0, 3.0)).area() == pytest.approx(3.0)
