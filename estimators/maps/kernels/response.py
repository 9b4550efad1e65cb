"""Mean power of what reflects in the cells of range-angle maps, and how well it explains them.

An echo's power is exponential (Swerling I), so a cell is exponential about a mean to which echoes
and noise add. The mean is known only so well (beams that communicate, bodies that differ): with an
inverse-gamma mean of shape ``shape`` the cell D follows a Lomax law about mu,

    log p = shape log mu - (shape + 1) log(mu + D / shape) + terms without mu,

whose score d log p / d log mu = (D - mu) / (mu + D / shape) is bounded, and whose information per
cell is shape / (shape + 2).
"""

from __future__ import annotations

from math import pi

import numpy as np

from ....models.radar.reflectors import Reflectors, visibility
from ....models.records import Array

X, Y, Z, COS, SIN, R0, DR, A0, DA, GAIN, SPEED, BIN, LATE = range(13)
"""Columns of a station: place, cosine and sine of its yaw, first range and step [m], first azimuth
and step [rad], power of 1 m2 at 1 m over the noise, Doppler bins per m/s, range bin [m], and by how
much later than others it takes its map [s]."""
BEAM = 2000
"""Entries of a table of the beam over the difference of sines, from 0 to 2."""
POSITION_X, POSITION_Y, RCS, AXIS, INNER, OUTER = range(6)
"""Columns of a body's points."""
STEP = 0.02, 0.02, 0.02, 0.1, 0.003
"""Steps of x, y [m], heading [rad], log brightness and log size for derivatives."""


def reflecting(station: Array, body: Array, target: Array) -> tuple[Array, Array, Array, float]:
    """Slant range (L,), sine of azimuth (L,) and mean power (L,) of a body's points, and Doppler.

    ``station`` (13,) and ``body`` (L, 6) have the columns above; ``target`` (7,) is x, y, heading,
    log brightness, log size, vx, vy. What is behind the array has no power. Doppler is in bins.
    """
    x, y, heading, brightness, size, vx, vy = target
    x, y = x + station[LATE] * vx, y + station[LATE] * vy
    c, s = np.cos(heading), np.sin(heading)
    along, left = np.exp(size) * body[:, POSITION_X : POSITION_Y + 1].T
    px, py = x + c * along - s * left - station[X], y + s * along + c * left - station[Y]
    sight = np.arctan2(station[Y] - y, station[X] - x) - heading
    seen = visibility(Reflectors(body[:, :2], body[:, RCS], *body[:, AXIS : OUTER + 1].T), sight)
    r = np.sqrt(px**2 + py**2 + station[Z] ** 2)
    front = station[COS] * px + station[SIN] * py > 0
    sine = (station[COS] * py - station[SIN] * px) / r
    power = station[GAIN] * np.exp(brightness) * body[:, RCS] * seen * front / r**4
    dx, dy = x - station[X], y - station[Y]
    doppler = -station[SPEED] * (dx * vx + dy * vy) / np.sqrt(dx**2 + dy**2 + station[Z] ** 2)
    return r, sine, power, float(doppler)


def sinc2(x: Array) -> Array:
    """Squared modulus of a Dirichlet kernel of many terms at ``x`` bins from its middle."""
    return np.asarray(np.sinc(x) ** 2)


def add(
    out: Array,
    sign: float,
    station: Array,
    beam: Array,
    column: Array,
    body: Array,
    target: Array,
    window: Array,
) -> None:
    """Add ``sign`` times the mean power of a target in the ``window`` of one map, in place.

    ``out`` (R, A); ``beam`` (BEAM,) is the two-way gain over the difference of sines; ``column``
    (A,) the Doppler bin that is shown of each direction; ``window`` (4,) the first row and the row
    after the last, the same of columns.
    """
    i0, i1, j0, j1 = window
    r, sine, power, doppler = reflecting(station, body, target)
    rows = (station[R0] + station[DR] * np.arange(i0, i1)[:, None] - r) / station[BIN]
    towards = np.sin(station[A0] + station[DA] * np.arange(j0, j1))
    u = np.abs(towards[:, None] - sine) * (BEAM / 2)
    k = np.minimum(u.astype(np.int64), BEAM - 2)
    gain = beam[k] + (u - k) * (beam[k + 1] - beam[k])
    loss = sinc2(doppler - column[j0:j1])
    out[i0:i1, j0:j1] += sign * ((power * sinc2(rows)) @ (gain * loss[:, None]).T)


def strongest(
    column: Array, peak: Array, station: Array, beam: Array, body: Array, target: Array
) -> None:
    """Note a target's Doppler bin in ``column`` (A,) where it exceeds ``peak`` (A,), in place."""
    _, sine, power, doppler = reflecting(station, body, target)
    towards = np.sin(station[A0] + station[DA] * np.arange(len(column)))
    u = np.abs(towards[:, None] - sine) * (BEAM / 2)
    k = np.minimum(u.astype(np.int64), BEAM - 2)
    found = (beam[k] + (u - k) * (beam[k + 1] - beam[k])) @ power
    above = found > peak
    peak[above] = found[above]
    column[above] = np.round(doppler)


def log_likelihood(power: Array, mean: Array, shape: float) -> Array:
    """Log-likelihood (...) of cells given their mean, but for terms without it."""
    return np.asarray(shape * np.log(mean) - (shape + 1) * np.log(mean + power / shape))


def fit(
    power: Array,
    rest: Array,
    stations: Array,
    beams: Array,
    columns: Array,
    body: Array,
    target: Array,
    windows: Array,
    shape: float,
    derive: bool,
) -> tuple[float, Array, Array]:
    """What a target adds to the log-likelihood of its windows, and its score and information.

    ``power``, ``rest`` (S, R, A) are the maps and their mean without it; ``windows`` (S, 4).
    Gradient (5,) and expected information (5, 5) are those of x, y, heading, log brightness and
    log size; zeros unless ``derive``.
    """
    total, g, J = 0.0, np.zeros(5), np.zeros((5, 5))
    for q, (i0, i1, j0, j1) in enumerate(windows.tolist()):
        if i1 <= i0 or j1 <= j0:
            continue
        cells = np.s_[i0:i1, j0:j1]
        D, B = power[q][cells], rest[q][cells]

        def mean(x: Array, q: int = q, cells: tuple[slice, slice] = cells, B: Array = B) -> Array:
            T = np.zeros(power.shape[1:])
            add(T, 1.0, stations[q], beams[q], columns[q], body, x, windows[q])
            return np.asarray(B + T[cells])

        M = mean(target)
        total += (log_likelihood(D, M, shape) - log_likelihood(D, B, shape)).sum()
        if derive:
            score = (D - M) / (M + D / shape)
            slope = []
            for k, h in enumerate(STEP):
                up, down = target.copy(), target.copy()
                up[k] += h
                down[k] -= h
                slope.append((mean(up) - mean(down)) / (2 * h * M))
            d = np.stack(slope).reshape(len(STEP), -1)
            g += d @ score.ravel()
            J += shape / (shape + 2) * (d @ d.T)
    return float(total), g, J


def gains(power: Array, mean: Array, cell: Array, weight: Array, shape: float) -> Array:
    """What pedestrians at J places would add to the log-likelihood (J,) of a cell of each station.

    ``cell`` (J, S, 2) is the row and column of a place, -1 where the station does not see it;
    looked at is what exceeds its mean the most of that row and those beside it. ``weight`` (J, S)
    is the mean power of the pedestrian there.
    """
    out = np.zeros(len(cell))
    for q in range(cell.shape[1]):
        seen = np.flatnonzero(cell[:, q, 0] >= 0)
        i, j = cell[seen, q].T
        rows = np.clip(i[:, None] + np.array([0, -1, 1]), 0, power.shape[1] - 1)
        D, B = power[q][rows, j[:, None]], mean[q][rows, j[:, None]]
        k = np.arange(len(seen)), (D / B).argmax(1)
        M = B[k] + weight[seen, q]
        out[seen] += log_likelihood(D[k], M, shape) - log_likelihood(D[k], B[k], shape)
    return out


def two_way(transmit: int, receive: int, share: float, elsewhere: float) -> Array:
    """Beam (BEAM,) of half-wavelength line arrays over the difference of sines from 0 to 2.

    ``share`` of the power goes to the beam that senses; the other points to users, and its gain,
    amplitude and power alike, has the mean ``elsewhere`` over their directions.
    """
    u = np.linspace(0.0, 2.0, BEAM)

    def array(n: int) -> Array:
        with np.errstate(invalid="ignore", divide="ignore"):
            a = np.sin(n * pi * u / 2) / (n * np.sin(pi * u / 2))
        return np.where(np.isfinite(a) & (u > 0) & (u < 2), a, 1.0)

    ratio = (1 - share) / share
    sent = array(transmit)
    mean = sent**2 + 2 * np.sqrt(ratio) * elsewhere * np.abs(sent) + ratio * elsewhere
    return np.asarray(array(receive) ** 2 * mean)
