"""OSPA-GW against closed forms and against all permutations."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from scipy.linalg import sqrtm
from scipy.spatial.transform import Rotation

from echoset.metrics.distances import ospa_gw
from echoset.models.errors import InputError
from echoset.models.records import Estimates, Meta, Objects, Recording, Truth

STEP = 10**9


def objects(steps, with_extent=True):
    """Objects of some steps, each a list of (centre, semi-axes, rotation)."""
    flat = [x for step in steps for x in step]
    d = len(flat[0][0]) if flat else 2
    offset = np.cumsum([0, *map(len, steps)]).astype(np.int64)
    extent = {}
    if with_extent:
        extent = {
            "extent_kind": "ellipse" if d == 2 else "ellipsoid",
            "semi_axes": np.array([x[1] for x in flat], float).reshape(-1, d),
            "rotation": np.array([x[2] for x in flat], float).reshape(
                -1, *((4,) if d == 3 else ())
            ),
        }
    return Objects(
        np.arange(len(steps), dtype=np.int64) * STEP,
        offset,
        np.concatenate([np.arange(len(s)) for s in steps]).astype(np.int64),
        tuple("xyz"[:d]),
        ("m",) * d,
        np.array([x[0] for x in flat], float).reshape(-1, d),
        **extent,
    )


def score(estimate, truth):
    recording = Recording(Meta("r"), {}, {}, Truth(truth))
    estimates = Estimates(Meta("r", provenance={"estimator": "e"}), estimate, {})
    found = ospa_gw.METRIC.score(estimates, recording, ospa_gw.METRIC.Params())
    steps = ~np.isnan(found.time) & (np.array(found.metric) == "ospa-gw")
    part = np.array(found.part)
    return {p: found.value[steps & (part == p)] for p in ("", *ospa_gw.METRIC.PARTS)}


def test_distance_of_extents_along_common_axes_is_that_of_the_semi_axes():
    values = score(
        objects([[((3.0, 4.0), (1.0, 2.0), 0.4)]]), objects([[((0.0, 0.0), (1.5, 1.0), 0.4)]])
    )
    assert values[""][0] == pytest.approx(np.sqrt(25 + 0.5**2 + 1.0**2))
    assert values["centre"][0] == pytest.approx(5.0)
    assert values["extent"][0] == pytest.approx(np.sqrt(1.25))
    assert values["cardinality"][0] == 0


def test_a_quarter_turn_swaps_the_axes():
    turned = score(
        objects([[((0.0, 0.0), (1.0, 2.0), np.pi / 2)]]), objects([[((0.0, 0.0), (2.0, 1.0), 0.0)]])
    )
    assert turned[""][0] == pytest.approx(0.0, abs=1e-7)


def test_a_missed_object_among_twelve_costs_the_cutoff_over_the_root_of_twelve():
    all_ = [((20.0 * i, 0.0), (1.0, 1.0), 0.0) for i in range(12)]
    values = score(objects([all_[:-1], all_, []]), objects([all_, all_, []]))
    np.testing.assert_allclose(values[""], [10 / np.sqrt(12), 0, 0], atol=1e-6)


def test_ellipsoids_in_any_number_beside_all_permutations():
    rng = np.random.default_rng(4)

    def draw(n):
        turns = Rotation.random(n, rng=rng).as_quat() if n else np.zeros((0, 4))
        return list(zip(rng.uniform(0, 6, (n, 3)), rng.uniform(0.5, 3, (n, 3)), turns, strict=True))

    truth, estimate = ([draw(n) for n in counts] for counts in ((3, 4, 1, 5), (3, 2, 4, 5)))
    found = score(objects(estimate), objects(truth))[""]
    for value, X, Y in zip(found, truth, estimate, strict=True):
        X, Y = sorted((X, Y), key=len)
        squares = np.zeros((len(X), len(Y)))
        for i, (m, a, q) in enumerate(X):
            for j, (n, b, r) in enumerate(Y):
                A, B = (
                    R @ np.diag(s**2) @ R.T
                    for R, s in ((Rotation.from_quat(q).as_matrix(), a),
                                 (Rotation.from_quat(r).as_matrix(), b))
                )  # fmt: skip
                cross = np.trace(sqrtm(sqrtm(A) @ B @ sqrtm(A)).real)
                d2 = np.sum((m - n) ** 2) + np.trace(A + B) - 2 * cross
                squares[i, j] = min(d2, 100.0)
        best = min(
            sum(squares[i, p[i]] for i in range(len(X)))
            for p in permutations(range(len(Y)), len(X))
        )
        total = best + 100.0 * (len(Y) - len(X))
        assert value == pytest.approx(np.sqrt(total / len(Y)), rel=1e-6)


def test_objects_without_extent_are_refused():
    one = [[((0.0, 0.0), (1.0, 1.0), 0.0)]]
    with pytest.raises(InputError, match="no extent"):
        score(objects(one, with_extent=False), objects(one))
