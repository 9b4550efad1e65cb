"""A base station that senses with its communication waveform: OFDM, multibeam, range-angle map.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", sections II
and IV. Two half-wavelength line arrays share a centre and a normal, the sensor's x axis; phases are
those of the centre. Echoes are written in units of the noise: after reciprocal filtering and the
double periodogram of K subcarriers and M_s symbols, noise has unit power in every bin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..parameters import parameter, require
from ..records import Array
from .ofdm import LIGHT


@dataclass(frozen=True, slots=True)
class BaseStation:
    """Waveform, power, arrays and scan of a base station (section IV-B)."""

    TITLE = "base stations"

    carrier: float = parameter(28e9, "Hz", "carrier frequency f_c", within="(0, inf)")
    spacing: float = parameter(120e3, "Hz", "subcarrier spacing", within="(0, inf)")
    subcarriers: int = parameter(3168, "1", "subcarriers K", within="[1, inf)")
    symbols: int = parameter(
        112, "1", "OFDM symbols M_s collected in a direction", within="[1, inf)"
    )
    cyclic_prefix: float = parameter(
        0.586e-6, "s", "duration of the cyclic prefix, choice", within="[0, inf)"
    )
    transmit_elements: int = parameter(
        50, "1", "elements N_T of the transmitting array", within="[1, inf)"
    )
    receive_elements: int = parameter(
        50, "1", "elements N_R of the receiving array", within="[1, inf)"
    )
    eirp: float = parameter(30.0, "dBm", "equivalent isotropic radiated power of an undivided beam")
    noise_density: float = parameter(
        4e-20, "W Hz-1", "noise power density N_0 at the receiver", within="(0, inf)"
    )
    sensing_power: float = parameter(
        0.3, "1", "share rho_p of the power in the sensing beam", within="[0, 1]"
    )
    aperture: float = parameter(
        np.pi / 3,
        "rad",
        "directions are scanned from minus to plus this",
        within=f"(0, {np.pi / 2})",
    )
    scan_step: float = parameter(
        np.pi / 75, "rad", "step from direction to direction", within="(0, inf)"
    )
    max_range: float = parameter(
        85.0, "m", "range gate: the map ends here, choice", within="(0, inf)"
    )

    def __post_init__(self) -> None:
        farthest = self.subcarriers * self.range_bin
        require(self.max_range < farthest, "max_range", f"below {farthest:g} m", self.max_range)

    @property
    def range_bin(self) -> float:
        """Range resolution c / (2 K spacing) [m]."""
        return LIGHT / (2 * self.subcarriers * self.spacing)

    @property
    def symbol_time(self) -> float:
        """Duration T_s [s] of a symbol with its prefix."""
        return 1 / self.spacing + self.cyclic_prefix

    @property
    def scan_time(self) -> float:
        """Time [s] that all directions together take."""
        return len(self.azimuth_axis) * self.symbols * self.symbol_time

    @property
    def range_axis(self) -> Array:
        """Ranges (R,) [m] of the map's rows, within the gate."""
        return np.arange(int(self.max_range / self.range_bin) + 1) * self.range_bin

    @property
    def azimuth_axis(self) -> Array:
        """Directions (A,) [rad] of the map's columns, as many steps as fit, about the normal."""
        steps = int(round(2 * self.aperture / self.scan_step, 6))
        return (np.arange(steps + 1) - steps / 2) * self.scan_step

    @property
    def power(self) -> float:
        """EIRP of a subcarrier over the noise power in it."""
        return float(10 ** (self.eirp / 10 - 3) / (self.subcarriers * self.spacing)) / (
            self.noise_density
        )


@dataclass(frozen=True, slots=True, eq=False)
class Echoes:
    """Echoes of one scan: range (L,) [m], azimuth (L,) [rad], radial speed (L,) [m s-1, receding]
    and path gain beta (L,), complex, of unit antennas."""

    range: Array
    azimuth: Array
    speed: Array
    beta: Array


def path_gain(station: BaseStation, distance: Array, rcs: Array) -> Array:
    """Modulus |beta| (L,) of the path gain: the radar equation in eq. 4."""
    area = LIGHT**2 * rcs / ((4 * np.pi) ** 3 * station.carrier**2)
    return np.asarray(np.sqrt(area) / distance**2)


def reference_echo(station: BaseStation, distance: float) -> float:
    """Mean power in the map, over the noise, of 1 m2 at ``distance`` [m], where its beam points."""
    beta2 = path_gain(station, np.array(distance), np.array(1.0)) ** 2
    gain = station.sensing_power * station.receive_elements
    return float(station.power * gain * station.subcarriers * station.symbols * beta2)


def space(offset: Array, facing: float, height: float) -> tuple[Array, Array]:
    """Slant range (n,) [m] and azimuth (n,) [rad] of places on the ground, as line arrays see them.

    ``offset`` (n, 2) [m] is from the foot of the station, which is ``height`` above them. A line
    array sees the angle to its normal plane: arcsin of what lies along it over the range.
    """
    azimuth = np.arctan2(offset[:, 1], offset[:, 0]) - facing
    azimuth -= 2 * np.pi * np.round(azimuth / (2 * np.pi))
    distance = np.hypot(*offset.T)
    if height == 0:
        return distance, azimuth
    x, y = distance * np.cos(azimuth), distance * np.sin(azimuth)
    return np.hypot(distance, height), np.arctan2(y, np.copysign(np.hypot(x, height), x))


def steering(elements: int, azimuth: Array) -> Array:
    """Response a(theta) (..., elements) of a half-wavelength line array."""
    n = np.arange(elements) - (elements - 1) / 2
    return np.asarray(np.exp(1j * np.pi * n * np.sin(azimuth)[..., None]))


def beamformer(station: BaseStation, sensing: float, communication: float) -> Array:
    """The transmitter's weights w_T (N_T,) of eq. 1, for sqrt(P_T G_T^a) = 1."""
    rho, N = station.sensing_power, station.transmit_elements
    s, c = steering(N, np.array([sensing, communication])).conj()
    return np.asarray((np.sqrt(rho) * s + np.sqrt(1 - rho) * c) / N)


def echo_amplitudes(station: BaseStation, echoes: Echoes, communication: float) -> Array:
    """Complex amplitudes (A, L) per antenna-combined grid element, noise of unit power there.

    For every sensing direction: w_R^T a_R(theta_l) a_T^T(theta_l) w_T beta_l of eqs. 1-3, with
    the receiver's weights conj(a_R) towards it, over the root of the combined noise power N_R.
    """
    transmit = steering(station.transmit_elements, echoes.azimuth)
    receive = steering(station.receive_elements, echoes.azimuth)
    towards = station.azimuth_axis
    w_T = np.array([beamformer(station, a, communication) for a in towards])
    w_R = steering(station.receive_elements, towards).conj()
    gain = (w_T @ transmit.T) * (w_R @ receive.T) / np.sqrt(station.receive_elements)
    return np.asarray(np.sqrt(station.power) * gain * echoes.beta)


def frequencies(station: BaseStation, echoes: Echoes) -> tuple[Array, Array]:
    """Delay and Doppler (L,) of the echoes in bins of the periodogram."""
    doppler = -2 * echoes.speed * station.carrier / LIGHT
    return echoes.range / station.range_bin, doppler * station.symbols * station.symbol_time


def capacity(
    station: BaseStation, sensing: int, stations: int, snr: float, share: float | None = None
) -> float:
    """Aggregate capacity [bit s-1] of eq. 17 with ``sensing`` of ``stations`` also sensing.

    ``snr`` is linear, that of the users; ``share`` stands for the station's own rho_p.
    """
    rho = station.sensing_power if share is None else share
    bandwidth = station.spacing * station.subcarriers
    both = sensing * np.log2(1 + (1 - rho) * snr)
    alone = (stations - sensing) * np.log2(1 + snr)
    return float(bandwidth * (both + alone) / stations)
