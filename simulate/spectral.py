"""Range-angle maps without the symbols: the periodogram drawn bin by bin, by its exact law.

QPSK has unit modulus, so that noise stays white through reciprocal filtering, and unpadded DFT bins
of white noise are independent: a bin of the range-Doppler periodogram is |S + N|^2 with the echoes'
Dirichlet kernels S and N ~ CN(0, 1). Of each direction only the Doppler column that holds the
maximum within the range gate enters the map. A column can hold it only if the bound of its echoes
plus the root of its strongest noise does not stay below what has been found: columns are drawn in
the order of that bound, given their strongest noise, until none can win. What is left undrawn
changes nothing.
"""

from __future__ import annotations

import numpy as np

from ..models.radar.multibeam import BaseStation, Echoes, echo_amplitudes, frequencies
from ..models.records import Array
from .compiled import spectral as compiled


def dirichlet(n: int, bins: Array, frequency: Array) -> Array:
    """Mean of exp(2j pi k (f - b) / n) over k < n for ``frequency`` (L,), ``bins`` (B,): (L, B)."""
    x = frequency[:, None] - bins
    near = x - n * np.round(x / n)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sin(np.pi * near) / (n * np.sin(np.pi * near / n))
    ratio = np.where(near == 0, 1.0, ratio)
    return np.asarray(ratio * np.exp(1j * np.pi * (n - 1) / n * near))


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
    a = echo_amplitudes(station, echoes, communication)
    a *= np.sqrt(station.subcarriers * station.symbols)
    delay, doppler = frequencies(station, echoes)
    D_r = dirichlet(station.subcarriers, np.arange(len(station.range_axis)), delay).conj()
    D_c = dirichlet(station.symbols, np.arange(station.symbols), doppler)
    return compiled.strongest_columns(a, D_r, D_c, noisy, rng)


def strongest_columns(
    a: Array, D_r: Array, D_c: Array, noisy: bool, rng: np.random.Generator
) -> Array:
    """The map (R, A) of echoes a (A, L) with kernels D_r (L, R) and D_c (L, M)."""
    R, M = D_r.shape[1], D_c.shape[1]
    peak = np.abs(D_r).max(axis=1, initial=0.0)
    map_ = np.zeros((R, len(a)))
    for d in range(len(a)):
        bound = (np.abs(a[d]) * peak) @ np.abs(D_c)
        strongest = np.zeros(M)
        if noisy:
            strongest = -np.log(-np.expm1(np.log(rng.random(M)) / R))
        bound = bound + np.sqrt(strongest)
        best = -1.0
        for c in np.argsort(-bound, kind="mergesort"):
            if bound[c] ** 2 <= best:
                break
            z = (a[d] * D_c[:, c]) @ D_r
            if noisy:
                z = z + _noise(strongest[c], R, rng)
            power = z.real**2 + z.imag**2
            if power.max() > best:
                best = power.max()
                map_[:, d] = power
    return map_


def _noise(strongest: float, R: int, rng: np.random.Generator) -> Array:
    """Complex noise (R,) of unit mean power whose largest power is ``strongest``."""
    index = int(rng.random() * R)
    u = rng.random((R, 2))
    power = -np.log1p(u[:, 0] * np.expm1(-strongest))
    power[index] = strongest
    return np.asarray(np.sqrt(power) * np.exp(2j * np.pi * u[:, 1]))
