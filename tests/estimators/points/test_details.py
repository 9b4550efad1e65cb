"""Details that ordinary use meets: columns and parameters, extraction, travel, regions of mbm."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import norm

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.kernels import bernoulli
from echoset.estimators.points.model.sensing import SensorParams, look
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry.regions import polygons
from echoset.models.parameters import resolve
from echoset.models.records import Scan, Sensor

MODEL = {
    "p_detect": 0.9,
    "clutter_rate": 1.0,
    "clutter_region": (0.0, 100.0, 0.0, 100.0),
    "std_position": 1.0,
}


@pytest.mark.parametrize("n", [0, 1, 3])
@pytest.mark.parametrize("column", ["std_range", "std_azimuth"])
def test_one_deviation_as_column_and_one_as_parameter(n, column):
    rows = {"range": np.full(n, 50.0), "azimuth": np.zeros(n), column: np.full(n, 0.25)}
    params = SensorParams(
        p_detect=0.9, clutter_rate=1.0, max_range=99.0, std_range=0.5, std_azimuth=0.5
    )
    R = look(params, Scan("a", 0, {}, rows), True, Sensor.static("radar", np.zeros(2))).R
    expected = np.diag([0.0625, 0.25] if column == "std_range" else [0.25, 0.0625])
    np.testing.assert_array_equal(R, np.tile(expected, (n, 1, 1)))


def test_an_azimuth_in_degrees_is_refused():
    with pytest.raises(ParameterError, match="std_azimuth"):
        resolve(SensorParams, ("", {"p_detect": 1.0, "clutter_rate": 1.0, "std_azimuth": 2.0}))
    rows = {"range": np.ones(1), "azimuth": np.zeros(1), "std_azimuth": np.full(1, 2.0)}
    params = SensorParams(p_detect=0.9, clutter_rate=1.0, max_range=99.0, std_range=0.5)
    with pytest.raises(InputError, match="in degrees"):
        look(params, Scan("a", 0, {}, rows), True, Sensor.static("radar", np.zeros(2)))


def test_travel_is_measured_from_the_first_detection(make_recording):
    """Born anywhere, it lies 30 m from the mean of its birth, and has not moved."""
    rng = np.random.default_rng(1)
    scans = [np.array([[80.0, 50.0]]) + rng.normal(size=(1, 2)) for _ in range(12)]
    birth = (0.1, 50.0, 50.0, 0.0, 0.0, 20.0, 20.0, 1.0, 1.0)
    params = mbm.Params(
        **MODEL, birth="components", birth_components=(birth,), min_travel=15.0, lag=0.0
    )
    recording = make_recording(scans)
    steps = list(mbm.estimate(recording.setup(), recording.scans(), params, None))
    assert [len(s.objects.label) for s in steps] == [0] * 12


def mixture(rng):
    """Three tracks in two hypotheses."""
    local = bernoulli.newborn(
        np.array([0.9, 0.6, 0.7, 0.8]),
        np.hstack((rng.uniform(20, 80, (4, 2)), np.zeros((4, 2)))),
        np.tile(np.diag([100.0, 64.0, 1.0, 1.0]), (4, 1, 1)),
    )
    table = np.array([[0, -1, 2], [3, 1, -1]])
    return bernoulli.Mixture.whole(local, np.arange(3), local.m[:3], np.array([0.55, 0.45]), table)


def test_as_many_are_shown_as_are_extracted_by_cardinality():
    """The likeliest number stands in the second hypothesis, with tracks that the first lacks."""
    x = mixture(np.random.default_rng(2))
    x.local.r[:] = [0.2, 0.95, 0.2, 0.95]
    params = mbm.Params(**MODEL, extraction="cardinality")
    tracks, _ = mbm.extract(x, params)
    assert tracks.tolist() == [0, 1]
    moved = mbm._moved(x, set(), params)
    epoch = mbm.Epoch(0, x, np.eye(4), np.eye(4), 1.0)
    assert mbm._objects(x, [epoch], moved, params).label.tolist() == [0, 1]


def test_regions_of_a_mixture_by_enumeration():
    """All ways in which objects exist and lie in the region or not."""
    x = mixture(np.random.default_rng(3))
    bounds = (30.0, 70.0, 25.0, 60.0)
    a = x.local
    inside = [
        np.prod([np.diff(norm.cdf(b, m, s))[0] for b, m, s in zip(
            (bounds[:2], bounds[2:]), mean[:2], (10.0, 8.0), strict=True)])
        for mean in a.m
    ]  # fmt: skip
    number = np.zeros(4)
    for w, row in zip(x.w[:, 0], x.table, strict=True):
        p = [a.r[l] * inside[l] for l in row if l >= 0]
        for there in product([0, 1], repeat=len(p)):
            chance = np.prod([q if t else 1 - q for q, t in zip(p, there, strict=True)])
            number[sum(there)] += w * chance
    corners = {"B": polygons({"B": bounds})["B"]}
    found = mbm.regional(x, corners)
    mean = number @ np.arange(4)
    assert found["region_mean_B"][0] == pytest.approx(mean)
    assert found["region_variance_B"][0] == pytest.approx(number @ (np.arange(4) - mean) ** 2)


def test_what_is_not_kept_of_the_mixture_is_said(make_recording, caplog):
    births = tuple((0.01, 10.0 * k, 50.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0) for k in range(5))
    params = phd.Params(
        **{**MODEL, "p_detect": 0.0}, birth="components", birth_components=births,
        keep=True, keep_components=3,
    )  # fmt: skip
    recording = make_recording([[]])
    list(phd.estimate(recording.setup(), recording.scans(), params, None))
    assert "keep_components cuts off 0.02 expected targets" in caplog.text
