"""A tag alone: heights, moving anchors, pauses, offsets by anchor, scale, and learning."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest

import echoset
from echoset.estimators.eopda import learn as learning
from echoset.estimators.eopda import position
from echoset.estimators.run import Estimation
from echoset.models.errors import InputError, ParameterError
from echoset.models.parameters import resolve
from echoset.models.records import Meta, Recording, Sensor, Stream

CORNERS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])
CALIBRATED = {"learn": [], "range_bias_std": 0.0}


def walk(t):
    """A closed path (n, 2) inside the corners."""
    return np.stack((3 + 2 * np.cos(0.35 * t), 2.5 + 1.6 * np.sin(0.5 * t)), 1)


def recording(p, t, sigma=0.05, anchors=CORNERS, seed=1, too_long=0.0, scale=0.0, **model):
    """A range to each anchor from ``p`` (n, 2 or 3) at ``t`` (n,)."""
    n, J = len(t), len(anchors)
    p = np.repeat(np.column_stack((p, np.zeros(n)))[:, :3] if p.shape[1] == 2 else p, J, 0)
    up = np.column_stack((anchors, np.zeros(J)))[:, :3]
    rx = np.tile(np.arange(J), n)
    d = np.linalg.norm(p - up[rx], axis=1)
    z = (1 + scale) * d + np.broadcast_to(too_long, J)[rx]
    z = z + sigma * np.random.default_rng(seed).normal(size=len(z))
    sensors = {f"A{j}": Sensor.static("anchor", a) for j, a in enumerate(anchors)}
    scan = {"mode": np.zeros(n * J, "u1"), "tx": np.full(n * J, J, "i4"), "rx": rx.astype("i4")}
    stream = Stream(
        "uwb",
        (*sensors, "D"),
        {"sigma": sigma, **model},
        np.repeat(np.rint(t * 1e9).astype(np.int64), J),
        np.arange(n * J + 1),
        scan,
        {"distance": np.maximum(z, 0.0)},
    )
    return Recording(Meta("tag"), sensors | {"D": Sensor.device()}, {"uwb": stream})


def run(record, seed=1, **settings):
    """Device (n, 2), its covariance, the last objects, and all step values."""
    settings = {"particles": 1500} | settings
    asked = Estimation("position", (("settings", settings),), seed).on(record.setup(), "tag")
    out = list(asked.steps(record.scans()))
    device = np.concatenate([e.objects.columns("device_x", "device_y") for e in out])
    covariance = np.concatenate([e.objects.covariance[:, -2:, -2:] for e in out])
    steps = {k: np.concatenate([e.steps[k] for e in out]) for k in out[0].steps}
    return device, covariance, out[-1].objects, steps, asked.provenance({}).get("found", {})


def rmse(device, truth, first=10):
    return np.sqrt(((device - truth)[first:] ** 2).sum(1).mean())


def test_slant_ranges_of_a_height_told_and_estimated(caplog):
    t = np.arange(60) * 0.1
    up = np.column_stack((CORNERS, [2.4, 2.5, 2.6, 2.5]))
    record = recording(np.column_stack((walk(t), np.full(60, 1.0))), t, anchors=up)
    told, *_ = run(record, **CALIBRATED, device_height=1.0)
    assert rmse(told, walk(t)) < 0.08 and not caplog.records
    found, _, last, *_ = run(record, **CALIBRATED)
    assert rmse(found, walk(t)) < 0.08 and abs(last.columns("height")[0, 0] - 1.0) < 0.3
    assert sum("device_height" in r.message for r in caplog.records) == 1


def test_anchors_that_move_are_where_they_are():
    t = np.arange(40) * 0.1
    still = np.tile([2.0, 3.0], (40, 1))
    record = recording(still, t)
    time_ns = np.rint(t * 1e9).astype(np.int64)
    shift = np.column_stack((0.5 * t, np.zeros((40, 2))))
    moving = {
        name: Sensor("anchor", time_ns, s.position + shift, np.tile(s.quaternion, (40, 1)))
        for name, s in record.sensors.items()
        if s.kind == "anchor"
    }
    device, *_ = run(replace(record, sensors={**record.sensors, **moving}), **CALIBRATED)
    # ranges are as if the anchors stood still: the device goes along with them
    assert rmse(device, still + shift[:, :2]) < 0.06


@pytest.mark.parametrize("pause", [3.0, 60.0, 86_400.0])
def test_after_a_pause_the_device_is_found_again(pause):
    t = np.concatenate((np.arange(15) * 0.1, 1.4 + pause + np.arange(1, 16) * 0.1))
    p = np.concatenate((walk(t[:15]), np.array([1.0, 4.0]) + 0.05 * np.arange(15)[:, None]))
    device, covariance, *_ = run(recording(p, t), **CALIBRATED)
    assert np.hypot(*(device - p)[17:].T).max() < 0.3
    assert np.sqrt(covariance[17:].trace(axis1=1, axis2=2)).max() < 0.5


def test_a_device_that_has_gone_far_in_a_pause_is_found_again():
    """Four times as far as in the first second, from which the reach of anchors was guessed."""
    t = np.concatenate((np.arange(15) * 0.1, 60 + np.arange(15) * 0.1))
    p = np.repeat([[3.0, 2.0], [-20.0, 14.0]], 15, 0)
    device, *_ = run(recording(p, t, sigma=0.03), **CALIBRATED)
    assert np.hypot(*(device - p)[16:].T).max() < 1.0


def test_a_device_that_is_carried_off_is_sought_anew(caplog):
    t = np.arange(40) * 0.1
    p = np.where(np.arange(40)[:, None] < 20, [1.0, 1.0], [5.0, 4.5])
    device, _, _, steps, _ = run(recording(p, t), **CALIBRATED)
    assert np.hypot(*(device - p)[30:].T).max() < 0.2
    assert 1 <= steps["sought_anew"].sum() <= 3
    assert [r.message.count("sought anew") for r in caplog.records] == [1]
    _, _, _, steps, _ = run(recording(walk(t), t), **CALIBRATED)
    assert not steps["sought_anew"].any() and (steps["evidence"][1:] > 0).all()


def extended_kalman_filter(z, rx, t, sigma):
    """Position, velocity and an offset for each anchor; starts at the truth."""
    x, P = np.zeros(8), np.diag([0.1, 0.1, 1, 1, *([0.1] * 4)])
    x[:2] = walk(t[:1])[0]
    P[4:, 4:] += 0.09 - 0.1 * np.eye(4) + 0.01 * np.eye(4)
    out, last = [], t[0]
    for k in range(len(z)):
        dt = t[k] - last
        F, G = np.eye(8), np.zeros((8, 2))
        F[:2, 2:4], G[:2], G[2:4] = dt * np.eye(2), dt**2 / 2 * np.eye(2), dt * np.eye(2)
        x, P = F @ x, F @ P @ F.T + (0.1 * 2.0**2 / dt * G @ G.T if dt else 0)
        d = np.hypot(*(x[:2] - CORNERS[rx[k]]))
        H = np.zeros(8)
        H[:2], H[4 + rx[k]] = (x[:2] - CORNERS[rx[k]]) / d, 1
        K = P @ H / (H @ P @ H + sigma**2)
        x, P = x + K * (z[k] - d - x[4 + rx[k]]), P - np.outer(K, H @ P)
        out, last = [*out, x[:2]], t[k]
    return np.array(out)


def test_offsets_by_anchor_are_as_good_as_an_extended_kalman_filter():
    t = np.arange(120) * 0.1
    too_long = 0.3 + 0.1 * np.random.default_rng(5).normal(size=4)
    record = recording(walk(t), t, too_long=too_long)
    s = record.streams["uwb"]
    kalman = extended_kalman_filter(
        s.rows["distance"], s.scan["rx"], s.time_ns * 1e-9, 0.05
    ).reshape(120, 4, 2)[:, -1]
    device, covariance, last, *_ = run(record, learn=[], particles=4000)
    assert rmse(device, walk(t), 30) < max(1.3 * rmse(kalman, walk(t), 30), 0.08)
    e = (device - walk(t))[30:]
    nees = np.einsum("ni,nij,nj->n", e, np.linalg.inv(covariance[30:]), e)
    assert nees.mean() < 4.0
    spread = np.sqrt(last.covariance[0, 4, 4])
    assert abs(last.columns("range_bias")[0, 0] - too_long.mean()) < 4.5 * spread


def test_a_scale_is_found_and_taken_for_one():
    rng = np.random.default_rng(2)
    t = np.arange(160) * 0.25
    field = 80.0 * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    p = np.stack((20 + 1.0 * t, 30 + 10 * np.sin(0.1 * t)), 1)
    record = recording(p, t, sigma=0.5, anchors=field, seed=rng.integers(99), scale=0.07)
    device, _, last, _, found = run(record, learn=["scale", "bias"], range_bias_std=0.3)
    assert found["range_scale_std"] > 0 and found["learning_gain"] > 3
    assert abs(last.columns("range_scale")[0, 0] - 0.07) < 0.01 and rmse(device, p) < 1.0


def test_late_ranges_are_learnt_and_pull_the_device_less():
    """A third of the ranges has an exponential detour: it is found, and errors shrink."""
    t = np.arange(80) * 0.1
    errors = []
    for seed in (4, 5, 6):
        record = recording(walk(t), t, sigma=0.05)
        s = record.streams["uwb"]
        rng = np.random.default_rng(seed)
        detour = np.where(rng.random(320) < 0.33, rng.exponential(0.3, 320), 0.0)
        rows = {"distance": s.rows["distance"] + detour}
        record = replace(record, streams={"uwb": replace(s, rows=rows)})
        gaussian, *_ = run(record, **CALIBRATED)
        told, *_ = run(record, **CALIBRATED, late=0.33, detour=0.3)
        learnt, *_, found = run(record, range_bias_std=0.0, learn=["rates", "sigma"], particles=500)
        assert found["late"] > 0 and found["learning_gain"] > 10
        errors.append([rmse(p, walk(t)) for p in (gaussian, told, learnt)])
    gaussian, told, learnt = np.mean(errors, 0)
    assert told < 0.8 * gaussian and learnt < 0.9 * gaussian


def test_an_offset_or_a_scale_where_both_explain_the_ranges():
    """Equally long ranges, 7 % or 0.35 m: both stay possible, with their probabilities."""
    t = np.arange(20) * 0.1
    ring = np.array([[np.cos(a), np.sin(a)] for a in np.arange(5) * 2 * np.pi / 5])
    record = recording(np.tile([0.0, 0.0], (20, 1)), t, anchors=5 * ring, scale=0.07)
    either = {"range_bias_std": 0.3, "range_scale_std": 0.07, "range_error": "either"}
    _, _, last, *_ = run(record, learn=[], range_bias_spread=0.0, **either)
    offset, scale = last.columns("range_bias", "range_scale")[0]
    share = scale / 0.07
    assert 0.05 < share < 0.95 and abs(offset - (1 - share) * 0.35) < 0.03


def test_noise_that_is_told_wrong_is_learnt():
    t = np.arange(40) * 0.1
    record = recording(walk(t), t, sigma=0.2)
    *_, found = run(record, learn=["sigma"], sigma=0.1, particles=300)
    assert 0.13 < 0.1 * found["sigma_factor"] < 0.3


def test_much_is_learnt_from_a_part(monkeypatch):
    t = np.arange(60) * 0.1
    record = recording(walk(t), t, sigma=0.2)
    seen = []
    inner = learning.track

    def counted(events, *others):
        events = list(events)
        seen.append(len(events))
        return inner(events, *others)

    monkeypatch.setattr(learning, "track", counted)
    monkeypatch.setattr(learning, "MOST", 100)
    *_, found = run(record, learn=["sigma"], sigma=0.1, particles=300)
    assert set(seen) == {25} and 0.13 < 0.1 * found["sigma_factor"] < 0.3


def test_two_anchors_or_one_are_said_once(caplog):
    t = np.arange(5) * 0.1
    with caplog.at_level(logging.WARNING):
        run(recording(walk(t), t, anchors=CORNERS[:2]), **CALIBRATED, particles=200)
        run(recording(walk(t), t, anchors=CORNERS[:1]), **CALIBRATED, particles=200)
    assert ["mirror" in r.message or "ring" in r.message for r in caplog.records] == [True, True]


def test_an_offset_that_excludes_the_ranges_is_refused():
    t = np.arange(5) * 0.1
    record = recording(walk(t), t)
    with pytest.raises(
        InputError, match="range_bias 20 m is more than half of the first 20 ranges"
    ):
        run(record, **CALIBRATED | {"range_bias": 20.0})


def test_what_is_kept_shows_both_images_of_two_anchors(tmp_path):
    t = np.arange(10) * 0.1
    record = recording(np.tile([3.0, 2.0], (10, 1)), t, anchors=CORNERS[:2])
    _, _, _, steps, _ = run(record, **CALIBRATED, keep=50)
    kept = steps["device_samples"]
    assert kept.shape == (10, 50, 2)
    assert 0.2 < (kept[-1, :, 1] > 0).mean() < 0.8
    assert np.abs(np.abs(kept[-1]) - [3.0, 2.0]).max() < 0.5
    path = tmp_path / "tag.h5"
    echoset.write(echoset.estimate(record, "position", 1, **CALIBRATED, keep=50), path)
    assert echoset.read(path).steps["device_samples"].shape == (10, 50, 2)


def test_only_what_can_be_learnt_may_be_named():
    with pytest.raises(ParameterError, match="learn must be one of walks rates"):
        resolve(position.Params, ("--set", {"learn": ["speed"]}))
    with pytest.raises(ParameterError, match="device_height must be at least 0"):
        resolve(position.Params, ("--set", {"device_height": -1.0}))
