"""Latitudes and longitudes as places in a plane, against the ellipsoid's closed form."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import FormatError, ParameterError

FIXES = np.array([[48.1, 11.5, 520.0], [48.1004, 11.5007, 523.0], [48.0995, 11.4991, 519.5]])
ORIGIN = FIXES[0]


def earth(fix: np.ndarray) -> np.ndarray:
    """Geocentric coordinates of lat, lon [deg], height [m] on WGS 84."""
    a, f = 6378137.0, 1 / 298.257223563
    lat, lon, h = np.radians(fix[..., 0]), np.radians(fix[..., 1]), fix[..., 2]
    e2 = f * (2 - f)
    n = a / np.sqrt(1 - e2 * np.sin(lat) ** 2)
    r = (n + h) * np.cos(lat)
    return np.stack([r * np.cos(lon), r * np.sin(lon), (n * (1 - e2) + h) * np.sin(lat)], -1)


def plane(fix: np.ndarray, origin: np.ndarray = ORIGIN) -> np.ndarray:
    """East, north, up of fixes (m, 3) at the origin."""
    lat, lon = np.radians(origin[:2])
    s, c, u, v = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    R = np.array([[-u, v, 0], [-s * v, -s * u, c], [c * v, c * u, s]])
    return (earth(fix) - earth(origin)) @ R.T


def told(fix: np.ndarray) -> dict[str, float]:
    return dict(zip(("lat", "lon", "height"), fix.tolist(), strict=True))


@pytest.fixture
def log(tmp_path: Path) -> Path:
    pytest.importorskip("pyproj", reason="the extra echoset[geo] is not installed")
    path = tmp_path / "log.csv"
    path.write_text("t,a,r\n0,A,10\n1,B,12\n")
    rows = "".join(f"{k},{f[0]!r},{f[1]!r},{f[2]!r}\n" for k, f in enumerate(FIXES.tolist()))
    (tmp_path / "g.csv").write_text("t,la,lo,h\n" + rows)
    return path


def said(**more: Any) -> dict[str, Any]:
    return {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "a", "distance": "r"},
        "anchors": {"A": told(FIXES[0]), "B": told(FIXES[1])},
    } | more


def test_anchors_and_truth_in_one_plane(log: Path):
    columns = {"time": "t", "lat": "la", "lon": "lo", "height": "h"}
    truth = {"file": "g.csv", "columns": columns}
    found = csv.read([log], csv.Params(said(origin=told(ORIGIN), truth=truth)))
    places = np.concatenate([found.sensors[name].position for name in "AB"])
    np.testing.assert_allclose(places, plane(FIXES[:2]), atol=1e-6)
    assert found.truth is not None
    np.testing.assert_allclose(found.truth.objects.state, plane(FIXES), atol=1e-6)
    assert found.truth.objects.state_names == ("x", "y", "z")
    assert found.meta.origin.startswith("WGS84 lat 48.1")
    # The axes of a log may lie elsewhere: the places on the map stay.
    other = csv.read(
        [log], csv.Params(said(origin=told(ORIGIN), truth=truth, frame=["north", "east", "down"]))
    )
    np.testing.assert_allclose(other.truth.objects.state, plane(FIXES), atol=1e-6)
    np.testing.assert_allclose(other.sensors["B"].position, plane(FIXES[1:2]), atol=1e-6)


def test_the_first_fix_is_the_origin_unless_told(log: Path, caplog: pytest.LogCaptureFixture):
    columns = {"time": "t", "device_lat": "la", "device_lon": "lo", "height": "h"}
    truth = {"file": "g.csv", "columns": columns}
    found = csv.read([log], csv.Params(said(truth=truth)))
    assert "places count from the first fix: WGS84 lat 48.1" in caplog.text
    assert found.truth.objects.state_names == ("device_x", "device_y")
    np.testing.assert_allclose(found.truth.objects.state, plane(FIXES)[:, :2], atol=1e-6)


def test_fixes_as_detections(log: Path):
    found = csv.read(
        [log.parent / "g.csv"],
        csv.Params({"kind": "position", "columns": {"time": "t", "lat": "la", "lon": "lo"}}),
    )
    flat = FIXES * [1, 1, 0]
    rows = found.streams["radar"].rows
    np.testing.assert_allclose(
        np.column_stack([rows["x"], rows["y"]]), plane(flat, flat[0])[:, :2], atol=1e-6
    )


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"anchors": {"A": {"lat": 1}, "B": [0, 0]}}, "anchors.A must be a place with lon"),
        ({"anchors": {"A": {"lat": 91, "lon": 0}, "B": [0, 0]}}, "anchors.A.lat must be within 90"),
        ({"origin": {"lat": 1, "lng": 2}}, "origin: unknown key 'lng'"),
        ({"origin": 3}, "origin must be {lat"),
        ({"truth": {"file": "g.csv", "columns": {"time": "t", "lat": "la"}}}, "needs 'lon'"),
    ],
)
def test_what_is_no_place_is_refused(log: Path, more: dict[str, Any], message: str):
    with pytest.raises(ParameterError, match=message):
        csv.read([log], csv.Params(said(**more)))


def test_a_latitude_beyond_the_pole_is_named(log: Path):
    (log.parent / "g.csv").write_text("t,la,lo\n0,48,11\n1,480,11\n")
    truth = {"file": "g.csv", "columns": {"time": "t", "lat": "la", "lon": "lo"}}
    with pytest.raises(FormatError, match=r"line 3, column 'la': '480' is beyond 90 deg"):
        csv.read([log], csv.Params(said(truth=truth)))


def test_without_pyproj_the_command_that_installs_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    (tmp_path / "log.csv").write_text("t,a,r\n0,A,10\n")
    with pytest.raises(ParameterError, match=r"pip install 'echoset\[geo\]'"):
        csv.read([tmp_path / "log.csv"], csv.Params(said()))


@pytest.mark.parametrize(
    ("quantity", "unit", "value", "si"),
    [("x", "nmi", 2, 3704.0), ("x", "ft", 10, 3.048), ("vx", "kn", 36, 18.52)],
)
def test_units_of_ships_and_planes(tmp_path: Path, quantity, unit, value, si):
    (tmp_path / "log.csv").write_text("t,x\n0,1\n")
    (tmp_path / "g.csv").write_text(f"t,a\n0,{value}\n")
    other = quantity.replace("x", "y")
    columns = {"time": "t", quantity: {"column": "a", "unit": unit}, other: {"value": 0}}
    mapping = {
        "kind": "position",
        "columns": {"time": "t", "x": "x", "y": {"value": 0}},
        "truth": {"file": "g.csv", "columns": columns},
    }
    found = csv.read([tmp_path / "log.csv"], csv.Params(mapping))
    assert found.truth.objects.state[0, 0] == pytest.approx(si, rel=1e-12)
