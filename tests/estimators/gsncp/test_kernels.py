"""The posterior against its formula written out, the twins against each other, the prior's law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from echoset.estimators.gsncp import di_gsncp
from echoset.estimators.gsncp.chain import put, run
from echoset.estimators.gsncp.kernels import moves as gsncp_moves
from echoset.estimators.gsncp.kernels import posterior as gsncp
from echoset.estimators.gsncp.kernels.chains import effective_sample_size
from echoset.estimators.gsncp.kernels.compiled import moves as compiled_moves
from echoset.estimators.gsncp.kernels.compiled import posterior as compiled
from echoset.estimators.gsncp.kernels.posterior import NORMALS, UNIFORMS, Births, Scene
from echoset.models.geometry.grids import Grid
from echoset.models.radar import ofdm
from echoset.simulate import radar_extended

INTENSITY = np.array([1e-3, 3.5e-3])
NONE = Births(np.zeros((0, 3)), np.zeros(0), 1.0, 0.0)


@pytest.fixture(scope="module")
def world():
    """A scene of two epochs, its true targets and, to check with, its recording."""
    params = radar_extended.Params(epochs=2, mean_targets=5.0, clutter_rate=10.0)
    recording = radar_extended.simulate(params, np.random.default_rng(6), "small")
    objects = recording.truth.objects
    true = objects.state[: objects.row_offset[1]]
    setting = di_gsncp.Params(clutter_region=params.region, gate=60.0)
    scenes = [s for _, s in di_gsncp.scenes(recording.setup(), recording.scans(), setting)]
    return scenes[-1], (true[:, :3], true[:, 3:]), recording


def plane(n: int = 30, spread: float = 1.0, uniform: float = 0.05) -> Scene:
    """A scene in the plane: one sensor state of constant noise, some detections."""
    rng = np.random.default_rng(2)
    table = np.zeros((1, 1, 1, 1, 7))
    table[0, 0, 0, 0] = [0.9, 0.04, 0.01, 0.0, 0.09, 0.0, 1 / (2 * np.pi) - 1]
    z = np.vstack([np.sort(rng.uniform(0, 12, n)), rng.uniform(0, 8, n), np.zeros(n)])
    return Scene(
        z, np.array([0, n]), table, np.zeros(3), np.ones(3), np.zeros(7), np.zeros((1, 3)),
        np.eye(3)[None], np.array([[0.0, 0, 0, 0, 2.0]]), np.zeros(3), np.array([12.0, 8.0, 0.0]),
        np.array([1.0, -0.5, 1, 0, 0, 1]), np.array([1.5, 0.5, 1.5, 0, 0, 1]), 3.0, 1e-3, 60.0,
        np.ones(n), rng.uniform(0.5, 2.0, n), spread, uniform, True,
    )  # fmt: skip


def half_seen(scene: Scene) -> Scene:
    """A scene in the plane of which the half x < 6 m is seen, and the other is not."""
    table = np.repeat(scene.table, 13, axis=1)
    table[:, 6:, ..., 0] = 0.0
    return scene._replace(table=table)


def test_posterior_is_the_formula(world):
    scene, (c, e), recording = world
    total, D = 0.0, 50 * 20 * 10
    grid = Grid.around(np.zeros(3), np.array([50.0, 20.0, 10.0]), 2.5)
    for name in ("R0", "R1"):
        stream, sensor = recording.streams[name], recording.sensors[name]
        for k in range(2):
            rows = slice(*stream.row_offset[k : k + 2])
            z = np.stack([stream.rows[a][rows] for a in "xyz"], 1) + sensor.position[k]
            bare = ofdm.State(ofdm.Radar(), sensor.position[k], np.eye(3), np.zeros((0, 576)))
            Z = np.full(len(z), INTENSITY[1])
            for cl, el in zip(c, e, strict=True):
                E = np.zeros((3, 3))
                E[np.tril_indices(3)] = el
                p = grid.interpolate(stream.model["p_detect_table"][k], cl[None], np.array(0.0))[0]
                S = np.zeros((3, 3))
                for i, j in zip(*np.triu_indices(3), strict=True):
                    key = f"cov_{'xyz'[i]}{'xyz'[j]}_table"
                    S[i, j] = S[j, i] = grid.interpolate(
                        stream.model[key][k], cl[None], np.array(0.0)
                    )[0]
                rho = max(1e-3, p) * max(1.0, np.linalg.det(E) * ofdm.resolution(bare, cl))
                Z += rho * multivariate_normal(cl, S + E @ E.T).pdf(z)
                total -= rho
            total += (1 - INTENSITY[1]) * D + np.log(Z).sum()
    total += len(c) * (np.log(INTENSITY[0]) + np.log(8.0))
    found = gsncp.log_posterior(scene, c, e, INTENSITY)
    assert found == pytest.approx(total, rel=1e-11, abs=1e-6)
    state = gsncp.empty(scene, 16)
    put(state, c, e)
    compiled.refresh(scene, state)
    assert compiled.log_posterior(scene, state, INTENSITY) == pytest.approx(found, rel=1e-12)


def test_prior_rules_out_what_is_close_outside_or_too_large(world):
    scene, (c, e), _ = world
    for change in ((0, c[1] + 5.9 * np.eye(3)[0], e[0]), (0, [51.0, 1, 1], e[0]),
                   (0, c[0], [1.6, 0, 1, 0, 0, 1])):  # fmt: skip
        there = gsncp_moves.replaced((c, e), *change)
        assert gsncp.log_posterior(scene, *there, INTENSITY) == -np.inf


def test_a_problem_in_the_plane_is_one_in_space():
    scene = plane()
    c, e = np.array([[5.0, 4.0, 0.0]]), np.array([[1.2, 0.3, 1.4, 0.0, 0.0, 1.0]])
    rho, eta, _ = gsncp.columns(scene, c, e)
    E = np.array([[1.2, 0.0], [0.3, 1.4]])
    S = np.array([[0.04, 0.01], [0.01, 0.09]]) + E @ E.T
    assert rho[0, 0] == pytest.approx(0.9 * 1.2 * 1.4 * 2.0)
    density = multivariate_normal(c[0, :2], S).pdf(scene.z[:2].T)
    np.testing.assert_allclose(eta[0], rho[0, 0] * density, rtol=1e-9, atol=1e-12)


def test_detections_beyond_the_region_are_clutter_as_rarely_as_said():
    """Against the product of densities written out; intensities tell of those inside alone."""
    scene = plane()
    scene.z[0, :3], scene.z[1, :3] = (-0.5, -1.0, -2.0), (4.0, 4.5, 0.5)
    scene = scene._replace(beyond=np.where(scene.z[0] < 0, 0.01, 1.0))
    c, e = np.array([[0.5, 4.0, 0.0]]), np.array([[1.2, 0.3, 1.4, 0.0, 0.0, 1.0]])
    E = np.array([[1.2, 0.0], [0.3, 1.4]])
    S = np.array([[0.04, 0.01], [0.01, 0.09]]) + E @ E.T
    rho = 0.9 * 1.2 * 1.4 * 2.0
    clutter = INTENSITY[1] * np.where(scene.z[0] < 0, 0.01, 1.0)
    density = rho * multivariate_normal(c[0, :2], S).pdf(scene.z[:2].T)
    gain = np.log(clutter + density).sum() - np.log(clutter).sum() - rho
    gain += np.log(INTENSITY[0] / (0.5 * 1.0 * 0.5))
    nothing = (np.zeros((0, 3)), np.zeros((0, 6)))
    logs = []
    for targets in ((c, e), nothing):
        state = gsncp.empty(scene, 2)
        put(state, *targets)
        compiled.refresh(scene, state)
        logs.append(gsncp.log_posterior(scene, *targets, INTENSITY))
        assert compiled.log_posterior(scene, state, INTENSITY) == pytest.approx(logs[-1], rel=1e-12)
    assert logs[0] - logs[1] == pytest.approx(gain, rel=1e-9)
    all_false = np.ones(30, bool)
    assert gsncp.intensities(scene, 0, 0.0, all_false, 96.0)[1] == pytest.approx(27 / 96)


@pytest.mark.parametrize("informed", [True, False])
@pytest.mark.parametrize("flat", [True, False])
def test_twins_make_the_same_chain(world, informed, flat):
    scene = (half_seen(plane()) if flat else world[0])._replace(informed=informed)
    scene = scene._replace(beyond=np.linspace(0.2, 1.0, len(scene.weight)))
    start = (np.zeros((0, 3)), np.zeros((0, 6))) if flat else world[1]
    rng, n = np.random.default_rng(3), 400
    points = scene.z.T[::7].copy()
    births = Births(points, np.full(len(points), 1 / len(points)), 0.4, 2.0)
    moves, scale = np.cumsum([0.2, 0.2, 0.15, 0.1, 0.15, 0.2]), np.array([1.0, 0.4])
    U, G = rng.random((n, UNIFORMS)), rng.normal(size=(n, NORMALS))
    ends = []
    for kernels in (gsncp_moves, compiled_moves):
        state = gsncp.empty(scene, 8)
        put(state, *start)
        trace, count, tried = np.zeros(n), np.zeros(n, np.int64), np.zeros((2, 6), np.int64)
        kernels.chain(scene, state, INTENSITY, births, moves, scale, U, G, trace, count, *tried)
        ends.append((trace, count, tried, state))
    (trace, count, tried, state), (trace2, count2, tried2, state2) = ends
    np.testing.assert_allclose(trace2, trace, rtol=1e-11)
    np.testing.assert_array_equal(count2, count)
    np.testing.assert_array_equal(tried2, tried)
    assert (tried[1][[0, 1]] > 0).all() and (np.ptp(count) > 0 or not flat)
    for name in ("c", "e", "rho", "A"):
        L = state.size[0]
        np.testing.assert_allclose(getattr(state2, name)[:L], getattr(state, name)[:L], rtol=1e-9)
    np.testing.assert_allclose(state2.eta, state.eta, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(state2.shot, state.shot, rtol=1e-8, atol=1e-12)


def test_half_a_plane_that_is_seen_holds_a_target_as_often_as_the_law_says():
    scene, rng = half_seen(plane(0)), np.random.default_rng(4)
    box = np.array([1.0, 0, 1, 0, 0, 1])
    scene = scene._replace(e_lower=box, e_upper=box)
    x = np.arange(0.005, 12, 0.01)
    law = np.exp(-2 * np.interp(x, np.arange(13), np.where(np.arange(13) < 6, 0.9, 1e-3)))
    exact = law[x < 6].sum() / law.sum()
    state, seen = gsncp.empty(scene, 1), []
    put(state, np.array([[3.0, 4, 0]]), box[None])
    steps, scale = np.array([1.0, 0, 0, 0, 0, 0]), np.array([0.3, 1.0])
    for _ in range(10_000):
        run(scene, state, INTENSITY, NONE, steps, scale, 100, rng)
        seen.append(float(state.c[0, 0] < 6))
    share = np.array(seen)
    error = np.sqrt(exact * (1 - exact) / effective_sample_size(share))
    assert error < 0.02
    assert abs(share.mean() - exact) < 4.5 * error


@pytest.mark.parametrize("informed", [True, False])
@pytest.mark.parametrize("flat", [True, False])
def test_steps_know_the_ratio_of_their_densities(world, informed, flat):
    if flat:
        scene = half_seen(plane())
        targets = np.array([[5.5, 4.0, 0.0]]), np.array([[1.2, 0.2, 1.1, 0, 0, 1]])
    else:
        scene, targets, _ = world
    scene = scene._replace(informed=informed)
    open_, open_e = scene.upper > scene.lower, scene.e_upper > scene.e_lower
    scale, g = np.array([1.3, 0.2]), np.random.default_rng(5).normal(size=6)
    for l in range(len(targets[0])):
        (c, e), ratio = gsncp_moves.move_position(scene, targets, l, scale, g)
        ends = targets[0][l], c[l]
        A = [gsncp.columns(scene, x[None], e[l : l + 1])[2][0][open_][:, open_] for x in ends]
        P = [np.linalg.inv(a) for a in A]
        forth, back = (
            multivariate_normal(a[open_], scale[0] ** 2 * S).logpdf(b[open_])
            for a, b, S in ((*ends, P[0]), (*ends[::-1], P[1]))
        )
        assert ratio == pytest.approx(back - forth, abs=1e-9)

        there, ratio = gsncp_moves.move_extent(scene, targets, l, scale, 0.05 * g)
        ends = targets[1][l], there[1][l]
        std = [gsncp_moves.extent_step(scene, targets[0][l], x, scale)[open_e] for x in ends]
        ends = ends[0][open_e], ends[1][open_e]
        forth, back = (
            norm(a, s).logpdf(b).sum() for a, b, s in ((*ends, std[0]), (*ends[::-1], std[1]))
        )
        if np.isfinite(ratio):
            assert ratio == pytest.approx(back - forth, abs=1e-9)


def test_density_of_births_integrates_to_one():
    scene = plane(spread=0.7, uniform=1e-9)
    targets = np.array([[3.0, 3.0, 0.0]]), np.array([[1.0, 0, 1, 0, 0, 1]])
    x, y = np.meshgrid(np.arange(-6, 18, 0.3), np.arange(-6, 14, 0.3), indexing="ij")
    q = [
        gsncp_moves.log_density(scene, targets, INTENSITY, np.array([a, b, 0.0]))
        for a, b in zip(x.ravel(), y.ravel(), strict=True)
    ]
    volume = gsncp.free(scene.e_lower, scene.e_upper)[1]
    assert np.exp(q).sum() * 0.09 * volume == pytest.approx(1.0, rel=1e-6)


def likelihood_off(flat: bool = False) -> Scene:
    """A scene whose detections steer the births but say nothing."""
    scene = plane(40)
    scene.table[..., 0] = 0.0
    return scene._replace(p_false=1e-290)


def gibbs(scene: Scene, intensity: float, n: int, rng: np.random.Generator) -> np.ndarray:
    """Cardinalities of a Poisson process, kept where no two points are close: the Gibbs law."""
    counts = []
    area = gsncp.free(scene.lower, scene.upper)[1]
    for L in rng.poisson(intensity * area, n):
        c = rng.uniform(scene.lower, scene.upper, (L, 3))
        if gsncp.feasible(scene, c, np.tile(scene.e_lower, (L, 1))):
            counts.append(L)
    return np.array(counts)


def test_intensity_is_that_of_the_hard_core_process():
    scene, rng, intensity = plane(0), np.random.default_rng(3), 0.04
    area, count, estimate = 12.0 * 8.0, [], []
    for L in rng.poisson(intensity * area, 6000):
        c = rng.uniform(scene.lower, scene.upper, (L, 3))
        if gsncp.feasible(scene, c, np.tile(scene.e_lower, (L, 1))):
            count.append(L)
            estimate.append(gsncp.room(scene, c))
    count, estimate = np.array(count), np.array(estimate)
    # Georgii, Nguyen, Zessin: the mean number is lambda times the mean volume left for another
    excess = count - intensity * estimate
    assert abs(excess.mean()) < 4.5 * excess.std() / np.sqrt(len(excess))
    one = np.array([[6.0, 4.0, 0.0]])
    exact = 1 / (area - np.pi * 3.0**2)
    single, true = plane(1), np.zeros(1, bool)
    found = gsncp.intensities(single, 1, 1.0, true, gsncp.room(scene, one))
    assert found[0] == pytest.approx(exact, rel=0.01)
    assert gsncp.intensities(single, 0, 0.0, true, area) == pytest.approx([0.1 / area] * 2)


def deviation(x: np.ndarray, reference: np.ndarray) -> float:
    """Difference of the means of a chain and of independent values, in standard errors."""
    error = x.var() / effective_sample_size(x) + reference.var() / len(reference)
    return float((x.mean() - reference.mean()) / np.sqrt(error))


def cardinalities(
    scene: Scene, moves: tuple[float, ...], intensity: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of targets (n,) every fifty moves of a chain, and their mean extents (n, 3)."""
    points = scene.z.T[::3].copy()
    births = Births(points, np.full(len(points), 1 / len(points)), 1.5, float(np.log(3.0)))
    state, counts, extents = gsncp.empty(scene, 20), [], []
    for _ in range(4000):
        info = run(scene, state, intensity, births, np.array(moves), np.array([0.5, 0.3]), 50, rng)
        L = state.size[0]
        assert gsncp.feasible(scene, state.c[:L], state.e[:L])
        counts.append(float(info.count[-1]))
        extents.append(state.e[:L, :3].mean(0) if L else np.array([1.25, 0.0, 1.25]))
    return np.array(counts), np.array(extents)


DEFAULT, PAPER = (0.2, 0.2, 0.2, 0.2, 0.2, 0.0), (0.2, 0.2, 0.0, 0.0, 0.0, 0.6)


@pytest.mark.parametrize("moves", [DEFAULT, PAPER], ids=["default", "paper"])
def test_without_likelihood_the_chain_samples_the_hard_core_process(moves):
    scene, rng = likelihood_off()._replace(informed=moves == DEFAULT), np.random.default_rng(8)
    intensity = np.array([0.04, 1e-2])
    reference = gibbs(scene, intensity[0], 40_000, rng)
    count, extents = cardinalities(scene, moves, intensity, rng)
    assert len(np.unique(count)) > 4
    for k in range(1, 6):
        assert abs(deviation((count == k) * 1.0, (reference == k) * 1.0)) < 4.5
    assert abs(deviation(count, reference)) < 4.5
    for column, middle in zip(extents.T, (1.25, 0.0, 1.25), strict=True):
        error = column.std() / np.sqrt(effective_sample_size(column))
        assert abs(column.mean() - middle) < 4.5 * error


def test_births_a_fifth_too_often_are_caught():
    scene, rng = likelihood_off(), np.random.default_rng(9)
    intensity = np.array([0.04, 1e-2])
    reference = gibbs(scene, intensity[0], 40_000, rng)
    count, _ = cardinalities(scene, (0.2, 0.2, 0.22, 0.18, 0.2, 0.0), intensity, rng)
    assert deviation(count, reference) > 4.5


def test_effective_sample_size_of_an_autoregression():
    rng, n, a = np.random.default_rng(1), 200_000, 0.8
    x = np.zeros(n)
    for i, w in enumerate(rng.normal(size=n - 1), 1):
        x[i] = a * x[i - 1] + w
    assert effective_sample_size(x) == pytest.approx(n * (1 - a) / (1 + a), rel=0.1)
    assert effective_sample_size(np.ones(10)) == 10
