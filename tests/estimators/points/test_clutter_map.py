"""The map of persistent clutter: averages in closed form, what moves, what it does to a filter."""

import numpy as np
import pytest

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.clutter_map import NEGLIGIBLE, unknown
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve

SECOND = 10**9
MODEL = {
    "p_detect": 0.9,
    "clutter_rate": 1.0,
    "clutter_region": (-200.0, 200.0, -200.0, 200.0),
    "std_position": 4.0,
    "birth_rate": 0.1,
    "birth_std_velocity": (3.0, 3.0),
}


def test_the_rate_of_a_cell_is_the_fading_average():
    """Cells of 10 m: two detections a scan, every second scan, one on either side of the origin."""
    seen, rate = unknown(0), 0.0
    fade = np.exp(-2.0 / 30.0)
    for k in range(1, 40):
        here = [[3.0, -4.0], [9.9, -0.1]] if k % 2 else []
        seen = seen.learn(np.reshape(here, (-1, 2)), 10.0, 30.0, 2 * k * SECOND)
        rate = fade * rate + (1 - fade) * len(here)
    where = np.array([[5.0, -5.0], [5.0, 5.0], [-5.0, -5.0], [10.1, -5.0], [0.0, -10.0]])
    expected = rate / 100.0 * np.array([1, 0, 0, 0, 1])
    np.testing.assert_allclose(seen.density(where, 10.0), expected, rtol=1e-12)


def test_what_stays_is_clutter_of_one_a_scan_and_what_moves_is_forgotten():
    seen = unknown(0)
    for k in range(1, 400):
        here = np.array([[55.0, 55.0], [10.0 * k, 0.0]])
        seen = seen.learn(here, 10.0, 20.0, k * SECOND)
    assert seen.density(np.array([[52.0, 58.0]]), 10.0)[0] == pytest.approx(1 / 100, rel=1e-6)
    assert seen.density(np.array([[1000.0, 0.0]]), 10.0)[0] == 0.0
    assert seen.rate.min() >= NEGLIGIBLE
    # A cell lasts until its (1 - e^(-1/20)) e^(-t/20) is negligible: 78 scans.
    assert len(seen.cells) == 1 + 78


def run(module, recording, **changes):
    params = module.Params(**{**MODEL, **changes})
    rng = np.random.default_rng(0)
    return list(module.estimate(recording.setup(), recording.scans(), params, rng))


@pytest.mark.parametrize("module", [phd, mbm])
@pytest.mark.parametrize("kind", ["position", "range_bearing"])
def test_a_target_that_moves_is_found_beside_one_that_lies(make_recording, kind, module):
    rng = np.random.default_rng(3)
    steps = range(60)
    scans = [np.array([[65.0, 45.0], [-120.0 + 4 * k, 80.0]]) for k in steps]
    scans = [z + 4 * rng.normal(size=(2, 2)) for z in scans]
    model = {}
    if kind == "range_bearing":
        scans = [np.stack((np.hypot(*z.T), np.arctan2(z[:, 1], z[:, 0])), 1) for z in scans]
        model = {"std_range": 4.0, "std_azimuth": 0.05}
    recording = make_recording(scans, kind)
    without = run(module, recording, **model)
    found = run(module, recording, clutter_cell=10.0, clutter_memory=20.0, **model)
    assert [len(s.objects.label) for s in without[10:]] == [2] * 50
    late = [s.objects.state for s in found[30:]]
    moves, lies = (
        sum((np.hypot(*(x[:, :2] - (x0 + v * k, y)).T) < 15).any() for k, x in enumerate(late, 30))
        for x0, v, y in ((-120.0, 4.0, 80.0), (65.0, 0.0, 45.0))
    )
    assert moves >= 28 and lies <= 15


@pytest.mark.parametrize("module", [phd, mbm])
@pytest.mark.parametrize("wrong", [{"clutter_cell": -1.0}, {"clutter_memory": 0.0}])
def test_impossible_parameters_are_refused(module, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        resolve(module.Params, ("here", {**MODEL, **wrong}))
