"""Huge and equal coordinates: a picture, or a reason why not; and pictures are XML."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from echoset.metrics.kit.table import rows
from echoset.models.errors import InputError
from echoset.models.records import Estimates, Meta, Objects, Recording, Truth
from echoset.report import plots
from echoset.report.plots import Inputs, draw


def scene(x: list[float], name: str = "r") -> Recording:
    n = len(x)
    state = np.stack((x, x), 1).astype(float)
    time = np.arange(n) * 10**9
    objects = Objects(time, np.arange(n + 1), np.zeros(n, int), ("x", "y"), ("m", "m"), state)
    return Recording(Meta(name), {}, {}, Truth(objects))


@pytest.mark.parametrize("x", [[0.0, 0.0], [7.0], [1e9, 1e9], [-1e12, 1e12], [1e-300, 2e-300]])
def test_equal_and_far_coordinates_are_drawn(x):
    figure = plots.figure("scene", Inputs(recordings=(scene(x),)))
    ElementTree.fromstring(draw.save(figure, "svg", {}))


@pytest.mark.parametrize("x", [[1e13, 0.0], [1e200, 0.0], [-1e308, 1e308]])
def test_coordinates_beyond_reach_are_told(x):
    with pytest.raises(InputError, match="draws numbers up to 1e"):
        plots.figure("scene", Inputs(recordings=(scene(x),)))


def test_picture_of_a_name_with_controls_is_xml():
    figure = plots.figure("scene", Inputs(recordings=(scene([0.0, 1.0], "a\x01b"),)))
    assert b"a\\x01b" in draw.save(figure, "svg", {})
    ElementTree.fromstring(draw.save(figure, "svg", {}))


def test_long_scene_is_thinned_and_says_so():
    recording = scene(list(np.linspace(0.0, 100.0, 36_000)))
    objects = recording.truth.objects
    estimates = Estimates(Meta("r", provenance={"estimator": "e"}), objects, {})
    recording = replace(recording, truth=None)
    figure = plots.figure("scene", Inputs(recordings=(recording,), estimates=(estimates,)))
    data = draw.save(figure, "svg", {})
    assert len(data) < 4e6 and b"objects at one of 6 times" in data


def test_long_lines_are_thinned_to_what_they_stand_for():
    """36,000 times: 18 become one, the root of whose mean square is known by hand."""
    n = 36_000
    time, value = np.arange(n) / 10.0, np.where(np.arange(n) % 18 == 0, 3.0, 0.0)
    table = rows(("s-*", "e", "rmse", "device"), time, value, 9, 0.01)
    figure = plots.figure("rmse", Inputs(scores=table, pooled=table))
    (drawn,) = (x for x in figure.axes[0].lines if x.get_label() == "e")
    assert len(drawn.get_ydata()) == 2000
    np.testing.assert_allclose(drawn.get_ydata(), np.sqrt(9 / 18))
    np.testing.assert_allclose(drawn.get_xdata()[:2], [0.85, 2.65])
    data = draw.save(figure, "svg", {})
    assert len(data) < 1e6 and b"over 18 times each" in data
    one = np.ones(n, np.int64)
    counted = Objects(
        np.arange(n) * 10**8, np.arange(n + 1), one, ("x", "y"), ("m", "m"), np.zeros((n, 2))
    )
    steps = {"cardinality_mean": value, "cardinality_variance": one * 4.0}
    estimates = Estimates(Meta("r", provenance={"estimator": "e"}), counted, steps)
    figure = plots.figure("cardinality", Inputs(estimates=(estimates,)))
    (drawn,) = (x for x in figure.axes[0].lines if x.get_label() == "e")
    np.testing.assert_allclose(drawn.get_ydata(), np.full(2000, 3.0 / 18))
    data = draw.save(figure, "svg", {})
    assert len(data) < 1e6 and b"means over 18 times" in data
