"""What the pictures compute for themselves: shares of a stack, spans, bounds, fused maps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoset.campaign.pictures import gather
from echoset.models.errors import InputError
from echoset.models.records import Objects, Recording
from echoset.models.uwb import error_bound
from echoset.report.plots import Selection, bound, box, fused, places, range_angle, sets
from echoset.report.plots.blockages import blockages
from echoset.report.plots.cardinality import _moments
from echoset.report.plots.columns import Columns, quantity
from echoset.report.plots.panels import spans


def columns(*rows: tuple[str, str, float, float]) -> Columns:
    """Rows of recording, part, time and value."""
    recording, part, time, value = (np.array(c, object) for c in zip(*rows, strict=True))
    same = np.full(len(rows), "x", object)
    return Columns(same, recording, same, same, part, time.astype(float), value.astype(float))


def test_shares_add_up_to_the_distance_whatever_the_order() -> None:
    rows = columns(
        ("a", "", 1.0, 5.0), ("a", "localisation", 1.0, 3.0), ("a", "cardinality", 1.0, 4.0),
        ("b", "", 1.0, 2.0), ("b", "localisation", 1.0, 0.0), ("b", "cardinality", 1.0, 2.0),
        ("a", "", 2.0, 0.0), ("a", "localisation", 2.0, 0.0), ("a", "cardinality", 2.0, 0.0),
    )  # fmt: skip
    time, whole, shares = sets.stack(rows, 2.0)
    assert time.tolist() == [1.0, 2.0] and whole.tolist() == [3.5, 0.0]
    assert np.allclose(shares["localisation"], [5 * 9 / 25 / 2, 0])
    assert np.allclose(shares["cardinality"], [(5 * 16 / 25 + 2) / 2, 0])


def test_order_comes_from_the_provenance() -> None:
    one = {"metrics": {"ospa": {"order": 1.0}}}
    assert sets.order(one, "ospa") == sets.order({"inputs": [{}, one]}, "ospa") == 1.0
    assert sets.order(one, "gospa") == 2.0


def test_moments_over_recordings() -> None:
    rows = columns(("a", "", 1.0, 2.0), ("b", "", 1.0, 4.0), ("a", "", 2.0, 7.0))
    time, mean, std = _moments(rows)
    assert time.tolist() == [1.0, 2.0] and mean.tolist() == [3.0, 7.0]
    assert std[0] == pytest.approx(2**0.5) and np.isnan(std[1])


def test_runs_of_equal_values() -> None:
    time = np.array([1.0, 2.0, 3.0, 5.0, 6.0])
    found = spans(time, np.array([0, 2, 2, 2, 1]), 1.0)
    assert found == [(1.0, 3.0, 2), (4.0, 5.0, 2), (5.0, 6.0, 1)]


def test_boxes_at_times_or_in_spans() -> None:
    few = np.arange(12.0)
    assert box._edges(few).tolist() == few.tolist()
    assert box._edges(np.arange(81.0)).tolist() == [0, 10, 20, 30, 40, 50, 60, 70]


def test_names_and_units_of_quantities() -> None:
    assert quantity("rmse", "device") == "RMSE of the device [m]"
    assert quantity("a-metric-of-yours") == "a-metric-of-yours"


def test_bound_of_ranges_by_hand() -> None:
    anchors = np.array([[5.0, 0.0], [0.0, 7.0]])
    assert error_bound(np.zeros(2), anchors, np.array([0.3, 0.4])) == pytest.approx(0.5)
    assert np.isinf(error_bound(np.zeros(2), np.array([[1.0, 0], [2.0, 0]]), np.ones(2)))
    ring = np.array([[np.cos(a), np.sin(a)] for a in 2 * np.pi * np.arange(8) / 8])
    assert error_bound(np.zeros(2), ring, np.full(8, 0.1)) == pytest.approx(0.1 * 2 / 8**0.5)


def recording(files: Path, name: str) -> Recording:
    return gather([str(files / name)]).recording


def test_bound_of_tables_falls_with_every_scan(files: Path) -> None:
    streams = list(recording(files, "extended.h5").streams.values())
    x, y, first, _ = bound.of_tables(streams[:1], Selection(stop=0.5))
    both = bound.of_tables(streams, Selection())[2]
    assert first.shape == (len(y), len(x)) and (both < first).all()
    model = streams[0].model
    i, j = 3, 2
    S = np.empty((3, 3))
    for a in range(3):
        for b in range(3):
            S[a, b] = model[f"cov_{'xyz'[min(a, b)]}{'xyz'[max(a, b)]}_table"][0, i + 1, j + 1, 3]
    p = model["p_detect_table"][0, i + 1, j + 1, 3]
    assert first[j, i] == pytest.approx(np.sqrt(np.trace(S) / p), rel=1e-6)


def test_blockages_of_a_recording(files: Path) -> None:
    found = blockages(recording(files, "uwb/uwb-olos-s1-0000.h5"))
    assert [(round(a, 6), round(b, 6), n) for a, b, n in found] == [(0.3, 0.6, 2), (0.6, 0.9, 1)]


def test_fused_power_is_the_sum_where_stations_see(files: Path) -> None:
    known = recording(files, "maps.h5")
    found = range_angle.last_maps(known, Selection(), "fused")
    x, y = np.array([0.0, 10.0, 200.0]), np.array([0.0, 5.0])
    power = fused.fuse(known, found, x, y)
    assert np.isnan(power[:, 2]).all() and power[1, 1] > 100 * power[0, 0]
    one = [fused.fuse(known, [f], x[:2], y) for f in found]
    assert np.allclose(np.nansum(one, 0), power[:, :2])


def test_maps_without_axes_are_refused(files: Path) -> None:
    known = recording(files, "maps.h5")
    bare = replace(known.streams["BS1"], model={})
    with pytest.raises(InputError, match=r"streams/BS1.*range_axis"):
        range_angle.grid("BS1", bare)


def test_a_solid_is_drawn_as_seen_from_above() -> None:
    half = np.sqrt(0.5)
    objects = Objects(
        np.zeros(1, np.int64), np.array([0, 1]), np.zeros(1, np.int64), ("x", "y", "z"),
        ("m",) * 3, np.zeros((1, 3)), extent_kind="ellipsoid",
        semi_axes=np.array([[3.0, 2.0, 1.0]]), rotation=np.array([[0.0, half, 0.0, half]]),
    )  # fmt: skip
    ((x, y),) = places.outlines(objects, [0])
    assert np.ptp(x) / 2 == pytest.approx(1.0, rel=1e-3)
    assert np.ptp(y) / 2 == pytest.approx(2.0, rel=1e-3)


def test_the_last_step_before_an_empty_span_is_drawn() -> None:
    time = np.array([1.0, 2.0, 3.0])
    assert Selection(1.5, 3).times(time).tolist() == [1, 2]
    assert Selection(2.2, 2.6).times(time).tolist() == [1]
    assert Selection(0.1, 0.2).times(time).tolist() == []
