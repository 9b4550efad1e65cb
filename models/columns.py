"""The columns that a recording may hold: their units, types and meaning.

A *scan* column has one value per scan or link event (``map`` an array over range and azimuth), a
*row* column one value per detection. *Evaluation* columns are for scoring: no estimator sees
them. Position covariances are upper triangles, ``cov_xx cov_xy cov_yy ...``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

ACTIVE, PASSIVE = 0, 1
MODES = ("active", "passive")
STREAM_KINDS = ("position", "range_bearing", "uwb", "range_angle_map")


@dataclass(frozen=True, slots=True)
class Column:
    """One column: storage type, CF unit, level, and what its values may be.

    ``missing`` allows NaN; ``flags`` names the codes 0, 1, ... of an enumeration; ``axes`` counts
    the axes of one value.
    """

    dtype: str
    unit: str
    long_name: str
    level: str = "row"
    evaluation: bool = False
    missing: bool = False
    minimum: float = -np.inf
    flags: tuple[str, ...] = ()
    axes: int = 0


def _covariance(axes: str) -> dict[str, Column]:
    pairs = [a + b for i, a in enumerate(axes) for b in axes[i:]]
    return {f"cov_{p}": Column("f8", "m2", f"noise covariance {p}") for p in pairs}


COLUMNS: dict[str, Column] = {
    "mode": Column("u1", "1", "link mode", "scan", flags=MODES),
    "tx": Column("i4", "1", "index of the transmitting node", "scan", minimum=0),
    "rx": Column("i4", "1", "index of the receiving node", "scan", minimum=0),
    "view_azimuth_min": Column("f8", "rad", "field of view, first azimuth", "scan"),
    "view_azimuth_max": Column("f8", "rad", "field of view, last azimuth", "scan"),
    "view_range_min": Column("f8", "m", "field of view, nearest range", "scan", minimum=0.0),
    "view_range_max": Column("f8", "m", "field of view, farthest range", "scan", minimum=0.0),
    "map": Column(
        "f4", "1", "range-angle map: linear power over the noise", "scan", minimum=0.0, axes=2
    ),
    "distance": Column("f8", "m", "measured path length", minimum=0.0),
    "amplitude": Column("f8", "1", "normalised amplitude, square root of the SNR", minimum=0.0),
    "std": Column("f8", "m", "standard deviation of the range noise", minimum=0.0),
    "x": Column("f8", "m", "x in the sensor frame"),
    "y": Column("f8", "m", "y in the sensor frame"),
    "z": Column("f8", "m", "z in the sensor frame"),
    "range": Column("f8", "m", "range", minimum=0.0),
    "azimuth": Column("f8", "rad", "azimuth, anticlockwise from the sensor's x axis"),
    "elevation": Column("f8", "rad", "elevation above the sensor's x-y plane"),
    "doppler": Column("f8", "m s-1", "radial speed, positive when receding"),
    "power": Column("f8", "1", "power over the noise", minimum=0.0),
    **_covariance("xyz"),
    "std_range": Column("f8", "m", "standard deviation of the range", minimum=0.0),
    "std_azimuth": Column("f8", "rad", "standard deviation of the azimuth", minimum=0.0),
    "time_offset": Column("f8", "s", "time of the detection after that of its scan"),
    "origin_id": Column("i4", "1", "label of the object, -1 for clutter", evaluation=True),
    "origin_los": Column("u1", "1", "path", evaluation=True, flags=("scattered", "direct")),
    "origin_x": Column("f8", "m", "x of the point of origin", evaluation=True, missing=True),
    "origin_y": Column("f8", "m", "y of the point of origin", evaluation=True, missing=True),
    "origin_z": Column("f8", "m", "z of the point of origin", evaluation=True, missing=True),
}

REQUIRED: dict[str, tuple[str, ...]] = {
    "position": ("x", "y"),
    "range_bearing": ("range", "azimuth"),
    "uwb": ("mode", "tx", "rx", "distance"),
    "range_angle_map": ("map",),
}
