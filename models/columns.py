"""What a record holds: its leaves, and the columns of streams, with their units and meaning.

Checks, units, digests, windows, the topics of MCAP and the tables of ``docs/formats.md`` follow
from what is declared here. A *scan* column has one value per scan or link event (``map`` an array
over range and azimuth), a *row* column one value per detection. *Evaluation* columns are for
scoring: no estimator sees them. Position covariances are upper triangles, ``cov_xx cov_xy ...``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

ACTIVE, PASSIVE, TDOA = 0, 1, 2
MODES = ("active", "passive", "tdoa")
STREAM_KINDS = ("position", "range_bearing", "uwb", "range_angle_map", "odometry")


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
    "reference": Column(
        "i4", "1", "index of the node whose distance is taken off; -1: none", "scan"
    ),
    "velocity_x": Column(
        "f8", "m s-1", "velocity forward, in the body's frame", "scan", missing=True
    ),
    "velocity_y": Column(
        "f8", "m s-1", "velocity to the left, in the body's frame", "scan", missing=True
    ),
    "turn_rate": Column("f8", "rad s-1", "turn rate, anticlockwise", "scan", missing=True),
    "heading": Column(
        "f8", "rad", "heading, anticlockwise from the map's x axis", "scan", missing=True
    ),
    **{
        f"std_{name}": Column(
            "f8", unit, f"standard deviation of {name}", "scan", missing=True, minimum=0.0
        )
        for name, unit in (
            ("velocity_x", "m s-1"),
            ("velocity_y", "m s-1"),
            ("turn_rate", "rad s-1"),
            ("heading", "rad"),
        )
    },
    "view_azimuth_min": Column("f8", "rad", "field of view, first azimuth", "scan"),
    "view_azimuth_max": Column("f8", "rad", "field of view, last azimuth", "scan"),
    "view_range_min": Column("f8", "m", "field of view, nearest range", "scan", minimum=0.0),
    "view_range_max": Column("f8", "m", "field of view, farthest range", "scan", minimum=0.0),
    "map": Column(
        "f4", "1", "range-angle map: linear power over the noise", "scan", minimum=0.0, axes=2
    ),
    "distance": Column("f8", "m", "measured path length"),
    "amplitude": Column("f8", "1", "normalised amplitude, square root of the SNR", minimum=0.0),
    "std": Column("f8", "m", "standard deviation of the range noise", minimum=0.0),
    "x": Column("f8", "m", "x in the sensor frame"),
    "y": Column("f8", "m", "y in the sensor frame"),
    "z": Column("f8", "m", "z in the sensor frame"),
    "range": Column("f8", "m", "range", minimum=0.0),
    "azimuth": Column("f8", "rad", "azimuth, anticlockwise from the sensor's x axis"),
    "elevation": Column("f8", "rad", "elevation above the sensor's x-y plane"),
    "doppler": Column("f8", "m s-1", "radial speed, positive when receding"),
    "std_doppler": Column("f8", "m s-1", "standard deviation of the radial speed", minimum=0.0),
    "power": Column("f8", "1", "power over the noise", minimum=0.0),
    "rcs": Column("f8", "m2", "radar cross-section", minimum=0.0),
    **_covariance("xyz"),
    "std_range": Column("f8", "m", "standard deviation of the range", minimum=0.0),
    "std_azimuth": Column("f8", "rad", "standard deviation of the azimuth", minimum=0.0),
    "time_offset": Column("f8", "s", "time of the detection after that of its scan"),
    "origin_id": Column("i4", "1", "label of the object, -1 for clutter", evaluation=True),
    "origin_los": Column("u1", "1", "path", evaluation=True, flags=("scattered", "direct")),
    "origin_x": Column("f8", "m", "x of the point of origin", evaluation=True, missing=True),
    "origin_y": Column("f8", "m", "y of the point of origin", evaluation=True, missing=True),
    "origin_z": Column("f8", "m", "z of the point of origin", evaluation=True, missing=True),
    **{
        f"origin_{name}": replace(
            column, long_name=f"true {column.long_name}", evaluation=True, missing=True
        )
        for name, column in _covariance("xyz").items()
    },
}

REQUIRED: dict[str, tuple[str, ...]] = {
    "position": ("x", "y"),
    "range_bearing": ("range", "azimuth"),
    "uwb": ("mode", "tx", "rx", "distance"),
    "range_angle_map": ("map",),
    "odometry": (),
}

TEXT, TEXTS, INTEGER, VALUE = "text", "texts", "integer", "number, text, boolean, array `f8`"
INTEGERS, NUMBERS, COLUMN = "integers", "numbers", ""


@dataclass(frozen=True, slots=True)
class Leaf:
    """A leaf at ``path``, in which ``<name>`` stands for any name.

    ``type`` is that of NumPy, or one of the words above; ``shape`` names its axes: ``n`` and ``b``
    count the times of a table, ``m`` its rows. What is ``hidden`` no estimator may see.
    """

    path: str
    type: str
    shape: tuple[str, ...] = ()
    unit: str = ""
    meaning: str = ""
    optional: bool = False
    hidden: bool = False

    @property
    def name(self) -> str:
        """The last part of the path."""
        return self.path.rpartition("/")[2]

    @property
    def grows(self) -> bool:
        """Whether there is a value for each time or row of a table."""
        return self.shape[:1] in (("n",), ("n+1",), ("b",), ("m",))

    @property
    def per_row(self) -> bool:
        """Whether there is a value for each row, not for each time."""
        return self.shape[:1] == ("m",)


def _hidden(path: str, type: str, shape: str, unit: str, meaning: str) -> Leaf:
    return Leaf(path, type, tuple(shape.split()), unit, meaning, hidden=True)


def _leaf(path: str, type: str, shape: str = "", unit: str = "", meaning: str = "") -> Leaf:
    return Leaf(path, type, tuple(shape.split()), unit, meaning)


def _optional(path: str, type: str, shape: str = "", unit: str = "", meaning: str = "") -> Leaf:
    return Leaf(path, type, tuple(shape.split()), unit, meaning, optional=True)


MODEL = (
    "p_detect", "clutter_rate", "max_range", "std_doppler", "doppler_max", "mean_clutter",
    "mean_scatter", "mean_los", "rms_bandwidth", "amplitude_threshold", "sigma", "range_bias_std",
)  # fmt: skip
"""Entries of sensor models that are numbers and not negative."""

META = (    _hidden("kind", TEXT, "", "", "`recording` or `estimates`"),
    _leaf("name", TEXT, meaning="base name of the recording, the same for its estimates; keys "
          "random streams and fills the column `recording` of scores"),
    _leaf("epoch", TEXT, meaning="what times count from, ISO 8601; `1970-01-01T00:00:00Z` for "
          "simulations"),
    _leaf("frame", TEXT, meaning="name of the map's frame"),
    _leaf("origin", TEXT, meaning="where the map's origin lies on Earth, free text, may be empty"),
    _hidden("provenance", TEXT, "", "", "a JSON object of plain data with sorted keys: where "
            "the record comes from, see [Reproducibility](reproducibility.md)"),
)  # fmt: skip

SENSOR = (
    _leaf("kind", TEXT, meaning="`radar`, `anchor` or `device`"),
    _leaf("object", INTEGER, meaning="label of the true object that carries it, -1 for none"),
    _leaf("time_ns", "i8", "k", "ns", "times of its poses, increasing; k = 0 only for a device, "
          "whose place nobody knows"),
    _leaf("position", "f8", "k 3", "m", "position in the map; interpolated between samples, "
          "constant outside"),
    _leaf("quaternion", "f8", "k 4", "1", "unit quaternion, sensor to map"),
)  # fmt: skip

STREAM = (
    _leaf("kind", TEXT, meaning="`position`, `range_bearing`, `range_angle_map`, `uwb` or "
          "`odometry`"),
    _leaf("nodes", TEXTS, meaning="its sensors: one radar, the anchors and devices that `tx`, "
          "`rx` and `reference` count into from 0, or the device whose body odometry moves"),
    _leaf("model/<name>", VALUE, "", "as the parameter", "sensor model: what estimators take as "
          "parameters where names agree, and axes and tables, see below"),
    _leaf("time_ns", "i8", "n", "ns", "time of each scan or link event, never falling; each radar "
          "scan has a time of its own"),
    _leaf("row_offset", "i8", "n+1", "1"),
    _leaf("scan/<column>", COLUMN, "n ...", "", "*columns* in the reference with a value per "
          "scan, `map` (n, range, azimuth)"),
    _leaf("rows/<column>", COLUMN, "m", "", "*columns* in the reference with a value per "
          "detection"),
)  # fmt: skip

OBJECTS = (
    _leaf("time_ns", "i8", "n", "ns", "times; increasing for truth, never falling for estimates"),
    _leaf("row_offset", "i8", "n+1", "1"),
    _leaf("label", "i8", "m", "1", "which object, the same over time, at most once at a time"),
    _leaf("state_names", TEXTS, meaning="names (dx) of the state's entries: `x y z` centre, "
          "`vx vy vz` velocity, `device_x device_y` position of a device that the object carries; "
          "others as the estimator has them"),
    _leaf("state_units", TEXTS, meaning="their units (dx), `m`, `m s-1`, `rad`, `1`"),
    _leaf("state", "f8", "m dx", "see state_units", "the state"),
    _optional("covariance", "f8", "m dx dx", "see state_units", "optional; symmetric and positive "
              "semidefinite, in products of `state_units`"),
    _optional("existence", "f8", "m", "1", "optional; probability of existence, or weight"),
    _optional("class_names", TEXTS, meaning="optional; names of classes (c)"),
    _optional("class_index", INTEGERS, "m", "1", "optional; index into `class_names`"),
    _optional("class_probability", "f8", "m c", "1", "optional"),
    _optional("extent_kind", TEXT, meaning="optional; `circle`, `ellipse`, `rectangle` (in the "
              "plane) or `ellipsoid`"),
    _optional("semi_axes", "f8", "m a", "m", "with `extent_kind`; half lengths along the object's "
              "own axes, a = 2, 3 for ellipsoids"),
    _optional("rotation", "f8", "m ...", "rad", "with `extent_kind`; angle, or quaternion (m, 4) "
              "for ellipsoids, object to map"),
)  # fmt: skip

BLOCKED = (
    _leaf("time_ns", "i8", "b", "ns", "active link events that delivered nothing because "
          "something stood in the way"),
    _leaf("tx", "i4", "b", "1", "the node that sent, as in the first UWB stream by name"),
    _leaf("rx", "i4", "b", "1", "the node that would have received"),
)  # fmt: skip

STEPS = (
    _optional("cardinality_mean", "f8", "n", "1", "mean of the number of objects, where the "
              "estimator has it"),
    _optional("cardinality_variance", "f8", "n", "1", "its variance"),
    _optional("<name>", NUMBERS, "n ...", "1", "diagnostics of the estimator, a value or array per "
              "time"),
)  # fmt: skip


def _below(group: str, leaves: tuple[Leaf, ...], hidden: bool = False) -> tuple[Leaf, ...]:
    return tuple(
        replace(leaf, path=f"{group}/{leaf.path}", hidden=hidden or leaf.hidden) for leaf in leaves
    )


RECORDING = (
    *META,
    *_below("sensors/<sensor>", SENSOR),
    *_below("streams/<stream>", STREAM),
    *_below("truth/objects", OBJECTS, hidden=True),
    *_below("truth/blocked", BLOCKED, hidden=True),
)
ESTIMATES = (*META, *_below("objects", OBJECTS), *_below("steps", STEPS))

UNITS = {leaf.name: leaf.unit for leaf in (*SENSOR, *STREAM, *OBJECTS, *BLOCKED) if leaf.unit}
"""Units by name, which arrays go by that have a name of the user's."""


@lru_cache(1 << 12)
def declared(path: str) -> Leaf | None:
    """What is declared of the leaf at ``path``, in a recording that travels along too."""
    parts = path.removeprefix("recording/").split("/")
    for leaf in (*RECORDING, *ESTIMATES):
        pattern = leaf.path.split("/")
        if len(pattern) == len(parts) and all(
            name == part or name[:1] == "<" for name, part in zip(pattern, parts, strict=True)
        ):
            column = COLUMNS.get(parts[-1]) if leaf.type == COLUMN else None
            return leaf if column is None else replace(leaf, hidden=column.evaluation)
    return None
