"""Smoothed components of the PHD filter against least squares over whole trajectories."""

import numpy as np
import pytest
from support.births import at_the_first_scan_alone

from echoset.estimators.points import phd
from echoset.estimators.points.strands import ANEW, Strands, back
from echoset.models.geometry.regions import mass, polygons
from echoset.models.motion import constant_velocity, white_acceleration

from .test_paths import BASE, BIRTHS, joint, path

MODEL = {k: v for k, v in BASE.items() if k in phd.Params.__dataclass_fields__} | {
    "merge_distance": 1e-9
}


def run(recording, **changes):
    params = phd.Params(**{**MODEL, **changes})
    return list(phd.estimate(recording.setup(), recording.scans(), params, None))


@pytest.fixture
def first_scan_only(monkeypatch):
    """Births at the first scan alone."""
    at_the_first_scan_alone(monkeypatch, phd)


@pytest.mark.usefixtures("first_scan_only")
def test_one_target_without_clutter_is_the_smoother(make_recording):
    Z = list(path(np.random.default_rng(1), BIRTHS[0], 12))
    regions = {"here": (45.0, 60.0, 40.0, 55.0)}
    found = run(make_recording([z[None] for z in Z]), birth_components=BIRTHS[:1], smooth="whole",
                regions=regions)  # fmt: skip
    x, P, _ = joint(Z, BIRTHS[0])
    inside = mass(x[:, :2], P[:, :2, :2], polygons(regions)["here"])
    for k, one in enumerate(found):
        assert len(one.objects.label) == 1
        np.testing.assert_allclose(one.objects.state[0], x[k], atol=1e-9)
        np.testing.assert_allclose(one.objects.covariance[0], P[k], atol=1e-9)
        assert one.steps["cardinality_mean"][0] == pytest.approx(1)
        assert one.steps["region_mean_here"][0] == pytest.approx(inside[k], abs=1e-9)
        assert one.steps["region_variance_here"][0] == pytest.approx(
            inside[k] * (1 - inside[k]), abs=1e-9
        )


@pytest.mark.usefixtures("first_scan_only")
def test_two_targets_apart_are_two_smoothers(make_recording):
    rng, births = np.random.default_rng(2), (BIRTHS[0], (1.0, -200.0, *BIRTHS[1][2:]))
    Z = np.stack([list(path(rng, birth, 10)) for birth in births], 1)
    found = run(make_recording(Z), birth_components=births, smooth="whole")
    expected = [joint(Z[:, i], births[i])[0] for i in (0, 1)]
    for k, one in enumerate(found):
        mine = one.objects.state[np.argsort(one.objects.label)]
        np.testing.assert_allclose(mine, [x[k] for x in expected], atol=1e-7)


def test_a_lag_is_the_whole_of_what_came_until_then(make_recording):
    rng = np.random.default_rng(3)
    Z = [np.vstack((z[None], rng.uniform(0, 100, (2, 2)))) for z in path(rng, BIRTHS[0], 10)]
    scene = {"birth_components": ((0.3, *BIRTHS[0][1:]),), "p_detect": 0.9, "clutter_rate": 2.0,
             "clutter_region": (0.0, 100.0, 0.0, 100.0), "p_survive": 0.95}  # fmt: skip
    late, part, none = (
        run(make_recording(z), **scene, smooth=s)
        for z, s in ((Z, "4s"), (Z[:5], "whole"), (Z, "none"))
    )
    np.testing.assert_array_equal(late[0].objects.state, part[0].objects.state)
    assert len(late) == len(none) == 10
    np.testing.assert_array_equal(late[-1].objects.state, none[-1].objects.state)


def test_lines_of_one_component_are_one_or_as_many_as_it_weighs():
    """A step back of three lines: two from a component of weight two, one more from another."""
    F, Q = constant_velocity(1.0)[0], white_acceleration(1.0)
    P = np.tile(2 * np.eye(4), (3, 1, 1))

    def strands(time_ns, label, origin, r, m):
        n = len(label)
        return Strands(time_ns, np.array(label), np.array(origin), np.array(r), m, P[:n], F, Q, 0.9)

    m = np.arange(12.0).reshape(3, 4)
    later = strands(1, [5, 6, 7], [0, 0, 0], [0.9, 0.6, 0.2], m)
    two = back(later, strands(0, [3, 4], [-1, -1], [2.0, 0.5], m[:2]))
    assert two.label.tolist() == [5, 6, 4]
    # Who surely was there is, and the weak component ends by dying: 0.05 of 0.55.
    np.testing.assert_allclose(two.r, [1.0, 1.0, 0.05 / 0.55])
    one = back(later, strands(0, [3, 5], [-1, -1], [0.8, 0.5], m[:2]))
    assert one.label.tolist() == [5, ANEW] and one.r[0] == 1.0
