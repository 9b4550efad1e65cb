"""Completeness, ambiguity and their like, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.metrics import siap


def means(scene, truth, estimated, by_object=True):
    scores = siap.METRIC.score(
        *scene(truth, estimated), siap.METRIC.Params(cutoff=2.0, by_object=by_object)
    )
    assert np.isnan(scores.time).all()
    rows = zip(scores.metric, scores.part, scores.value, scores.n, strict=True)
    return {(metric, part): (value, n) for metric, part, value, n in rows}


def test_one_estimate_for_two_objects_covers_both_and_tracks_one(scene):
    truth = [{1: (0.0, 0.0), 2: (1.0, 0.0)}] * 3
    estimated = [
        {5: (0.1, 0.0)},
        {6: (0.0, 0.0), 7: (0.2, 1.0), 8: (50.0, 0.0)},
        {6: (0.0, 0.0), 9: (1.0, 0.5)},
    ]
    found = means(scene, truth, estimated)
    assert found["completeness", ""] == (pytest.approx(5 / 6), 6)
    assert found["completeness", "object-1"] == (1.0, 3)
    assert found["completeness", "object-2"] == (pytest.approx(2 / 3), 3)
    assert found["coverage", "object-2"] == (1.0, 3)
    assert found["ambiguity", ""] == (pytest.approx(5 / 6), 6)
    assert found["spurious", ""] == (pytest.approx(1 / 6), 6)
    assert found["false-objects", ""] == (pytest.approx(1 / 3), 3)
    assert found["position-error", ""] == (pytest.approx((0.1 + np.sqrt(1.64) + 0.5) / 5), 5)
    assert found["label-changes", ""] == (1.0, 2)
    whole = means(scene, truth, estimated, by_object=False)
    assert whole == {key: value for key, value in found.items() if not key[1]}


def test_a_change_counts_after_a_gap_too(scene):
    truth = [{1: (0.0, 0.0)}] * 5
    labels = (3, None, 3, None, 4)
    estimated = [{} if label is None else {label: (0.0, 0.0)} for label in labels]
    found = means(scene, truth, estimated)
    assert found["label-changes", ""] == (1.0, 1)
    assert found["completeness", "object-1"] == (pytest.approx(0.6), 5)


def test_what_has_no_mean_is_left_out(scene):
    nothing = means(scene, [{}, {}], [{}, {}])
    assert nothing == {("false-objects", ""): (0.0, 2)}
    missed = means(scene, [{4: (0.0, 0.0)}], [{}])
    assert missed["completeness", ""] == (0.0, 1)
    assert ("position-error", "") not in missed and ("ambiguity", "") not in missed
    false = means(scene, [{}], [{4: (0.0, 0.0)}])
    assert false["spurious", ""] == (1.0, 1) and ("completeness", "") not in false
