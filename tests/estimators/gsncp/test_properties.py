"""What has no effect: the order of rows, names of streams, one scan or its halves."""

import numpy as np
import pytest

from echoset.estimators.gsncp import dbscan, di_gsncp
from echoset.models.records import Meta, Recording, Sensor, Stream

CENTRES = np.array([[8.0, 8.0], [24.0, 12.0], [30.0, 30.0], [10.0, 28.0]])
MODEL = {"std_position": 0.3, "p_detect": 0.9, "clutter_region": [0.0, 40.0, 0.0, 40.0]}
SHORT = {
    "resolution": 12.0, "block": 200, "burn_in": 2000, "max_burn_in": 4000, "patience": 1000,
    "explore": 2000, "max_explore": 4000, "samples": 60, "thin": 60,
}  # fmt: skip


def looks(count, seed=0):
    """Detections (m, 2) of targets of a metre, of ``count`` looks."""
    rng = np.random.default_rng(seed)
    scans = []
    for _ in range(count):
        own = np.repeat(CENTRES, rng.poisson(0.9 * 12 * 1.2**2, 4), axis=0)
        z = own + rng.normal(size=own.shape) * np.hypot(1.2, 0.3)
        scans.append(np.vstack((z, rng.uniform(0, 40, (8, 2)))))
    return scans


def recording(scans, names, **model):
    """One time, a stream for each of ``scans``."""
    sensors = {"mast": Sensor.static("radar", np.zeros(2))}
    streams = {
        name: Stream(
            "position", ("mast",), {**MODEL, **model}, np.zeros(1, np.int64),
            np.array([0, len(z)], np.int64), {}, dict(zip("xy", z.T.copy(), strict=True)),
        )
        for name, z in zip(names, scans, strict=True)
    }  # fmt: skip
    return Recording(Meta("plane"), sensors, {k: streams[k] for k in sorted(streams)}, None)


def found(module, rec, seed=0):
    settings = SHORT if module is di_gsncp else {"resolution": 12.0}
    params = module.resolved(
        module.Params, rec, [(f"streams/{k}/model", s.model) for k, s in rec.streams.items()],
        [("test", settings)],
    )  # fmt: skip
    rng = np.random.default_rng(seed)
    (step,) = module.estimate(rec.setup(), rec.scans(), params, rng)
    x = step.objects
    order = np.lexsort(x.state[:, :2].round(0).T)
    return x.state[order], None if x.covariance is None else x.covariance[order]


def apart(one, other):
    """Largest difference of centres, in deviations of the difference of two chains' means."""
    (a, P), (b, _) = one, other
    assert len(a) == len(b) == len(CENTRES)
    std = np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, :2])
    return (np.abs(a - b)[:, :2] / std).max()


@pytest.mark.parametrize("module", [di_gsncp, dbscan])
def test_the_order_of_rows(module):
    scans, rng = looks(2), np.random.default_rng(1)
    plain = found(module, recording(scans, "ab"))[0]
    mixed = found(module, recording([rng.permutation(z) for z in scans], "ab"))[0]
    np.testing.assert_allclose(plain, mixed, atol=1e-9)


def test_names_of_streams():
    """Another order of the looks is another chain of one posterior: means within its noise."""
    scans = looks(3)
    one, other = (found(di_gsncp, recording(scans, names)) for names in ("abc", "cab"))
    assert apart(one, other) < 1.5
    a, b = (found(dbscan, recording(scans, names))[0] for names in ("abc", "cab"))
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_a_scan_in_two_of_the_same_field():
    """Detections of a Poisson process, shared out at random, are two of half the number each."""
    (z,), rng = looks(1, seed=2), np.random.default_rng(3)
    mine = rng.random(len(z)) < 0.5
    whole = found(di_gsncp, recording([z], "a"))
    halves = found(di_gsncp, recording([z[mine], z[~mine]], "ab", p_detect=0.45))
    assert apart(whole, halves) < 1.5


def test_a_look_twice_is_not_one_look():
    """The tests above would see it: four looks are twice as sure as one."""
    variance = [
        np.diagonal(found(di_gsncp, recording(looks(len(names)), names))[1], axis1=1, axis2=2)
        for names in ("a", "abcd")
    ]
    ratio = variance[0][:, :2] / variance[1][:, :2]
    assert ratio.mean() > 2
