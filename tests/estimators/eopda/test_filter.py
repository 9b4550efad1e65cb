"""The filter of a carried device against grids, closed forms and its own contract."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
import yaml

from echoset.estimators.eopda import ap_pda
from echoset.estimators.eopda import geo as eopda_geo
from echoset.estimators.eopda import ideal as eopda_ideal
from echoset.estimators.eopda.cloud.resampling import normalise
from echoset.estimators.eopda.extract import extract
from echoset.estimators.eopda.filter import predict, reduce, shown, turn
from echoset.estimators.eopda.links import Links
from echoset.estimators.eopda.state import Height, State
from echoset.estimators.eopda.weighing import weigh_active
from echoset.models.checks import check
from echoset.models.errors import EstimatorError, InputError, ParameterError
from echoset.models.parameters import resolve
from echoset.models.records import Meta, Recording, Sensor, Stream
from echoset.models.registry import load
from echoset.simulate import uwb

NAMES = ("eopda-geo", "eopda-ideal", "a-eopda-geo", "a-eopda-ideal", "ap-pda")
ANCHORS = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 3.0]])
KNOWN = Height(0.0, 0.0, 0.0, np.inf)
BOX = [0.0, 0.0, 4.0, 3.0]


@pytest.fixture(scope="module")
def scene() -> Recording:
    """Six steps of the scenario, blocked from the fifth on."""
    text = (files("echoset.simulate") / "scenarios" / "uwb-los.yaml").read_text()
    params = resolve(uwb.Params, ("uwb-los", yaml.safe_load(text)["parameters"]))
    blocked = ((5, 6, 1), (5, 6, 2), (5, 6, 3))
    params = replace(params, steps=6, dt=0.05, blocked=blocked)
    return uwb.simulate(params, np.random.default_rng(5), "example")


def run(name, recording, seed=1, **settings):
    """Estimates of all steps of the estimator ``name``."""
    estimator = load("echoset.estimators", name)
    model = recording.streams["uwb"].model
    known = {k: v for k, v in model.items() if k in estimator.Params.__dataclass_fields__}
    params = resolve(estimator.Params, ("model", known), ("settings", settings))
    rng = np.random.default_rng(seed)
    return list(estimator.estimate(recording.setup(), recording.scans(), params, rng))


def ranging(z, anchors, seconds, positions=ANCHORS, **model) -> Recording:
    """A two-way ranging log: one range ``z`` to each of ``anchors`` at each of ``seconds``."""
    n = len(z)
    nodes = (*(f"A{j}" for j in range(len(positions))), "D")
    sensors = {f"A{j}": Sensor.static("anchor", p) for j, p in enumerate(positions)}
    scan = {
        "mode": np.zeros(n, "u1"),
        "tx": np.full(n, len(positions), "i4"),
        "rx": np.asarray(anchors, "i4"),
    }
    stream = Stream(
        "uwb",
        nodes,
        {"mean_scatter": 0.0, "mean_los": 1.0, "sigma": 0.1} | model,
        np.rint(np.asarray(seconds) * 1e9).astype(np.int64),
        np.arange(n + 1),
        scan,
        {"distance": np.asarray(z, float)},
    )
    return Recording(Meta("log"), sensors | {"D": Sensor.device()}, {"uwb": stream})


def particles(y, w=None) -> State:
    """Particles in the plane without errors of ranges."""
    n = y.shape[1]
    w = np.full(n, 1 / n) if w is None else w
    return State(y, w, np.zeros((n, 0)), np.zeros((n, 0, 0)), hidden=0.1)


def column(estimates, *names):
    return np.concatenate([e.objects.columns(*names) for e in estimates])


@pytest.mark.parametrize("name", NAMES)
def test_estimates_keep_the_contract(name, scene):
    out = run(name, scene, particles=300)
    assert [e.objects.time_ns[0] for e in out] == scene.truth.objects.time_ns.tolist()
    for e in out:
        check(replace(e, meta=Meta("example", provenance={"estimator": name})))
        ess = e.steps["effective_sample_size"][0]
        assert 1 <= ess <= 300 * (1 + 1e-9) and e.steps["cardinality_mean"] == 1
    extent = {"i": ("a", "b", "w"), "g": ("r", "w"), "p": ()}[name.split("-")[-1][0]]
    known = ("x", "y", "vx", "vy", "b_rho", "b_phi", *extent, "device_x", "device_y")
    assert out[0].objects.state_names == known


@pytest.mark.parametrize("name", NAMES)
def test_the_truth_is_not_seen_and_seeds_decide(name, scene):
    blind = replace(scene.observed(), truth=None)
    a, b, c = (
        run(name, r, seed, particles=200) for r, seed in ((scene, 1), (blind, 1), (blind, 2))
    )
    for x, y, z in zip(a, b, c, strict=True):
        assert (x.objects.state == y.objects.state).all()
        assert (x.objects.covariance == y.objects.covariance).all()
        assert not (x.objects.state == z.objects.state).all()


@pytest.mark.parametrize("name", NAMES)
def test_one_anchor_at_a_time(name, scene):
    """Events in any order of time, one link each, passive links alone: all are tracked."""
    stream = scene.streams["uwb"]
    times = np.arange(len(stream), dtype=np.int64) * 7_000_000
    lone = replace(scene, streams={"uwb": replace(stream, time_ns=times)})
    assert len(run(name, lone, particles=100)) == len(stream)
    keep = stream.scan["mode"] == 1
    first = int(keep.argmax())
    passive = replace(scene, streams={"uwb": stream.part(first, first + 9)})
    assert len(run(name, passive, particles=100)) == 1


def grid_posterior(z, sigma, clutter, n=500):
    """Mean and standard deviation of a device in the anchors' box, by enumeration."""
    x, y = np.meshgrid((np.arange(n) + 0.5) / n * 4.0, (np.arange(n) + 0.5) / n * 3.0)
    p = np.stack((x.ravel(), y.ravel()), 1)
    L = np.ones(len(p))
    for a, d in zip(ANCHORS, z, strict=True):
        e = (d - np.hypot(*(p - a).T)) / sigma
        L *= clutter + np.exp(-(e**2) / 2) / sigma / np.sqrt(2 * np.pi)
    L /= L.sum()
    mean = L @ p
    return mean, np.sqrt(L @ (p - mean) ** 2)


@pytest.mark.parametrize("z", [(2.5, 2.5, 2.5), (2.0, 2.9, 1.4), (1.0, 3.1, 5.9)])
def test_first_posterior_equals_a_grid(z):
    """With lines of sight alone the posterior of the first step is two-dimensional."""
    record = ranging(z, [0, 1, 2], [1.0, 1.0, 1.0])
    mean, std = grid_posterior(z, 0.1, 5.0 / 20.0)
    few = {"particles": 2000, "area": BOX, "max_range": 20.0}
    out = [run("a-eopda-geo", record, seed, **few)[0] for seed in range(12)]
    m = np.concatenate([e.objects.columns("device_x", "device_y") for e in out])
    s = np.sqrt(np.stack([np.diag(e.objects.covariance[0])[-2:] for e in out]))
    assert (np.abs(m.mean(0) - mean) < 4.5 * m.std(0, ddof=1) / np.sqrt(12) + 1e-3).all()
    assert (np.abs(s.mean(0) - std) < 4.5 * s.std(0, ddof=1) / np.sqrt(12) + 1e-3).all()
    assert (m.std(0) < std / 4).all()


def test_prediction_has_the_moments_of_the_linear_model():
    rng = np.random.default_rng(3)
    n, dt = 200_000, 0.25
    params = eopda_geo.Params(acceleration_std=2.0)
    y = np.vstack((rng.normal(size=(4, n)), np.full((2, n), 0.3), np.full((3, n), 0.4)))
    x = predict(particles(y), dt, eopda_geo.CIRCLE, params, rng, KNOWN).y
    F = np.eye(4) + dt * np.eye(4, k=2)
    G = np.vstack((dt**2 / 2 * np.eye(2), dt * np.eye(2)))
    # the velocity's variance grows by (2 m/s^2 0.1 s)^2 every 0.1 s
    P = F @ F.T + G @ G.T * (2.0**2 * 0.1 / dt)
    assert np.allclose(np.cov(x[:4]), P, atol=4.5 * 2 * P.max() / np.sqrt(n))
    assert abs(x[6].std() / (0.05 * np.sqrt(2.5)) - 1) < 4.5 / np.sqrt(2 * n)
    assert (x[4:6] == y[4:6]).all() and (x[8] == y[8]).all()


def test_candidates_do_not_change_the_posterior():
    """Mean and variance of the device are those of the plain random walk, candidates = 1."""
    n, dt, target = 4000, 0.1, eopda_geo.CIRCLE
    anchors = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    z = np.hypot(1.8, 1.5) + np.array([-0.05, 0.1, 0.5])
    active = Links(np.array([3]), np.array([0]), np.array([0, 3]), z, np.full(3, 0.05**2))

    def moments(candidates, seed):
        rng = np.random.default_rng(seed)
        params = eopda_geo.Params(candidates=candidates, max_range=20.0)
        y = np.zeros((9, n))
        y[:2] = np.array([[2.0], [1.5]]) + 0.02 * rng.normal(size=(2, n))
        y[4], y[5], y[6], y[7] = 0.3, 2.5, 0.3, 0.1
        state = replace(particles(y), hidden=dt)
        state, _ = turn(state, anchors, active, params, rng)
        log_l, state = weigh_active(state, anchors, active, target, params)
        state = replace(state, w=normalise(np.log(state.w) + log_l))
        o = extract(state, 0, target, params, True).objects
        return [*o.state[0, [4, 5, 8]], *np.diag(o.covariance[0])[[4, 5, 8, 9]]]

    one, many = (np.array([moments(k, seed) for seed in range(30)]) for k in (1, 6))
    error = np.sqrt((one.var(0, ddof=1) + many.var(0, ddof=1)) / 30)
    assert (np.abs(one.mean(0) - many.mean(0)) < 4.5 * error).all()
    assert (many.std(0) < one.std(0)).mean() > 0.5


def test_still_ranges_average():
    """A device that cannot move: ranges without clutter average like independent Gaussians."""
    still = {"acceleration_std": 0.0, "speed_std": 1e-9, "mean_clutter": 0.0}
    z = np.tile([2.5, 2.5, 2.5], 20) + 0.1 * np.random.default_rng(4).normal(size=60)
    record = ranging(z, np.tile([0, 1, 2], 20), np.repeat(np.arange(20) * 0.1, 3))
    p = np.array([2.0, 1.5])
    for _ in range(20):
        d = np.hypot(*(p - ANCHORS).T)
        H = (p - ANCHORS) / d[:, None]
        p = p + np.linalg.solve(H.T @ H, H.T @ (z.reshape(-1, 3).mean(0) - d))
    P = np.linalg.inv(H.T @ H) * 0.01 / 20
    out = run("a-eopda-geo", record, particles=20_000, **still)[-1]
    # particles that do not move lose variety: a tenth of the spread is what is left to chance
    error = column([out], "device_x", "device_y")[0] - p
    assert (np.abs(error) < 0.5 * np.sqrt(np.diag(P))).all()


def test_range_bias_is_taken_off_or_estimated():
    t = np.arange(150) * 0.1
    path = np.stack((2 + 1.2 * np.cos(0.4 * t), 1.5 + 0.9 * np.sin(0.4 * t)), 1)
    rx = np.arange(150) % 3
    z = np.hypot(*(path - ANCHORS[rx]).T) + 0.02 * np.random.default_rng(5).normal(size=150)
    plain, biased = (ranging(z + b, rx, t, sigma=0.02) for b in (0.0, 0.25))
    known, fixed = (
        column(run("a-eopda-geo", r, particles=500, range_bias=b), "device_x", "device_y")
        for r, b in ((plain, 0.0), (biased, 0.25))
    )
    assert np.allclose(known, fixed, atol=1e-6)
    out = run("a-eopda-geo", biased, range_bias_std=0.3)
    spread = np.sqrt(out[-1].objects.covariance[0, 4, 4])
    assert out[0].objects.state_names[4] == "range_bias"
    assert abs(column(out[-1:], "range_bias")[0, 0] - 0.25) < 4.5 * spread < 0.1


def test_resampling_takes_all_of_a_particle_along():
    rng = np.random.default_rng(6)
    n = 1000
    y, mean = np.arange(9.0 * n).reshape(9, n), np.arange(2.0 * n).reshape(n, 2)
    w = np.exp(-0.01 * np.arange(n))
    state = State(y, w / w.sum(), mean, np.tile(np.eye(2), (n, 1, 1)) * mean[:, :1, None], 0.3)
    kept = reduce(state, rng)
    index = kept.y[0].astype(int)
    assert (kept.w == 1 / n).all() and kept.hidden == 0.3 and len(set(index)) < n / 2
    assert (kept.y == y[:, index]).all() and (kept.mean == mean[index]).all()
    assert (kept.covariance == state.covariance[index]).all()


def test_a_hidden_device_is_shown_where_its_walk_leads_on_average():
    """Of few heavy particles, too: by the mean of a wrapped Gaussian."""
    rng = np.random.default_rng(9)
    n, length, hidden = 5000, 0.3, 0.4
    y = np.zeros((9, n))
    y[4], y[5] = length, 0.7
    w = np.where(np.arange(n) < 4, 0.24, 0.04 / (n - 4))
    params = eopda_geo.Params(max_range=20.0, bias_distance_std=0.0, bias_angle_std=0.5)
    state = State(y, w, np.zeros((n, 0)), np.zeros((n, 0, 0)), hidden)
    out = shown(state, params, rng)
    far = length * np.exp(-(0.5**2) * hidden / 0.1 / 2)
    expected = far * np.array([np.cos(0.7), np.sin(0.7)])
    assert np.abs(out.device @ out.w - expected).max() < 4.5 * length / np.sqrt(n)


def test_angles_are_averaged_on_the_circle():
    y = np.zeros((9, 2))
    y[4], y[5], y[6:8] = 1.0, [np.pi - 0.1, 0.1 - np.pi], 0.2
    params = eopda_geo.Params()
    state = particles(y, np.array([0.5, 0.5]))
    o = extract(state, 0, eopda_geo.CIRCLE, params, True).objects
    assert np.isclose(abs(o.columns("b_phi")[0, 0]), np.pi)
    assert np.isclose(o.covariance[0, 5, 5], 0.01)
    assert np.allclose(o.columns("device_x", "device_y"), [[-np.cos(0.1), 0.0]])


def test_start_covers_collinear_anchors_and_a_given_area():
    line = np.array([[0.0, 0.0], [4.0, 0.0]])
    z, rx = np.hypot([2.0, 2.0], 1.5), [0, 1]
    both = run("a-eopda-geo", ranging(z, rx, [0.0, 0.0], line), particles=2000)
    assert abs(column(both, "device_x")[0, 0] - 2) < 0.5
    assert np.sqrt(both[0].objects.covariance[0, -1, -1]) > 1.0
    above = run("a-eopda-geo", ranging(z, rx, [0.0, 0.0], line), area=[-1.0, 0.0, 5.0, 4.0])
    assert abs(column(above, "device_y")[0, 0] - 1.5) < 0.5


def test_scans_are_taken_one_time_at_a_time(scene):
    taken = []
    scans = (taken.append(scan.time_ns) or scan for scan in scene.scans())
    params = eopda_geo.Params(particles=100, rms_bandwidth=1e8, max_range=20.0)
    out = eopda_geo.ACTIVE_PASSIVE.estimate(scene.setup(), scans, params, np.random.default_rng(1))
    for k, estimate in enumerate(out):
        # a group ends when the first event of the next time is seen
        assert max(taken) <= scene.truth.objects.time_ns[min(k + 1, 5)]
        assert estimate.objects.time_ns[0] == scene.truth.objects.time_ns[k]


def test_vanishing_weights_end_with_the_time():
    def impossible(state, anchors, links, excess, params):
        return np.full(state.y.shape[1], 0.0 if links.z.sum() < 3 else -np.inf)

    record = ranging([2.5, 3.5], [0, 1], [1.0, 2.5])
    target = replace(eopda_geo.CIRCLE, log_likelihood=impossible)
    params = eopda_geo.Params(particles=200, sigma=0.1)
    estimator = replace(eopda_geo.ACTIVE, target=target)
    out = estimator.estimate(record.setup(), record.scans(), params, np.random.default_rng(1))
    assert next(out).objects.time_ns[0] == 1_000_000_000
    with pytest.raises(EstimatorError, match=r"log: at 2\.5 s: all particle weights vanish"):
        next(out)


def test_what_is_missing_is_named(scene):
    stream = scene.streams["uwb"]
    with pytest.raises(InputError, match="rms_bandwidth"):
        run("eopda-geo", replace(scene, streams={"uwb": replace(stream, model={})}))
    with pytest.raises(InputError, match="UWB stream"):
        run_params = eopda_ideal.Params()
        setup = replace(scene.setup(), streams={})
        rng = np.random.default_rng(1)
        list(eopda_ideal.ACTIVE_PASSIVE.estimate(setup, [], run_params, rng))


@pytest.mark.parametrize(
    ("cls", "name", "value"),
    [
        (eopda_geo.Params, "mean", "median"),
        (eopda_geo.Params, "particles", 0),
        (eopda_geo.Params, "width_prior", (0.2, 0.1)),
        (eopda_geo.Params, "area", (0.0, 0.0, 0.0, 1.0)),
        (eopda_ideal.Params, "scatterers", 0),
        (eopda_ideal.Params, "sigma", -1.0),
        (ap_pda.Params, "p_detect", 1.0),
    ],
)
def test_impossible_parameters_are_refused(cls, name, value):
    with pytest.raises(ParameterError, match=name):
        resolve(cls, ("settings", {name: value}))


def test_an_offset_that_is_hidden_has_the_law_of_one_that_walks():
    """Ten steps drawn at once, against ten steps drawn one by one with the length reflected."""
    n, rng = 40_000, np.random.default_rng(8)
    y = np.zeros((9, n))
    y[4], y[5] = 0.15, 1.0
    params = eopda_geo.Params(max_range=20.0)
    none = Links(np.zeros(0, int), np.zeros(0, int), np.zeros(1, int), np.zeros(0), np.zeros(0))
    state = replace(particles(y), hidden=1.0)
    at_once, gain = turn(state, np.zeros((1, 3)), none, params, rng)
    length, angle = y[4].copy(), y[5].copy()
    for _ in range(10):
        length = np.abs(length + 0.1 * rng.normal(size=n))
        angle += 0.5 * rng.normal(size=n)
    assert at_once.hidden == 0 and abs(gain) < 1e-9
    for a, b in ((at_once.y[4], length), (at_once.y[5], angle)):
        for power in (1, 2):
            error = np.sqrt((np.var(a**power) + np.var(b**power)) / n)
            assert abs((a**power).mean() - (b**power).mean()) < 4.5 * error
