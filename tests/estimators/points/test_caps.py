"""What limits cut: by no place among the rows, said once, and counted in what is stated."""

import numpy as np
import pytest

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.context import Context

MODEL = {
    "p_detect": 0.9,
    "clutter_region": (-1000.0, 1000.0, -1000.0, 1000.0),
    "std_position": 5.0,
    "birth_std_velocity": (10.0, 10.0),
}
FILTERS = pytest.mark.parametrize(
    ("module", "changes"), [(phd, {}), (mbm, {"poisson": False}), (mbm, {"poisson": True})]
)


def run(module, recording, **changes):
    params = module.Params(**{**MODEL, **changes})
    return list(module.estimate(recording.setup(), recording.scans(), params, None))


def first(z, target):
    return z


def last(z, target):
    return z[::-1]


def by_azimuth(z, target):
    """As a radar turns that begins just after the target."""
    turn = np.arctan2(*z.T[::-1]) - np.arctan2(*target[::-1]) - 0.1
    return z[np.argsort(turn % (2 * np.pi))]


@pytest.mark.parametrize("order", [first, by_azimuth, last])
@FILTERS
def test_a_target_among_much_clutter_is_found_in_any_order_of_rows(
    make_recording, module, changes, order
):
    rng, scans, path = np.random.default_rng(1), [], []
    for k in range(10):
        x = np.array([-300.0 + 8 * k, 400.0 - 5 * k])
        clutter = rng.uniform(-1000, 1000, (300, 2))
        path.append(x)
        scans.append(order(np.vstack((x + 5 * rng.normal(size=2), clutter)), x))
    steps = run(module, make_recording(scans), clutter_rate=300.0, **changes)
    found = [
        len(s.objects.state) > 0 and np.hypot(*(s.objects.state[:, :2] - x).T).min() < 25
        for s, x in zip(steps, path, strict=True)
    ]
    assert sum(found) >= 6


@FILTERS
def test_many_targets_are_as_many_as_there_are(make_recording, module, changes):
    rng = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(np.arange(-700, 800, 100.0), np.arange(-450, 500, 100.0)), -1)
    x = grid.reshape(-1, 2)
    scans = [x + 5 * rng.normal(size=x.shape) for _ in range(6)]
    model = {"clutter_rate": 0.1, "birth_rate": 5.0, "p_detect": 0.99, **changes}
    last_ = run(module, make_recording(scans), **model)[-1]
    assert len(last_.objects.label) == len(x) == 150
    assert last_.steps["cardinality_mean"][0] == pytest.approx(150, abs=2)


@pytest.mark.parametrize(("module", "name"), [(phd, "max_components"), (mbm, "max_tracks")])
def test_what_is_cut_is_said_once_and_stated(make_recording, module, name, caplog):
    """Twenty births of 0.5 with room for twelve: what is left out is expected, and is uncertain."""
    births = tuple((0.5, 100.0 * k - 900, 0.0, 0.0, 0.0, 5.0, 5.0, 1.0, 1.0) for k in range(20))
    model = {"birth": "components", "birth_components": births, "clutter_rate": 1.0}
    model |= {"poisson": False} if module is mbm else {}
    steps = run(module, make_recording([[], []]), p_detect=0.0, **{name: 12}, **model)
    s = steps[0].steps
    assert s["cut"][0] == pytest.approx(8 * 0.5)
    assert s["cardinality_mean"][0] == pytest.approx(20 * 0.5)
    # Of a Poisson process of 10, or 12 Bernoullis and a Poisson number of 4.
    assert s["cardinality_variance"][0] == pytest.approx(10.0 if module is phd else 12 * 0.25 + 4)
    assert len(caplog.records) == 1 and f"{name} cuts off 4 expected targets" in caplog.text


def test_births_that_are_cut_are_said_and_the_others_keep_their_share(make_recording, caplog):
    x = np.stack((100.0 * np.arange(10) - 500, np.zeros(10)), 1)
    state = phd.init()
    recording = make_recording([x])
    context = Context.of(
        recording.setup(), phd.Params(**MODEL, clutter_rate=1.0, max_births=4, birth_rate=1.0)
    )
    state, _ = phd.step(state, recording.scans(), context)
    np.testing.assert_allclose(state.waiting[0], [0.1] * 4)
    assert state.cut["max_births"] == pytest.approx(0.6)
