"""A truth fitted to ranges: its frame, its clock, or both, by robust least squares.

A reference has a frame and a clock of its own. At the true position p(t) of the device, an anchor
at a measures ``d = |R p(t - tau) + s - a| + b``, with a height h between them that the plane does
not tell and an offset b that all ranges share; one of the two alone, if it explains the ranges
nearly as well, since both make ranges too long. Rotation R and shift s (``rigid``), the delay tau
(``time``) or all of them (``both``) minimise the soft absolute values of the residuals from many
beginnings, and then the squares of those that are within four standard deviations, so that ranges
along detours do not count. The fit takes freedom from the score that follows, and the provenance
says how much.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ....models.columns import ACTIVE
from ....models.errors import InputError
from ....models.geometry.poses import FITS, Placement
from ....models.records import Array, Sensor, Stream, Truth

MODES = ("", *FITS)
_SHIFT = 10.0
"""Largest delay that is looked for [s]."""
_SOFT = 0.1
"""Residual from which on a range counts less [m]."""
_HEIGHT, _OFFSET = (4,), (5,)
"""What is not fitted where a height alone, or an offset alone, explains the ranges."""
_ALIKE = 1.3
"""Ratio of typical residuals up to which the simpler explanation will do."""
_BEGINS = 16
"""Beginnings, the best of all, that are followed."""
_LEAST = 30
"""Ranges without which nothing is fitted."""


def align(
    truth: Truth, stream: Stream, sensors: Mapping[str, Sensor], mode: str
) -> tuple[Truth, dict[str, Any]]:
    """The truth on the clock and in the frame of the ranges, and what was fitted, for provenance.

    Raises
    ------
    InputError : the truth is not one device, or there are too few ranges along with it
    """
    from scipy.optimize import least_squares

    o = truth.objects
    if "device_x" not in o.state_names or len(np.unique(o.label)) != 1:
        raise InputError("truth: align needs device_x and device_y of one object")
    known = o.time_ns[np.repeat(np.arange(len(o.time_ns)), np.diff(o.row_offset))] * 1e-9
    track = o.columns("device_x", "device_y")
    time, distance, anchor = _ranges(stream, sensors)
    margin = _SHIFT if mode != "rigid" else 0.0
    inside = (time >= known[0] + margin) & (time <= known[-1] - margin)
    if inside.sum() < _LEAST:
        inside = (time >= known[0]) & (time <= known[-1])
    if inside.sum() < _LEAST:
        spans = f"it is from {known[0]:.9g} to {known[-1]:.9g} s"
        if len(time):
            spans += f", the ranges from {time.min():.9g} to {time.max():.9g} s"
        hint = "tell about by how much its clock differs, 'clock: {offset: ...}'"
        raise InputError(f"truth: align needs {_LEAST} ranges within its times: {spans}: {hint}")
    # Times since 1970 have too few digits left for the small steps of a derivative.
    time, distance, anchor = time[inside] - known[0], distance[inside], anchor[inside]
    known = known - known[0]
    free = np.array([mode != "time"] * 3 + [mode != "rigid", True, True])

    def residuals(values: Array, every: int = 1) -> Array:
        theta, x, y, delay, offset, height = _full(values, free)
        at = [np.interp(time[::every] - delay, known, track[:, k]) for k in (0, 1)]
        c, s = np.cos(theta), np.sin(theta)
        a = anchor[::every]
        dx, dy = c * at[0] - s * at[1] + x - a[:, 0], s * at[0] + c * at[1] + y - a[:, 1]
        return np.asarray(np.sqrt(dx**2 + dy**2 + height**2) + offset - distance[::every])

    centre = anchor[:, :2].mean(axis=0)
    every = max(1, len(time) // 300)
    begins = []
    for theta in np.arange(8) * np.pi / 4 if mode != "time" else [0.0]:
        c, s = np.cos(theta), np.sin(theta)
        shift = centre - np.array([[c, -s], [s, c]]) @ track.mean(axis=0)
        for delay in np.arange(-_SHIFT, _SHIFT + 1, 2.0) if mode != "rigid" else [0.0]:
            begins.append(np.array([theta, *shift, delay, 0.0, 1.0])[free])
    said: dict[str, Any] = {"loss": "soft_l1", "f_scale": _SOFT}
    begins.sort(key=lambda b: float(np.sum(np.sqrt(1 + (residuals(b, every) / _SOFT) ** 2))))
    coarse = [
        least_squares(residuals, b, args=(every,), x_scale="jac", max_nfev=30, **said)
        for b in begins[:_BEGINS]
    ]
    best = min(coarse, key=lambda fit: float(fit.cost)).x
    full = _full(best, free)
    refined = []
    for alone in (_HEIGHT, _OFFSET, ()):
        free[4:] = [k not in alone for k in (4, 5)]
        begin = np.where(np.arange(6) == 5, max(abs(full[5]), 1.0), full)[free]
        fit = least_squares(residuals, begin, x_scale="jac", **said)
        for _ in range(3):
            r = residuals(fit.x) - np.median(residuals(fit.x))
            kept = np.abs(r) <= 4 * 1.4826 * np.median(np.abs(r))
            fit = least_squares(lambda v, kept=kept: residuals(v)[kept], fit.x, x_scale="jac")
        typical = float(np.median(np.abs(residuals(fit.x))))
        refined.append((typical, int(free.sum()), kept, _full(fit.x, free)))
    least = min(one[0] for one in refined)
    typical, count, kept, full = next(o for o in refined if o[0] <= _ALIKE * least)
    theta, x, y, delay, offset, height = full
    placement = Placement(*map(float, (theta, x, y, delay)))
    found = {
        "mode": mode,
        "fitted": count,
        "ranges": int(kept.sum()),
        "left_out": int((~kept).sum()),
        **placement.told,
        "range_offset": float(offset),
        "height": float(abs(height)),
        "median_residual": typical,
    }
    return replace(truth, objects=placement.of(o)), found


def _full(values: Array, free: Array) -> Array:
    full = np.zeros(len(free))
    full[free] = values
    return full


def _ranges(stream: Stream, sensors: Mapping[str, Sensor]) -> tuple[Array, Array, Array]:
    """Times [s], distances [m] and anchors' positions (m, 3) of the active links of one device."""
    event = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
    event_ok = (stream.scan["mode"] == ACTIVE)[event]
    event, distance = event[event_ok], stream.rows["distance"][event_ok]
    if len(np.unique(stream.scan["tx"][event])) > 1:
        raise InputError("truth: align needs the ranges of one device: skip the others")
    time = stream.time_ns[event] * 1e-9
    anchor = np.zeros((len(event), 3))
    for node in np.unique(stream.scan["rx"][event]).tolist():
        own, sensor = stream.scan["rx"][event] == node, sensors[stream.nodes[node]]
        for k in range(3):
            anchor[own, k] = np.interp(time[own], sensor.time_ns * 1e-9, sensor.position[:, k])
    return time, distance, anchor
