"""Odometry: sums of increments by hand, by integration, and what filter and batch make of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.eopda.batch import range_ls
from echoset.estimators.eopda.heading import drive, log_heading
from echoset.estimators.eopda.odometry import Increment, Odometer, Odometry, Reading
from echoset.estimators.eopda.state import State
from echoset.estimators.run import Estimation
from echoset.models.errors import InputError
from echoset.simulate.uwb_walk import Params, simulate

NAN = float("nan")
S = 10**9


def readings(turn: str, n: int, period: float, v: float, rate: float, std: float = 0.0) -> Odometer:
    """An odometer that has seen ``n`` equal events."""
    own = Odometer(Odometry(turn=turn))
    variance = np.array([std**2, std**2, std**2, 1.0])
    for k in range(1, n + 1):
        own.note(Reading(round(k * period * S), np.array([v, 0.0]), rate, NAN, variance))
    return own


def test_constant_velocity_and_turn_rate_are_an_arc():
    own = readings("during", 20, 0.1, v=2.0, rate=0.7)
    assert own.until(0).covered == 0.0
    # not at the times of the readings, so that parts of them are taken
    moved = own.until(round(1.23 * S))
    a = 0.7 * 1.23
    np.testing.assert_allclose(
        moved.displacement, 2.0 / 0.7 * np.array([np.sin(a), 1 - np.cos(a)]), rtol=1e-6
    )
    assert moved.turn == pytest.approx(a)
    assert moved.covered == pytest.approx(1.0)
    rest = own.until(2 * S)
    b = 0.7 * 0.77
    np.testing.assert_allclose(
        rest.displacement, 2.0 / 0.7 * np.array([np.sin(b), 1 - np.cos(b)]), rtol=1e-6
    )


def test_a_body_that_turns_after_its_motion_moves_straight():
    own = readings("after", 2, 1.0, v=1.0, rate=np.pi / 2)
    own.until(0)
    one = own.until(S)
    np.testing.assert_allclose(one.displacement, [1.0, 0.0], atol=1e-12)
    assert one.turn == pytest.approx(np.pi / 2)
    both = readings("after", 2, 1.0, v=1.0, rate=np.pi / 2)
    both.until(0)
    np.testing.assert_allclose(both.until(2 * S).displacement, [1.0, 1.0], atol=1e-12)


def test_the_covariance_is_that_of_many_noisy_sums():
    rng = np.random.default_rng(1)
    clean = readings("during", 10, 0.1, v=1.0, rate=0.5, std=0.05)
    clean.until(0)
    expected = clean.until(S).covariance
    sums = []
    for _ in range(4000):
        own = Odometer(Odometry())
        own.until(0)
        for k in range(1, 11):
            v, w = np.array([1.0, 0.0]) + 0.05 * rng.normal(size=2), 0.5 + 0.05 * rng.normal()
            own.note(Reading(k * S // 10, v, w, NAN, np.zeros(4)))
        moved = own.until(S)
        sums.append([*moved.displacement, moved.turn])
    found = np.cov(np.array(sums).T)
    # a variance from 4,000 draws has a standard error of 2.2 %, a covariance that of its scale
    scale = np.sqrt(np.outer(np.diag(found), np.diag(found)))
    np.testing.assert_allclose(found / scale, expected / scale, atol=4.5 * 0.022 + 0.03)


def test_what_odometry_does_not_cover_is_said():
    own = readings("during", 10, 0.1, v=1.0, rate=0.0)
    own.until(0)
    moved = own.until(2 * S)
    assert moved.covered == pytest.approx(0.5)
    assert own.until(3 * S).covered == 0.0


def test_a_heading_is_brought_to_the_end_of_the_interval():
    own = readings("during", 10, 0.1, v=1.0, rate=0.2)
    own.until(0)
    own.note(Reading(S // 2, np.full(2, NAN), NAN, 0.3, np.array([1.0, 1.0, 1.0, 0.01])))
    moved = own.until(S)
    assert moved.heading == pytest.approx(0.3 + 0.2 * 0.5)
    assert moved.heading_variance == 0.01
    assert np.isnan(own.until(2 * S).heading)


def test_particles_move_by_their_headings():
    n = 4
    heading = np.array([0.0, np.pi / 2, np.pi, 0.3])
    zero = np.zeros((n, 0))
    state = State(np.zeros((7, n)), np.full(n, 0.25), zero, np.zeros((n, 0, 0)), heading=heading)
    moved = Increment(np.array([1.0, 0.5]), 0.2, np.zeros((3, 3)), 1.0, 0.1, 0.04)
    motion, after = drive(state, 2.0, moved, np.random.default_rng(1))
    expected = (1.0 + 0.5j) * np.exp(1j * heading)
    np.testing.assert_allclose(motion[0] + 1j * motion[1], expected, atol=1e-3)
    np.testing.assert_allclose(motion[2] + 1j * motion[3], expected / 2, atol=1e-3)
    np.testing.assert_allclose(after, heading + 0.2, atol=1e-3)
    e = np.array([-0.1, np.pi / 2 - 0.1, np.pi - 0.1, 0.2])
    log_l = log_heading(state, moved)
    np.testing.assert_allclose(log_l, -(e**2) / 0.08 - 0.5 * np.log(2 * np.pi * 0.04), rtol=1e-9)


WALK = Params(steps=150, noise="gaussian", size=20.0, ring=30.0)


def errors(found: np.ndarray, record) -> float:
    """Root mean square error [m] after the first 20 steps, in which a heading is found."""
    true = record.truth.objects.columns("device_x", "device_y")
    return float(np.sqrt(((found - true)[20:] ** 2).sum(1).mean()))


@pytest.mark.parametrize("estimator", ["range-ls", "position"])
def test_odometry_makes_a_walk_much_better_known(estimator: str):
    record = simulate(WALK, np.random.default_rng(2), "walk")
    rms = []
    for streams in (record.streams, {"uwb": record.streams["uwb"]}):
        own = replace(record, streams=streams)
        settings = {"learn": []} | ({"particles": 2000} if estimator == "position" else {})
        run = Estimation(estimator, (("settings", settings),), 1).on(own.setup(), "walk")
        out = list(run.steps(own.scans()))
        found = np.array([e.objects.columns("device_x", "device_y")[0] for e in out])
        rms.append(errors(found, record))
        assert ("heading" in out[0].objects.state_names) == (len(streams) == 2)
    assert rms[0] < 0.6 * rms[1]
    # eight ranges of 0.5 m fix a position to 0.35 m; odometry of 0.025 m a step averages many
    assert rms[0] < 0.25


def test_the_heading_is_found_without_being_told():
    record = simulate(WALK, np.random.default_rng(3), "walk")
    run = Estimation("range-ls", (("settings", {"learn": []}),), 1).on(record.setup(), "walk")
    out = list(run.steps(record.scans()))
    found = np.array([e.objects.columns("heading")[0, 0] for e in out])
    true = record.truth.objects.columns("heading")[:, 0]
    k = out[0].objects.state_names.index("heading")
    std = np.sqrt([e.objects.covariance[0, k, k] for e in out])
    e = np.angle(np.exp(1j * (found - true)))[:-1]
    assert np.sqrt((e**2).mean()) < 0.1
    # the errors of some dozens of steps are one: the mean square is known to half of it
    assert 0.25 < ((e / std[:-1]) ** 2).mean() < 2.5


def test_several_streams_of_odometry_are_refused():
    record = simulate(WALK, np.random.default_rng(2), "walk")
    setup = record.setup()
    setup = replace(setup, streams={**setup.streams, "more": setup.streams["odometry"]})
    with pytest.raises(InputError, match="one stream of odometry"):
        list(range_ls.estimate(setup, [], range_ls.Params(), np.random.default_rng(0)))
