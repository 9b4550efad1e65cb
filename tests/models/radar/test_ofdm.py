"""The radar against its signal model, differentiated by finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from scipy.special import i0e

from echoset.models.radar import ofdm
from echoset.models.radar.ofdm import LIGHT, Radar, State

FULL = Radar()
SMALL = Radar(side=4, subcarriers=16, spacing=5e6)
POINTS = np.array([[7.0, 3.0, 1.0], [25.0, 16.0, 8.5], [44.0, 9.0, 5.2], [-3.0, 30.0, 12.0]])


def state(radar: Radar, turned: bool = False) -> State:
    rng = np.random.default_rng(4)
    f = ofdm.precoders(radar, np.array([0.3, 0.2, np.sqrt(0.87)]), 2, 8, rng)
    rotation = Rotation.from_euler("zyx", [0.4, -0.2, 0.7]).as_matrix() if turned else np.eye(3)
    return State(radar, np.array([12.0, -4.0, 5.0]), rotation, f)


def array_offset(s: State, p: np.ndarray) -> np.ndarray:
    """q = (s_z, s_x, -s_y) of the offset in the sensor's frame."""
    x = s.rotation.T @ (p - s.position)
    return np.array([x[2], x[0], -x[1]])


def element_phase(s: State, p: np.ndarray) -> np.ndarray:
    """One-way phase (side^2,) of the elements."""
    q = array_offset(s, p)
    phi, theta = np.arctan2(q[1], q[0]), np.arccos(q[2] / np.linalg.norm(q))
    i, j = np.indices((s.radar.side, s.radar.side))
    wave = LIGHT / s.radar.carrier
    d = LIGHT / (s.radar.carrier + s.radar.subcarriers * s.radar.spacing / 2) / 2
    u, v = np.cos(phi) * np.sin(theta), np.sin(phi) * np.sin(theta)
    return (-2 * np.pi * d / wave * (u * i + v * j)).ravel()


def signal(s: State, p: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Noise-free y / beta (n, t, elements), with a^T f_t held at ``gains`` (t,)."""
    n = np.arange(-s.radar.subcarriers // 2 + 1, s.radar.subcarriers // 2 + 1)
    tau = 2 * np.linalg.norm(p - s.position) / LIGHT
    delay = np.exp(-2j * np.pi * n * s.radar.spacing * tau)
    b = np.exp(2j * element_phase(s, p))
    return delay[:, None, None] * gains[:, None] * b


def beta(s: State, p: np.ndarray) -> float:
    r = s.radar
    power = 10 ** (r.transmit_density / 10) * 1e-3 * r.spacing
    wave, R = LIGHT / r.carrier, np.linalg.norm(p - s.position)
    return np.sqrt(power * wave**2 * r.rcs / ((4 * np.pi) ** 3 * R**4))


def noise_power(s: State) -> float:
    return 10 ** (s.radar.noise_density / 10) * 1e-3 * s.radar.spacing


def gains(s: State, p: np.ndarray) -> np.ndarray:
    return s.precoders @ np.exp(1j * element_phase(s, p))


@pytest.mark.parametrize(("radar", "turned"), [(SMALL, False), (SMALL, True), (FULL, False)])
def test_covariance_is_the_inverse_of_the_numerical_information(radar, turned):
    s = state(radar, turned)
    closed = ofdm.covariance(s, POINTS)
    for p, expected in zip(POINTS, closed, strict=True):
        g = gains(s, p)
        if radar is FULL:  # equal precoder terms add up: one of their total power says the same
            g = np.array([np.linalg.norm(g)])
        y, h = signal(s, p, g), 2e-4
        columns = []
        for axis in np.eye(3):
            near, far = (
                signal(s, p + k * h * axis, g) - signal(s, p - k * h * axis, g) for k in (1, 2)
            )
            columns.append(beta(s, p) * (8 * near - far).ravel() / (12 * h))
        D = np.stack([*columns, y.ravel(), 1j * y.ravel()], 1)
        J = 2 / (noise_power(s) / 2) * (D.conj().T @ D).real
        schur = J[:3, :3] - J[:3, 3:] @ np.linalg.solve(J[3:, 3:], J[3:, :3])
        np.testing.assert_allclose(expected, np.linalg.inv(schur), rtol=1e-6, atol=1e-12)


def test_information_in_delay_and_angles_is_carried_by_their_gradients():
    s = state(SMALL, True)
    J = ofdm.fisher_information(s, POINTS)
    for p, diagonal, S in zip(POINTS, J, ofdm.covariance(s, POINTS), strict=True):

        def parameters(x):
            q = array_offset(s, x)
            R = np.linalg.norm(q)
            return np.array([2 * R / LIGHT, np.arctan2(q[1], q[0]), np.arccos(q[2] / R)])

        h = 1e-4
        T = [(parameters(p + h * a) - parameters(p - h * a)) / (2 * h) for a in np.eye(3)]
        T = np.array(T).T
        np.testing.assert_allclose(np.linalg.inv(T.T * diagonal @ T), S, rtol=1e-6, atol=1e-9)


def test_detection_is_the_tail_of_the_matched_filter():
    s = state(FULL)
    for p, found in zip(POINTS, ofdm.p_detect(s, POINTS), strict=True):
        energy = (np.abs(gains(s, p)) ** 2).sum() * FULL.side**2 * FULL.subcarriers
        xi = 2 * beta(s, p) ** 2 * energy / (noise_power(s) / 2)
        # The envelope of signal and noise is Rician; its square exceeds -2 ln p_false.
        nu, threshold = np.sqrt(xi), np.sqrt(-2 * np.log(FULL.p_false))

        def rice(x, nu=nu):
            return x * np.exp(-((x - nu) ** 2) / 2) * i0e(x * nu)

        miss, _ = quad(rice, 0, threshold, epsabs=1e-13, epsrel=1e-11)
        assert found == pytest.approx(1 - miss, rel=1e-6)
    weak = Radar(transmit_density=-200.0)
    alone = State(weak, s.position, s.rotation, s.precoders)
    np.testing.assert_allclose(ofdm.p_detect(alone, POINTS), FULL.p_false, rtol=1e-2)


def test_resolution_is_the_inverse_volume_of_the_cell():
    s = state(FULL)
    for p, found in zip(POINTS, ofdm.resolution(s, POINTS), strict=True):
        q = array_offset(s, p)
        R, phi = np.linalg.norm(q), np.arctan2(q[1], q[0])
        theta = np.arccos(q[2] / R)
        width = LIGHT / (2 * FULL.bandwidth)
        d_phi = 2 / (5 * 23 * abs(np.sin(phi)))
        d_theta = 2 / (4 * 23 * abs(np.sin(theta)))
        shell, _ = quad(lambda r: r**2, R - width / 2, R + width / 2)
        polar, _ = quad(np.sin, theta - d_theta / 2, theta + d_theta / 2)
        assert found == pytest.approx(np.clip(1 / (shell * polar * d_phi), 1, 50), rel=1e-6)


def test_no_points_have_no_values():
    s, none = state(FULL), np.zeros((0, 3))
    assert ofdm.covariance(s, none).shape == (0, 3, 3)
    assert ofdm.p_detect(s, none).shape == ofdm.resolution(s, none).shape == (0,)


def test_resolution_is_one_where_the_cell_has_no_volume():
    assert ofdm.resolved(np.array([1.0, 0.0, 5.0]), 125e6, 24, 5.0, 4.0, 50.0) == 1.0


def test_beams_leave_the_aimed_direction_dark_but_for_the_directed():
    direction = np.array([0.6, 0.0, 0.8])
    f = ofdm.precoders(FULL, direction, 2, 8, np.random.default_rng(0))
    a = ofdm.response(FULL, direction)
    np.testing.assert_allclose(f @ a, [1, 1, *np.zeros(8)], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(f[2:], axis=1), 1.0)


def test_error_bounds_over_the_region_are_those_of_the_published_scene():
    from echoset.simulate import radar_extended

    params, rng = radar_extended.Params(), np.random.default_rng(1)
    x = rng.uniform(*params.box, (400, 3))
    states = [radar_extended.sensor_state(params, k, t, rng) for k in (0, 1) for t in range(6)]
    bound = np.concatenate([ofdm.error_bound(s, x) for s in states])
    quantiles = np.quantile(bound, [0.1, 0.5, 0.9])
    np.testing.assert_allclose(quantiles, [0.006, 0.044, 0.36], rtol=0.25)
    assert np.mean([ofdm.p_detect(s, x) for s in states]) == pytest.approx(0.98, abs=0.02)
