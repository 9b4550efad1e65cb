"""The jump chain's law: the prior without likelihood, one posterior from every start."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.gsncp import di_gsncp, oracle
from echoset.estimators.gsncp.chain import put, run, table
from echoset.estimators.gsncp.kernels import posterior as gsncp
from echoset.estimators.gsncp.kernels.chains import effective_sample_size
from echoset.metrics.distances import ospa_gw
from echoset.models.parameters import resolve, sensor_model
from echoset.models.random import generator
from echoset.models.records import Estimates, Meta
from echoset.simulate import radar_extended

pytestmark = pytest.mark.verification
REGION = (0.0, 20.0, 0.0, 14.0, 0.0, 10.0)


def scene(preset, seed=1, mean=1.5, off=False):
    """A small scene of two epochs, its chain's parameters, and its true targets."""
    world = radar_extended.Params(
        epochs=2, mean_targets=mean, region=REGION, clutter_rate=8.0, hard_core_radius=5.0
    )
    recording = radar_extended.simulate(world, np.random.default_rng(seed), "small")
    stated = sensor_model(recording, di_gsncp.Params)
    params = resolve(
        di_gsncp.Params, *stated, ("", di_gsncp.PRESETS[preset]), ("", {"uniform": 0.2})
    )
    *_, (_, found) = di_gsncp.scenes(recording.setup(), recording.scans(), params)
    if off:
        found.table[..., 0] = 0.0
        found = found._replace(p_false=1e-290)
    objects = recording.truth.objects
    return found, params, objects.state[: objects.row_offset[1]]


def statistics(found, params, start, intensity, n, rng):
    """Every 100 moves: targets, detections expected, sum of x and of e00, log posterior."""
    state, rows = gsncp.empty(found, 24), []
    put(state, start[:, :3], start[:, 3:])
    moves = np.array(params.moves)
    for i in range(n + n // 10):
        if i % 20 == 0:
            births = table(found, params, intensity, moves, rng)
        info = run(found, state, intensity, births, moves, np.array([0.8, 0.6]), 100, rng)
        L = state.size[0]
        sums = state.rho[:L].sum(), state.c[:L, 0].sum(), state.e[:L, 0].sum()
        rows.append((L, *sums, info.trace[-1]))
    return np.array(rows[n // 10 :], float)


def errors(x):
    """Standard errors (k,) of the means of the columns of a chain (n, k).

    The larger of two estimates: multiplicative steps linger where an element of the extent is
    near zero, rarely but long, which only the means of long batches show.
    """
    batches = np.array([b.mean(0) for b in np.array_split(x, 25)])
    short = [c.std() / np.sqrt(effective_sample_size(c)) for c in x.T]
    return np.maximum(short, batches.std(0, ddof=1) / 5)


@pytest.mark.parametrize("preset", ["default", "paper"])
def test_prior_in_space(preset):
    found, params, _ = scene(preset, off=True)
    intensity, rng = np.array([2e-3, 8 / 2800]), np.random.default_rng(0)
    x = statistics(found, params, np.zeros((0, 9)), intensity, 20_000, rng)
    reference = []
    for L in rng.poisson(intensity[0] * 2800, 200_000):
        c = rng.uniform(found.lower, found.upper, (L, 3))
        e = rng.uniform(found.e_lower, found.e_upper, (L, 6))
        if gsncp.feasible(found, c, e):
            reference.append((L, c[:, 0].sum(), e[:, 0].sum()))
    y = np.array(reference, float)
    x = x[:, [0, 2, 3]]
    spread = np.hypot(errors(x), y.std(0) / np.sqrt(len(y)))
    assert (np.abs(x.mean(0) - y.mean(0)) < 4.5 * spread).all()
    for k in range(8):
        a, b = (x[:, 0] == k) * 1.0, (y[:, 0] == k) * 1.0
        error = np.hypot(errors(a[:, None])[0], b.std() / np.sqrt(len(b)))
        assert abs(a.mean() - b.mean()) <= 4.5 * error


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("seed", [3, 5])
def test_chains_from_different_starts_agree(preset, seed):
    found, params, true = scene(preset, seed)
    intensity, rng = np.array([1e-3, 8 / 2800]), np.random.default_rng(seed)
    a = statistics(found, params, np.zeros((0, 9)), intensity, 12_000, rng)
    b = statistics(found, params, true, intensity, 12_000, rng)
    spread = np.hypot(errors(a), errors(b))
    assert (np.abs(a.mean(0) - b.mean(0)) < 4.5 * np.maximum(spread, 1e-9)).all()


def test_presets_sample_one_posterior():
    intensity, ends = np.array([1e-3, 8 / 2800]), []
    for preset in ("default", "paper"):
        found, params, true = scene(preset, 4)
        rng = np.random.default_rng(7)
        ends.append(statistics(found, params, true, intensity, 12_000, rng))
    a, b = ends
    spread = np.hypot(errors(a), errors(b))
    assert (np.abs(a.mean(0) - b.mean(0)) < 4.5 * np.maximum(spread, 1e-9)).all()


def test_accuracy_is_near_the_oracles():
    ratio = []
    for run_ in range(6):
        name = f"radar-extended-s77-{run_:04d}"
        recording = radar_extended.simulate(
            radar_extended.Params(), generator(77, "simulate", name), name
        )
        found = []
        for module in (di_gsncp, oracle):
            params = resolve(module.Params, *sensor_model(recording, module.Params))
            setup = recording if module is oracle else recording.setup()
            rng = generator(77, "estimate", name)
            *_, last = module.estimate(setup, recording.scans(), params, rng)
            estimates = Estimates(Meta(name, provenance={"estimator": "x"}), last.objects, {})
            scores = ospa_gw.METRIC.score(estimates, recording, ospa_gw.METRIC.Params())
            found.append(scores.value[0])
        ratio.append(found[0] / found[1])
    assert np.mean(ratio) < 1.1 + 4.5 * np.std(ratio, ddof=1) / np.sqrt(len(ratio))
