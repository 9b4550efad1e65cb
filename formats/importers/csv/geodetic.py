"""Latitude, longitude and height as places in a plane that touches the ellipsoid of WGS 84.

The origin is told by the mapping, or is the first fix that is read. Where columns are called
``lat lon height``, or ``device_lat device_lon``, they stand for ``x y z`` or ``device_x device_y``.
The work is done by pyproj, the extra ``echoset[geo]``.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import require, shown, suggestion
from ....models.records import Array
from .log import Log
from .units import quantity

_log = logging.getLogger(__name__)
_WORDS = {"x": "lat", "y": "lon", "z": "height"}
_DEVICE = {"device_x": "device_lat", "device_y": "device_lon"}
_LIMITS = {"lat": 90.0, "lon": 360.0, "device_lat": 90.0, "device_lon": 360.0}


@dataclass(frozen=True, slots=True)
class Plane:
    """The plane and the axes ``F`` (3, 3) of the log in it; ``origin`` holds lat, lon, height."""

    F: Array
    origin: list[float] = field(default_factory=list)

    @staticmethod
    def of(spec: Any, F: Array) -> Plane:
        """The plane whose origin is told as ``{lat: .., lon: .., height: ..}``, or not told."""
        return Plane(F, [] if spec is None else list(_fix(spec, "origin")))

    @property
    def text(self) -> str:
        """The origin as a recording tells it; empty where no place is geodetic."""
        if not self.origin:
            return ""
        return "WGS84 lat {:.9f} deg, lon {:.9f} deg, height {:.4f} m".format(*self.origin)

    def place(self, spec: Any, where: str) -> list[float]:
        """The place x, y, z [m] in the log's frame of a fix ``{lat: .., lon: .., height: ..}``."""
        lat, lon, height = _fix(spec, where)
        height = height if "height" in spec or not self.origin else self.origin[2]
        return [float(v[0]) for v in self._local(*(np.array([v]) for v in (lat, lon, height)))]

    def flat(self, log: Log) -> Log:
        """The table with x y z in place of its latitudes, longitudes and heights, if it has any."""
        made: dict[str, Array] = {}
        columns, names = dict(log.columns), dict(log.names)
        fields = {k: v for k, v in log.fields.items() if k not in {*_WORDS.values()}}
        for words in (_WORDS, _DEVICE):
            lat, lon = list(words.values())[:2]
            if lat not in log and lon not in log:
                continue
            there, missing = (lat, lon) if lat in log else (lon, lat)
            if missing not in log:
                raise ParameterError(f"{log.where}: {there!r} needs {missing!r} beside it")
            main = [lat, lon, *(["height"] if "height" in log else [])]
            fix, known = log.detections(main, ())
            for key in (lat, lon):
                log.refuse(key, np.abs(fix[key]) > _LIMITS[key], f"is beyond {_LIMITS[key]:g} deg")
            height = fix.get("height")
            if height is None:
                height = np.full(len(log), self.origin[2] if self.origin else 0.0)
            xyz = np.full((3, len(log)), np.nan)
            if known.any():
                xyz[:, known] = self._local(*(v[known] for v in (fix[lat], fix[lon], height)))
            for k, (key, word) in enumerate(words.items()):
                if word in log:
                    made[key], columns[key], names[key] = xyz[k], log.columns[word], names[word]
            fields = {k: v for k, v in fields.items() if k not in words.values()}
        if not made:
            return log
        return replace(log, columns=columns, names=names, fields=fields, computed=made)

    def _local(self, lat: Array, lon: Array, height: Array) -> Array:
        """Places (3, m) [m] along the axes of the log."""
        try:
            from pyproj import Transformer
        except ImportError:
            reason = "latitudes and longitudes need pyproj: pip install 'echoset[geo]'"
            raise ParameterError(reason) from None
        if not self.origin:
            self.origin.extend([float(lat[0]), float(lon[0]), float(height[0])])
            _log.warning("places count from the first fix: %s", self.text)
        lat_0, lon_0, h_0 = self.origin
        steps = "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad"
        steps += " +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84"
        made = Transformer.from_pipeline(f"{steps} +lat_0={lat_0!r} +lon_0={lon_0!r} +h_0={h_0!r}")
        return np.asarray(self.F.T @ np.array(made.transform(lon, lat, height)))


def instead(
    spec: object, required: Sequence[str], optional: Sequence[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The quantities of a table, with latitudes in place of x where ``spec`` has them."""
    told = set(spec) if isinstance(spec, Mapping) else set()
    swap = _WORDS if told & {"lat", "lon"} else {}
    swap = swap | (_DEVICE if told & {*_DEVICE.values()} else {})
    if not swap.keys() & {*required, *optional}:
        return tuple(required), tuple(optional)
    others = dict.fromkeys([*(swap.get(k, k) for k in optional), "height"])
    return tuple(swap.get(k, k) for k in required), tuple(others)


def _fix(spec: Any, where: str) -> tuple[float, float, float]:
    """Latitude, longitude [deg] and height [m], 0 by default."""
    words = ("lat", "lon", "height")
    require(isinstance(spec, Mapping), where, "{lat: .., lon: .., height: ..}", spec)
    for key in spec:
        if key not in words:
            raise ParameterError(f"{where}: unknown key {shown(key)}{suggestion(str(key), words)}")
    for key in words[:2]:
        require(key in spec, where, f"a place with {key}", spec)
    lat, lon, height = (quantity(spec.get(key, 0.0), key, f"{where}.{key}") for key in words)
    require(abs(lat) <= _LIMITS["lat"], f"{where}.lat", "within 90 deg", lat)
    require(abs(lon) <= _LIMITS["lon"], f"{where}.lon", "within 360 deg", lon)
    return lat, lon, height
