"""Numbers of sensors from recordings of which all is known."""

from dataclasses import replace

import numpy as np
import pytest
from support.sensors import radar, uwb

from echoset.metrics.calibration.quantities import BLOCKS, blocks, sandwich
from echoset.metrics.calibration.run import Params, calibrate
from echoset.metrics.calibration.tracks import places, seen_from, tracks
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry.poses import pose_at, poses_at
from echoset.models.parameters import resolve
from echoset.models.records import Truth


def checked(found, true, most=4.5):
    """Every number is within so many of its standard errors, and its halves agree as well."""
    assert {q.name for q in found.quantities} >= true.keys()
    for q in found.quantities:
        expected = true["p_detect"] if q.name.startswith("p_detect ") else true.get(q.name)
        if expected is not None:
            assert abs(q.value - expected) < most * q.stderr, q
            assert abs(q.split) < most, q
    assert found.nis == pytest.approx((1.0, 1.0), abs=0.4)


@pytest.mark.parametrize("kind", ["position", "range_bearing"])
@pytest.mark.parametrize("moving", [False, True])
def test_a_radar(kind, moving):
    recording, true = radar(1, kind, moving=moving)
    (found,) = calibrate([recording], Params())
    checked(found, {**true, "detections_per_target": 1.0})
    latency = found.quantities[0]
    # Six targets at 15 m/s, a hundred scans: 5 m / (15 m/s sqrt(510)), more or less.
    assert 0.003 < latency.stderr < 0.03
    assert found.settings["latency"] == latency.value


def test_a_uwb_network():
    recording, true = uwb(1)
    (found,) = calibrate([recording], Params())
    checked(found, true)
    assert found.settings["device_height"] == pytest.approx(1.0, abs=0.2)


def test_several_detections_of_a_target():
    recording, true = radar(2, each=3)
    (found,) = calibrate([recording], Params())
    checked(found, {**true, "detections_per_target": 3.0})


def test_several_recordings_are_one():
    both = [radar(seed, scans=60)[0] for seed in (3, 4)]
    (found,) = calibrate(both, Params())
    checked(found, radar(3, scans=1)[1])
    alone = [calibrate([one], Params())[0] for one in both]
    for q, a, b in zip(found.quantities[:6], *(x.quantities for x in alone), strict=False):
        assert q.stderr < min(a.stderr, b.stderr)


def test_latency_and_offsets_of_what_has_none():
    recording, true = radar(5, latency=0.0, registration_x=0.0, registration_y=0.0)
    (found,) = calibrate([recording], Params())
    checked(found, true)


def test_targets_at_rest_tell_no_latency():
    recording, _ = radar(6, latency=0.0)
    truth = recording.truth.objects
    still = replace(truth, state=np.tile(truth.state[:6], (len(truth.time_ns), 1)))
    stream = recording.streams["R"]
    rng = np.random.default_rng(6)
    z = (still.state[:6] + rng.normal(size=(100, 6, 2))).reshape(-1, 2)
    stream = replace(stream, row_offset=np.arange(101) * 6, rows={"x": z[:, 0], "y": z[:, 1]})
    there = replace(recording, streams={"R": stream}, truth=Truth(still))
    (found,) = calibrate([there], Params())
    assert not np.isfinite(found.quantities[0].stderr)
    assert np.isfinite([q.stderr for q in found.quantities[1:6]]).all()


def test_residuals_are_along_the_way_what_lateness_makes():
    recording, true = radar(7, std_position=1.0, registration_x=0.0, registration_y=0.0)
    (found,) = calibrate([recording], Params())
    left = found.residuals
    n = len(left.along)
    assert n > 300
    assert abs(left.before.mean() + 15 * true["latency"]) < 4.5 / np.sqrt(n)
    assert abs(left.along.mean()) < 4.5 / np.sqrt(n) and abs(left.across.mean()) < 4.5 / np.sqrt(n)
    assert left.along.std() == pytest.approx(1.0, rel=4.5 / np.sqrt(2 * n))


def test_a_sandwich_is_the_variance_of_a_mean_and_of_a_variance():
    x = np.random.default_rng(1).normal(3.0, 2.0, 5000)

    def score(theta):
        return np.stack((x - theta[0], (x - theta[0]) ** 2 - theta[1]), 1)

    theta = np.array([x.mean(), x.var()])
    cov = sandwich(score, theta, np.array([1e-3, 1e-3]), np.arange(5000))
    expected = [4 / 5000, 2 * 16 / 5000]
    np.testing.assert_allclose(np.diag(cov), expected, rtol=4.5 * np.sqrt(10 / 5000))


def test_blocks_are_consecutive_and_as_long():
    assert blocks(3).tolist() == [0, 1, 2] and len(blocks(0)) == 0
    found = blocks(1000)
    assert (np.diff(found) >= 0).all() and len(set(found)) == BLOCKS
    assert set(np.bincount(found)) == {1000 // BLOCKS}


def test_places_from_moving_sensors():
    """As poses one by one say."""
    recording, _ = radar(8, scans=20, moving=True)
    sensor, (first, *_) = recording.sensors["R"], tracks([recording], 1.5)
    time = np.array([5.3, 9.77, 20.1])
    x = places([first], np.zeros(3, int), time)
    np.testing.assert_allclose(x[:, 2], 1.5)
    local = seen_from([sensor], np.zeros(3, int), time, x)
    many = poses_at(sensor, time)
    for k, t in enumerate(time):
        q, turn = pose_at(sensor, round(t * 1e9))
        np.testing.assert_allclose(local[k], turn.T @ (x[k] - q), atol=1e-6)
        np.testing.assert_allclose(many[0][k], q, atol=1e-6)
        np.testing.assert_allclose(many[1][k], turn, atol=1e-9)


def test_refused():
    recording, _ = radar(9, scans=10)
    with pytest.raises(InputError, match="has no truth"):
        calibrate([recording.observed()], Params())
    with pytest.raises(InputError, match="too few"):
        calibrate([radar(9, scans=10, p_detect=0.0, clutter_rate=0.0)[0]], Params())
    with pytest.raises(InputError, match="no stream to calibrate; there are R"):
        calibrate([recording], Params(), ["Q"])
    with pytest.raises(InputError, match="has no stream"):
        calibrate([recording, uwb(1, events=50)[0]], Params())
    with pytest.raises(ParameterError, match="latency_max"):
        resolve(Params, ("here", {"latency_min": 3.0, "latency_max": 1.0}))
