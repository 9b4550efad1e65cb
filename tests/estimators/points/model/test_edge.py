"""The edge of the view: against integration over a grid, and a target that moves along it."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from echoset.estimators.points import mbm, phd
from echoset.models.radar.detection import View, polar

EDGE = 0.6
VIEW = View(-EDGE, EDGE, 0.0, 200.0)
MODEL = {
    "p_detect": 0.9,
    "clutter_rate": 3.0,
    "std_range": 2.0,
    "std_azimuth": 0.02,
    "birth": "components",
    "p_survive": 1.0,
    "std_acceleration": 0.0,
    "gate": 1e9,
}
FILTERS = pytest.mark.parametrize("module", [phd, mbm])


def recording(make_recording, scans, view=VIEW):
    n = len(scans)
    bounds = {f"view_{k}": np.full(n, getattr(view, k)) for k in View.__slots__}
    bounds = {k: v for k, v in bounds.items() if np.isfinite(v).all()}
    return make_recording(scans, "range_bearing", scan=bounds)


def run(module, recording, **changes):
    begun = {"poisson": False} if module is mbm else {}
    params = module.Params(**{**MODEL, **begun, **changes})
    return list(module.estimate(recording.setup(), recording.scans(), params, None))


def ray(azimuth, distance=100.0, offset=0.0):
    """A point at this range, ``offset`` metres beyond the ray of this azimuth."""
    along = np.array([np.cos(azimuth), np.sin(azimuth)])
    return distance * along + offset * np.array([-along[1], along[0]])


def grid(m, P, size=500):
    """Points of a grid over a Gaussian, and the mass of each."""
    reach = 6 * np.sqrt(np.diag(P))
    axes = (np.linspace(c - r, c + r, size) for c, r in zip(m, reach, strict=True))
    x = np.stack(np.meshgrid(*axes), -1).reshape(-1, 2)
    q = multivariate_normal(m, P).pdf(x)
    return x, q / q.sum()


def component(w, m, std):
    return (w, *m, 0.0, 0.0, std, std, 1e-3, 1e-3)


@FILTERS
@pytest.mark.parametrize("offset", [-4.0, 0.0, 3.0, 9.0])
def test_a_detection_at_the_edge_by_integration(make_recording, module, offset):
    """The mass in view is that of what the detection has updated, not of what was predicted."""
    m = ray(EDGE, offset=offset)
    z = np.array([100.0, EDGE - 0.01])
    step = run(
        module, recording(make_recording, [[z]]), birth_components=(component(0.7, m, 6.0),)
    )[0]
    x, q = grid(m, 36.0 * np.eye(2))
    h = np.stack(polar(x), 1)
    likelihood = multivariate_normal(z, np.diag([4.0, 0.0004])).pdf(h)
    seen = VIEW.contains(*h.T)
    clutter = 3.0 / VIEW.area
    hit, missed = 0.7 * 0.9 * (q * likelihood * seen).sum(), 0.7 * (q * (1 - 0.9 * seen)).sum()
    if module is phd:
        expected = hit / (hit + clutter) + missed
    else:
        miss = 1 - 0.7 + missed
        expected = (hit + clutter * missed) / (hit + clutter * miss)
    assert step.steps["cardinality_mean"][0] == pytest.approx(expected, abs=0.02)


@FILTERS
@pytest.mark.parametrize("offset", [-3.0, 0.0, 4.0])
def test_what_nobody_looked_at_is_not_forgotten(make_recording, module, offset):
    """Six misses of one that stands still across the edge: the part outside is left."""
    m = ray(EDGE, offset=offset)
    birth = component(0.9, m, 6.0)
    steps = run(
        module, recording(make_recording, [[]] * 6), birth_components=(birth,), time_unit=1e9
    )
    x, q = grid(m, 36.0 * np.eye(2))
    left = 0.9 * (q * (1 - 0.9 * VIEW.contains(*polar(x))) ** 6).sum()
    if module is mbm:
        left /= 1 - 0.9 + left
    assert steps[-1].steps["cardinality_mean"][0] == pytest.approx(left, rel=0.06)


@FILTERS
def test_a_view_without_end_in_range_has_edges_too(make_recording, module):
    view = View(-EDGE, EDGE)
    region = {"clutter_region": (-300.0, 300.0, -300.0, 300.0)}
    birth = component(0.5, ray(EDGE), 6.0)
    step = run(module, recording(make_recording, [[]], view), birth_components=(birth,), **region)[
        0
    ]
    left = 0.5 * (1 - 0.9 / 2)
    expected = left if module is phd else left / (0.5 + left)
    assert step.steps["cardinality_mean"][0] == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize(
    ("module", "changes"), [(phd, {}), (mbm, {"poisson": False}), (mbm, {"poisson": True})]
)
def test_a_target_along_the_edge_is_one(make_recording, module, changes):
    """Straight out along the border, a metre inside, so that its noise is on both sides."""
    rng, shown, known = np.random.default_rng(3), [], []
    for _ in range(6):
        scans = []
        for k in range(40):
            x = ray(EDGE, 60.0 + 2 * k, -1.0)
            inside = rng.random() < 0.9
            noise = rng.normal(size=2) * (2.0, 0.02)
            z = [np.array(polar(x)) + noise] if inside else []
            scans.append(np.reshape(z, (-1, 2)))
        steps = run(
            module, recording(make_recording, scans), birth="detections", clutter_rate=1.0,
            birth_rate=0.05, birth_std_velocity=(3.0, 3.0), std_acceleration=0.2,
            p_survive=0.99, gate=25.0, **changes,
        )  # fmt: skip
        shown += [len(s.objects.label) for s in steps[10:]]
        known += [s.steps["cardinality_mean"][0] for s in steps[10:]]
    assert 0.8 < np.mean(shown) < 1.4
    # The PHD filter counts the part that may be out of view beside what is detected: exactly so,
    # at the time, by integration. It does not carry it on.
    assert 0.8 < np.mean(known) < (1.7 if module is phd else 1.4)


PATHS = {
    "inside": [ray(EDGE, 60.0 + 2 * k, -3.0) for k in range(40)],
    "the other side, inwards": [ray(-EDGE, 140.0 - 2 * k, 2.0) for k in range(40)],
    "still": [ray(EDGE, 100.0, -1.0)] * 40,
    "along the end in range": [ray(-0.4 + 0.02 * k, 198.0) for k in range(40)],
    "across, outwards": [ray(EDGE, 100.0, -30.0 + k) for k in range(25)],
}


@FILTERS
@pytest.mark.parametrize("p_detect", [0.9, 0.6])
@pytest.mark.parametrize("path", list(PATHS))
def test_targets_about_the_border_are_found_once(make_recording, module, p_detect, path):
    """Shown as often as the filter of one target is sure of it: about once, near where it is."""
    shown, found = [], []
    for seed in range(2):
        rng, scans = np.random.default_rng(seed), []
        for x in PATHS[path]:
            h = np.array(polar(x))
            z = [h + rng.normal(size=2) * (2.0, 0.02)] if rng.random() < p_detect else []
            scans.append(np.reshape(z, (-1, 2)))
        steps = run(
            module, recording(make_recording, scans), birth="detections", clutter_rate=1.0,
            birth_rate=0.05, birth_std_velocity=(3.0, 3.0), std_acceleration=0.2,
            p_survive=0.99, gate=25.0, p_detect=p_detect,
        )  # fmt: skip
        for x, step in list(zip(PATHS[path], steps, strict=True))[10:]:
            shown.append(len(step.objects.label))
            far = np.hypot(*(step.objects.state[:, :2] - x).T)
            found.append(far.min(initial=np.inf) < 15)
    # Of two looks that miss one after the other the PHD filter forgets; p_detect of them is found.
    least = min(p_detect, 0.8) if module is phd else 0.8
    assert least < np.mean(shown) < 1.4
    assert np.mean(found) > least
