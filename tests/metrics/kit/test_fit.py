"""A truth that was turned, shifted and delayed comes back by the estimates."""

from __future__ import annotations

import math

import numpy as np
import pytest

from echoset.metrics.kit.fit import fit, gain, track
from echoset.models.errors import InputError
from echoset.models.geometry.poses import Placement
from echoset.models.records import Objects


def walked(t: np.ndarray) -> np.ndarray:
    """A walk that is no figure of symmetry."""
    x = 4 + 2.5 * np.sin(0.21 * t) + 0.8 * np.sin(0.53 * t + 1)
    return np.column_stack([x, 3 + 1.8 * np.cos(0.17 * t) + 0.7 * np.sin(0.41 * t)])


def seen(t: np.ndarray, angle: float, shift: np.ndarray) -> np.ndarray:
    """The walk in a frame that, turned by ``angle`` and shifted, is ours."""
    c, s = math.cos(angle), math.sin(angle)
    return (walked(t) - shift) @ np.array([[c, -s], [s, c]])


@pytest.mark.parametrize("epoch", [0.0, 1.7e9])
@pytest.mark.parametrize(
    ("mode", "angle", "shift", "delay"),
    [
        ("both", math.pi, (3.0, -2.0), 0.7),
        ("both", 1.0, (3.0, -2.0), -6.7),
        ("rigid", -2.5, (-1.0, 4.0), 0.0),
        ("time", 0.0, (0.0, 0.0), 0.7),
    ],
)
def test_frame_and_clock_come_back(mode: str, angle: float, shift: tuple, delay: float, epoch):
    rng = np.random.default_rng(5)
    t = np.arange(0, 120, 0.05)
    place = walked(t) + 0.05 * rng.standard_normal((len(t), 2))
    place[:20] += 3.0  # where a filter begins blind
    place[rng.random(len(t)) < 0.05] += 1.0
    s = np.arange(-15, 136, 0.1)
    true = epoch + s - delay, seen(s, angle, np.array(shift))
    placed, found = fit((epoch + t, place), true, mode, "x")
    # 1 cm, 0.1 degree and 10 ms are what is asked for; the errors' standard deviation allows more.
    assert abs(math.remainder(placed.rotation - angle, 2 * math.pi)) < math.radians(0.1)
    assert math.hypot(placed.x - shift[0], placed.y - shift[1]) < 0.01
    assert placed.delay == pytest.approx(delay, abs=0.01)
    assert found["fitted"] == {"both": 4, "rigid": 3, "time": 1}[mode]
    assert found["left_out"] >= 20


def test_what_a_fit_takes_from_the_error_is_told():
    """Over many runs of white errors, the ratio of the mean squares is 1 - p / 2n."""
    rng = np.random.default_rng(6)
    t = np.linspace(0, 60, 60)
    s = np.arange(-11, 72, 0.05)
    before, after, told = [], [], []
    for _ in range(300):
        off = 0.05 * rng.standard_normal((len(t), 2))
        placed, found = fit((t, walked(t) + off), (s, walked(s)), "rigid", "x")
        c, d = math.cos(placed.rotation), math.sin(placed.rotation)
        p = walked(t - placed.delay) @ np.array([[c, d], [-d, c]]) + [placed.x, placed.y]
        after.append(np.mean((walked(t) + off - p) ** 2))
        before.append(np.mean(off**2))
        told.append(gain({**found, "independent": len(t)}) ** 2)
    ratio = np.array(after) / np.mean(before)
    # The standard error of the ratio is that of the difference, whose spread is chi-square of 3.
    error = np.std(np.array(before) - np.array(after)) / np.mean(before) / math.sqrt(len(after))
    assert np.mean(told) == pytest.approx(1 - 3 / 120, abs=1e-12)
    assert np.mean(ratio) == pytest.approx(np.mean(told), abs=4.5 * error)


def test_errors_that_last_count_less():
    """Autoregressive errors of factor a have (1 + a) / (1 - a) times fewer independent ones."""
    rng = np.random.default_rng(7)
    n, a = 8000, 0.8
    off = np.zeros((n, 2))
    for k in range(1, n):
        off[k] = a * off[k - 1] + 0.03 * rng.standard_normal(2)
    t = np.linspace(0, 400, n)
    s = np.arange(-11, 412, 0.05)
    _, found = fit((t, walked(t) + off), (s, walked(s)), "rigid", "x")
    assert found["positions"] / found["independent"] == pytest.approx(9.0, rel=0.2)


def test_extents_turn_and_velocities_do_not_shift():
    names = ("x", "y", "vx", "vy", "device_x", "device_y")
    state = np.array([[1.0, 0, 1, 0, 2, 0]])
    o = Objects(
        np.zeros(1, np.int64), np.array([0, 1]), np.zeros(1, np.int64), names, ("m",) * 6, state,
        extent_kind="ellipse", semi_axes=np.ones((1, 2)), rotation=np.zeros(1),
    )  # fmt: skip
    moved = Placement(math.pi / 2, 10.0, 20.0, 0.5).of(o)
    np.testing.assert_allclose(moved.state, [[10, 21, 0, 1, 10, 22]], atol=1e-12)
    assert moved.rotation == pytest.approx([math.pi / 2])
    assert moved.time_ns.tolist() == [500_000_000]


def test_what_cannot_be_fitted_is_refused():
    t = np.arange(10.0)
    with pytest.raises(InputError, match="needs 30 estimates"):
        fit((t, walked(t)), (t, walked(t)), "both", "x")
    none = np.zeros(0), np.zeros((0, 2))
    with pytest.raises(InputError, match="needs 30 estimates"):
        fit(none, none, "rigid", "x")
    two = Objects(
        np.zeros(1, np.int64), np.array([0, 2]), np.arange(2), ("x", "y"), ("m", "m"),
        np.zeros((2, 2)),
    )  # fmt: skip
    with pytest.raises(InputError, match="several"):
        track([two], "x")
