"""Range-angle maps symbol by symbol: the grid of eqs. 1-3, reciprocal filtering, periodogram.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section II-B.
What :mod:`echoset.simulate.spectral` draws by its law is computed here as the paper writes it,
for tests and small runs. The receiver's weights are applied to echoes and noise alike, so that the
noise of the combined grid element is drawn once, of unit power.
"""

from __future__ import annotations

import numpy as np

from ..models.radar.multibeam import BaseStation, Echoes, echo_amplitudes, frequencies
from ..models.records import Array


def range_angle_map(
    station: BaseStation,
    echoes: Echoes,
    communication: float,
    noisy: bool,
    rng: np.random.Generator,
) -> Array:
    """One scan of one station: linear power over the noise (R, A), float64.

    ``communication`` [rad] is where the communication beam points.
    """
    K, M, R = station.subcarriers, station.symbols, len(station.range_axis)
    delay, doppler = frequencies(station, echoes)
    over_k = np.exp(-2j * np.pi / K * np.outer(np.arange(K), delay))
    over_m = np.exp(2j * np.pi / M * np.outer(doppler, np.arange(M)))
    columns = []
    for a in echo_amplitudes(station, echoes, communication):
        X = qpsk(K, M, rng)
        Y = (over_k * a) @ over_m * X
        if noisy:
            Y += rng.standard_normal((K, M, 2)).view(complex)[..., 0] / np.sqrt(2)
        columns.append(strongest_column(Y / X, R))
    return np.stack(columns, axis=1)


def qpsk(subcarriers: int, symbols: int, rng: np.random.Generator) -> Array:
    """Random QPSK symbols x (K, M) of unit modulus."""
    quarter = rng.integers(4, size=(subcarriers, symbols))
    return np.asarray(np.exp(0.5j * np.pi * (quarter + 0.5)))


def strongest_column(G: Array, rows: int) -> Array:
    """The column (rows,) of the double periodogram of G (K, M) that holds the maximum there.

    Noise of unit power in the elements of G has unit power in the periodogram.
    """
    K, M = G.shape
    over_range = np.fft.ifft(G, axis=0)[:rows] * K
    periodogram = np.abs(np.fft.fft(over_range, axis=1)) ** 2 / (K * M)
    return np.asarray(periodogram[:, periodogram.max(axis=0).argmax()])
