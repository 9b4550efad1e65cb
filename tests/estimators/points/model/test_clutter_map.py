"""The map of persistent clutter: averages in closed form, what moves, what it does to a filter."""

import numpy as np
import pytest

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.model.clutter_map import FADED, unknown
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
    assert seen.count.min() >= FADED
    # A cell lasts until e^(-t/20) of its detection is negligible: 78 scans, and that of it.
    assert len(seen.cells) == 1 + 79


@pytest.mark.parametrize("rate", [0.5, 10.0, 25.0, 100.0])
def test_what_stays_is_clutter_at_any_rate_of_scans(rate):
    seen, here = unknown(0), np.array([[55.0, 55.0]])
    steps = round(400 * rate)
    for k in range(1, steps + 1):
        seen = seen.learn(here, 10.0, 30.0, round(k / rate * SECOND))
    assert seen.density(here, 10.0)[0] == pytest.approx(1 / 100, rel=1e-4)


def test_one_detection_after_a_pause_makes_no_clutter():
    seen, here = unknown(0), np.array([[55.0, 55.0]])
    for k in range(1, 100):
        seen = seen.learn(np.zeros((0, 2)), 10.0, 60.0, k * SECOND)
    seen = seen.learn(here, 10.0, 60.0, 700 * SECOND)
    assert seen.density(here, 10.0)[0] * 100 < 0.11


def test_cells_out_of_view_stay_as_they_are():
    """Looked at every fourth time, with a detection each: as if the others had not been."""
    always, turning, here = unknown(0), unknown(0), np.array([[55.0, 55.0]])
    for k in range(1, 401):
        in_view = k % 4 == 0
        z = here if in_view else np.zeros((0, 2))
        turning = turning.learn(z, 10.0, 60.0, k * SECOND, lambda x, v=in_view: np.full(len(x), v))
        if in_view:
            always = always.learn(here, 10.0, 60.0, k * SECOND)
    a, b = (m.density(here, 10.0)[0] for m in (always, turning))
    assert a == pytest.approx(b, rel=0.01) and b == pytest.approx(1 / 100, rel=0.01)
    before = turning.density(here, 10.0)[0]
    for k in range(401, 2000):
        turning = turning.learn(z[:0], 10.0, 60.0, k * SECOND, lambda x: np.zeros(len(x), bool))
    assert turning.density(here, 10.0)[0] == before


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
    # What lies is there from the start: it must not be as likely as a target that waits.
    model |= {"backlog": 0.0} if module is mbm else {}
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
