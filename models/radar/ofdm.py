"""A monostatic OFDM radar with a square planar array: error covariance, detection, resolution.

The echo of a point on subcarrier n, precoder t and element (i, j), two slots combined, is

    y = beta (a^T f_t) exp(-j 2 pi n spacing tau) b_ij(phi, theta) + w,    w ~ CN(0, p_n / 2),

with the two-way delay tau, the one-way response a and the two-way response b of twice its phase.
The array's axes are q = (s_z, s_x, -s_y) of a point s in the sensor's frame, with the azimuth
phi = atan2(q_y, q_x) and the polar angle theta = arccos(q_z / |q|). Eliminating the complex gain
beta leaves diagonal Fisher information for (tau, phi, theta); the derivative of a^T f_t is
neglected.

References
----------
Abu-Shaban et al., Error bounds for uplink and downlink 3D localization in 5G millimeter wave
systems, IEEE Trans. Wirel. Commun. 17(8), 2018; Wymeersch and Seco-Granados, Adaptive detection
probability for mmWave 5G SLAM, 6G SUMMIT 2020.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import ncx2

from ..records import Array

LIGHT = 299_792_458.0
"""Speed of light [m s-1]."""
MOUNTING = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""The array's axes as rows in the sensor's frame."""


@dataclass(frozen=True, slots=True)
class Radar:
    """Waveform, power and array: Hz, dBm/Hz, m2; ``side`` elements along each axis."""

    carrier: float = 30e9
    spacing: float = 125e3
    subcarriers: int = 1000
    side: int = 24
    rcs: float = 50.0
    transmit_density: float = -70.0
    noise_density: float = -140.0
    p_false: float = 1e-3
    azimuth_factor: float = 5.0
    elevation_factor: float = 4.0
    max_resolution: float = 50.0

    @property
    def bandwidth(self) -> float:
        """Bandwidth W [Hz]."""
        return self.subcarriers * self.spacing

    @property
    def wavelength(self) -> float:
        """Wavelength [m] at the carrier."""
        return LIGHT / self.carrier

    @property
    def pitch(self) -> float:
        """Distance of the elements [m]: half a wavelength at the upper end of the band."""
        return LIGHT / (self.carrier + self.bandwidth / 2) / 2

    @property
    def noise_power(self) -> float:
        """Noise power p_n [W] per subcarrier."""
        return float(10 ** (self.noise_density / 10 - 3) * self.spacing)

    @property
    def transmit_power(self) -> float:
        """Transmitted power p_tx [W] per subcarrier."""
        return float(10 ** (self.transmit_density / 10 - 3) * self.spacing)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """A radar at one epoch: ``position`` (3,) [m], ``rotation`` (3, 3) sensor to map, and the
    ``precoders`` (T, side^2), complex."""

    radar: Radar
    position: Array
    rotation: Array
    precoders: Array


def local(state: State, points: Array) -> tuple[Array, Array]:
    """Points (..., 3) of the map along the array's axes, q (..., 3), and their range (...)."""
    q = (points - state.position) @ (state.rotation @ MOUNTING.T)
    return q, np.linalg.norm(q, axis=-1)


def response(radar: Radar, direction: Array) -> Array:
    """One-way response a (..., side^2) to the unit vector ``direction`` (..., 3), array axes."""
    step = np.arange(radar.side)
    phase = -2j * np.pi * radar.pitch / radar.wavelength
    first, second = (np.exp(phase * direction[..., k, None] * step) for k in (0, 1))
    both = first[..., :, None] * second[..., None, :]
    return np.asarray(both.reshape(*first.shape[:-1], radar.side**2))


def precoders(
    radar: Radar, direction: Array, directed: int, others: int, rng: np.random.Generator
) -> Array:
    """``directed`` beams conj(a) / |a|^2 along ``direction``, ``others`` of one unit vector.

    The unit vector is random and leaves no power in that direction; (directed + others, side^2).
    """
    a = response(radar, direction)
    v = rng.normal(size=(2, a.size)).T @ np.array([1, 1j])
    v -= a.conj() * (a @ v) / a.size
    beams = np.tile(a.conj() / a.size, (directed, 1)), np.tile(v, (others, 1))
    return np.vstack((beams[0], beams[1] / np.linalg.norm(v)))


def snr(state: State, points: Array) -> Array:
    """4 |beta|^2 G / p_n (...): what scales information and detection; G = sum |a^T f_t|^2."""
    radar = state.radar
    q, R = local(state, points)
    a = response(radar, q / R[..., None])
    G = (np.abs(a @ state.precoders.T) ** 2).sum(-1)
    beta2 = radar.transmit_power * radar.wavelength**2 * radar.rcs / ((4 * np.pi) ** 3 * R**4)
    return np.asarray(4 * beta2 * G / radar.noise_power)


def _per_snr(radar: Radar) -> tuple[float, float]:
    """Information per :func:`snr` for the delay [s-2] and for the array's phase slope [rad-2]."""
    n = np.arange(-radar.subcarriers // 2 + 1, radar.subcarriers // 2 + 1, dtype=float)
    F0, F1, F2 = len(n), n.sum(), (n**2).sum()
    kappa = 4 * np.pi * radar.pitch / radar.wavelength
    delay = (2 * np.pi * radar.spacing) ** 2 * radar.side**2 * (F2 - F1**2 / F0)
    return float(delay), float(kappa**2 * F0 * radar.side**2 * (radar.side**2 - 1) / 12)


def fisher_information(state: State, points: Array) -> Array:
    """Diagonal (..., 3) of the equivalent information for (tau [s], phi, theta [rad])."""
    delay, slope = _per_snr(state.radar)
    q, R = local(state, points)
    cos2 = (q[..., 2] / R) ** 2
    J = np.stack([np.full_like(R, delay), slope * (1 - cos2), slope * cos2], -1)
    return np.asarray(snr(state, points)[..., None] * J)


def covariance(state: State, points: Array) -> Array:
    """Position error covariance (T^T J T)^+ (..., 3, 3) [m2] of points (..., 3) of the map.

    The gradients T of delay, azimuth and polar angle are orthogonal, of lengths 2 / c, 1 / (R sin
    theta) and 1 / R, so that each of the three directions has a variance of its own.
    """
    delay, slope = _per_snr(state.radar)
    q, R = local(state, points)
    radial = q / R[..., None]
    azimuth = np.arctan2(q[..., 1], q[..., 0])
    across = np.stack([-np.sin(azimuth), np.cos(azimuth), np.zeros_like(R)], -1)
    cos2 = radial[..., 2] ** 2
    bearing = slope / R**2
    J = np.stack([np.full_like(R, (2 / LIGHT) ** 2 * delay), bearing, bearing * cos2], -1)
    J *= snr(state, points)[..., None]
    variance = np.divide(1.0, J, out=np.zeros_like(J), where=J > 0)
    axes = np.stack([radial, across, np.cross(radial, across)], -1)
    U = state.rotation @ MOUNTING.T @ axes
    return np.asarray(U * variance[..., None, :] @ U.swapaxes(-1, -2))


def error_bound(state: State, points: Array) -> Array:
    """Position error bound, the root of the covariance's trace (...) [m]."""
    return np.asarray(np.sqrt(np.trace(covariance(state, points), axis1=-2, axis2=-1)))


def p_detect(state: State, points: Array) -> Array:
    """Probability (...) that the matched filter's output exceeds the threshold of p_false."""
    radar = state.radar
    xi = snr(state, points) * radar.side**2 * radar.subcarriers
    return np.asarray(ncx2.sf(-2 * np.log(radar.p_false), 2, xi))


def resolution(state: State, points: Array) -> Array:
    """Points that are resolved per volume (...) [m-3]: the inverse of the cell, bounded."""
    r = state.radar
    factors = r.azimuth_factor, r.elevation_factor
    return resolved(local(state, points)[0], r.bandwidth, r.side, *factors, r.max_resolution)


def resolved(
    q: Array,
    bandwidth: float,
    side: float,
    azimuth_factor: float,
    elevation_factor: float,
    max_resolution: float,
) -> Array:
    """The same for points q (..., 3) along the array's axes; 1 where the cell has no volume."""
    R = np.linalg.norm(q, axis=-1)
    phi = np.arctan2(q[..., 1], q[..., 0])
    theta = np.arccos(q[..., 2] / R)
    delta, tau = 1 / (2 * bandwidth), R / LIGHT
    shell = LIGHT**3 / 3 * ((tau + delta / 2) ** 3 - (tau - delta / 2) ** 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        d_phi = 2 / (azimuth_factor * (side - 1) * np.abs(np.sin(phi)))
        d_theta = 2 / (elevation_factor * (side - 1) * np.abs(np.sin(theta)))
        V = d_phi * (np.cos(theta - d_theta / 2) - np.cos(theta + d_theta / 2)) * shell
    r = np.divide(1.0, V, out=np.ones_like(R), where=V > 0)
    return np.asarray(np.clip(r, 1.0, max_resolution))
