"""The bound of a device alone, against arrival times with an unknown clock, and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.metrics.bounds import alone, pcrlb
from echoset.models.columns import TDOA
from echoset.models.records import Objects, Truth
from echoset.simulate.uwb_walk import Params, simulate

ANCHORS = np.array([[0.0, 0.0, 2.0], [5.0, 0.0, 1.0], [5.0, 5.0, 2.5], [0.0, 5.0, 0.0]])
P = np.array([1.3, 2.1])
QUIET = pcrlb.Params(mean_clutter=0.0, device_height=1.0)


def unit_vectors() -> np.ndarray:
    away = np.array([*P, 1.0]) - ANCHORS
    return away[:, :2] / np.linalg.norm(away, axis=1)[:, None]


def test_ranges_have_the_information_of_least_squares() -> None:
    u = unit_vectors()
    std = np.array([0.1, 0.2, 0.1, 0.3])
    nowhere = np.full((4, 3), np.nan)
    own = alone.Links(ANCHORS, nowhere, np.full(4, -1), std)
    expected = (u.T / std**2) @ u
    np.testing.assert_allclose(alone.direct_information(P, own, QUIET), expected, rtol=1e-6)


def test_differences_have_the_information_of_arrivals_with_an_unknown_clock() -> None:
    # the clock marginalised: J_pp - J_pc J_cc^-1 J_cp, whichever anchor is taken off
    H = np.hstack((unit_vectors(), np.ones((4, 1)))) / 0.1
    J = H.T @ H
    expected = J[:2, :2] - np.outer(J[:2, 2], J[2, :2]) / J[2, 2]
    for reference in range(4):
        others = np.delete(np.arange(4), reference)
        own = alone.Links(
            ANCHORS[others],
            np.tile(ANCHORS[reference], (3, 1)),
            np.full(3, reference),
            np.full(3, 0.1 * np.sqrt(2)),
        )
        found = alone.direct_information(P, own, QUIET)
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_false_ranges_leave_less() -> None:
    assert alone.kept(0.1, QUIET) == pytest.approx(1.0, rel=1e-6)
    shares = [alone.kept(0.1, replace(QUIET, mean_clutter=c)) for c in (1.0, 10.0, 100.0)]
    assert shares == sorted(shares, reverse=True)
    assert shares[-1] < 0.7


def test_the_bound_of_a_recording_without_an_extent() -> None:
    walk = Params(steps=30, anchors=4, ring=10.0, size=4.0, differences=True)
    record = simulate(walk, np.random.default_rng(1), "r")
    assert (record.streams["uwb"].scan["mode"] == TDOA).all()
    scores = pcrlb.score(None, record, replace(QUIET, device_height=0.0))
    values = np.array([v for t, v in zip(scores.time, scores.value, strict=True) if t == t])
    assert len(values) == 30
    # never below what a bound with perfect past could be, never above an instant's
    assert (values[5:] < 1.2).all()
    assert (values > 0.1).all()
    # truth in the midst alone: the bound is of these events
    o = record.truth.objects.part(5, 20)
    part = pcrlb.score(None, replace(record, truth=Truth(Objects(*_fields(o)))), QUIET)
    assert part.n[np.isnan(part.time)].tolist() == [15]


def _fields(o: Objects) -> tuple:
    return o.time_ns, o.row_offset, o.label, o.state_names, o.state_units, o.state
