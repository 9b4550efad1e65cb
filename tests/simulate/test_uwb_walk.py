"""The walk on a grid: its noise by moments, its odometry by dead reckoning, its differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.models.checks import check
from echoset.simulate.uwb_walk import Params, errors, simulate, walk

QUIET = Params(steps=200, noise="gaussian", sigma=1e-9, velocity_std=0.0, turn_rate_std=0.0)


def test_the_walk_stays_in_town_and_turns_at_corners():
    p, heading = walk(Params(steps=2000, size=9.0), np.random.default_rng(1))
    assert np.abs(p).max() <= 9.0
    np.testing.assert_allclose(np.linalg.norm(np.diff(p, axis=0), axis=1), 1.0)
    turns = np.flatnonzero(np.abs(np.angle(np.exp(1j * np.diff(heading)))) > 1e-9) + 1
    assert len(turns) > 100
    assert (turns % 4 == 0).all()


@pytest.mark.parametrize(
    ("noise", "mean", "variance"),
    [
        ("gaussian", 0.0, 0.25),
        ("heavy-tailed", 0.0, 0.8 * 0.25 + 0.2 * 2.5**2),
        ("multimodal", 0.6, 0.25 + 3.0**2 * 0.16),
        ("skewed", 0.6, 0.25 + 0.2 * 2 * 3.0**2 - 0.6**2),
    ],
)
def test_noise_has_the_moments_of_its_law(noise: str, mean: float, variance: float):
    n = 200_000
    e = errors(Params(noise=noise), (n,), np.random.default_rng(2))
    assert e.mean() == pytest.approx(mean, abs=4.5 * np.sqrt(variance / n))
    # the fourth moment of the heaviest is below 30 times the squared variance
    assert e.var() == pytest.approx(variance, rel=4.5 * np.sqrt(30 / n))


def test_odometry_alone_leads_along_the_walk():
    record = simulate(QUIET, np.random.default_rng(3), "r")
    check(record)
    scan = record.streams["odometry"].scan
    assert record.streams["odometry"].model["turn"] == "after"
    turn = scan["turn_rate"]
    headings = np.concatenate(([0.0], np.cumsum(turn)))[:-1]
    velocity = scan["velocity_x"] + 1j * scan["velocity_y"]
    way = np.concatenate(([0.0], np.cumsum(velocity * np.exp(1j * headings))))
    true = record.truth.objects.columns("x", "y", "heading")
    found = way * np.exp(1j * true[0, 2])
    np.testing.assert_allclose(found.real, true[:, 0], atol=1e-9)
    np.testing.assert_allclose(found.imag, true[:, 1], atol=1e-9)


def test_differences_are_those_of_the_ranges():
    record = simulate(replace(QUIET, differences=True), np.random.default_rng(3), "r")
    check(record)
    uwb = record.streams["uwb"]
    p = record.truth.objects.columns("device_x", "device_y")
    places = np.array([record.sensors[n].position[0, :2] for n in uwb.nodes[1:]])
    d = np.linalg.norm(p[:, None] - places, axis=2)
    step = np.searchsorted(record.truth.objects.time_ns, uwb.time_ns)
    expected = d[step, uwb.scan["rx"] - 1] - d[step, uwb.scan["reference"] - 1]
    np.testing.assert_allclose(uwb.rows["distance"], expected, atol=1e-6)
    assert len(uwb) == 7 * 200
