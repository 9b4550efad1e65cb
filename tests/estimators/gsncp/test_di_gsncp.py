"""The estimator on scenes small enough to know the answer, in space and in the plane; bad input."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.gsncp import dbscan, di_gsncp, oracle
from echoset.estimators.gsncp.chain import explore, labelled, put
from echoset.estimators.gsncp.kernels import posterior as gsncp
from echoset.estimators.gsncp.kernels.compiled import posterior as compiled
from echoset.estimators.gsncp.output import Labels
from echoset.estimators.gsncp.scene import epochs, grid
from echoset.formats.windows import concatenate
from echoset.metrics.distances import ospa_gw
from echoset.models.checks import check, check_objects, check_steps
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry import extent
from echoset.models.parameters import resolve, sensor_model
from echoset.models.radar import ofdm
from echoset.models.records import Estimates, Meta, Objects, Recording, Sensor, Stream, Truth
from echoset.simulate import radar_extended

SHORT = {
    "burn_in": 3000, "max_burn_in": 4000, "patience": 1000, "explore": 2000, "max_explore": 4000,
    "samples": 50, "thin": 20, "max_targets": 12,
}  # fmt: skip


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Two epochs of a few targets."""
    params = radar_extended.Params(epochs=2, mean_targets=4.0)
    return radar_extended.simulate(params, np.random.default_rng(12), "small")


def run(module, recording, settings, scans=None, seed=0):
    params = resolve(module.Params, *sensor_model(recording, module.Params), ("", settings))
    setup = recording if module is oracle else recording.setup()
    scans = recording.scans() if scans is None else scans
    steps = list(module.estimate(setup, scans, params, np.random.default_rng(seed)))
    for step in steps:
        check_objects(step.objects, "objects")
        check_steps(step.steps, len(step.objects.time_ns))
    whole = concatenate(steps)
    return Estimates(Meta("x", provenance={"estimator": "x"}), whole.objects, whole.steps)


def distances(estimates, recording):
    found = ospa_gw.METRIC.score(estimates, recording, ospa_gw.METRIC.Params())
    return found.value[(np.array(found.part) == "") & ~np.isnan(found.time)]


@pytest.mark.parametrize(
    ("module", "settings", "bound"),
    [
        (di_gsncp, SHORT, 1.0),
        (di_gsncp, SHORT | {**di_gsncp.PRESETS["paper"], "patience": 3000}, 1.5),
        (dbscan, {}, 1.5),
        (oracle, {}, 1.0),
    ],
    ids=["default", "paper", "dbscan", "oracle"],
)
def test_targets_are_found_where_they_are(recording, module, settings, bound):
    assert distances(run(module, recording, settings), recording)[-1] < bound


def test_diagnostics_samples_and_labels(recording):
    estimates = run(di_gsncp, recording, SHORT | {"keep": True})
    kept, offset = estimates.steps["samples"], estimates.objects.row_offset
    assert kept.shape == (2, 50, 12, 9)
    for t in (0, 1):
        rows = slice(*offset[t : t + 2])
        L = offset[t + 1] - offset[t]
        mean = kept[t, :, :L].mean(0)
        np.testing.assert_allclose(estimates.objects.state[rows], mean, atol=1e-12)
        covariance = np.cov(kept[t, :, 0].T)
        np.testing.assert_allclose(estimates.objects.covariance[rows][0], covariance, atol=1e-12)
    assert estimates.steps["acceptance"].shape == (2, 6)
    assert (estimates.steps["iterations"] >= SHORT["burn_in"] + SHORT["explore"] + 1000).all()
    assert (estimates.steps["effective_sample_size"] > 1).all()
    first, second = (set(estimates.objects.label[slice(*offset[t : t + 2])]) for t in (0, 1))
    assert first & second


def test_equal_seeds_give_equal_estimates(recording):
    a, b = (run(di_gsncp, recording, SHORT, seed=5) for _ in range(2))
    np.testing.assert_array_equal(a.objects.state, b.objects.state)


def planar(kind: str, turned: float = 0.5) -> Recording:
    """Two sensors in the plane and three targets, seen by positions or by ranges and bearings."""
    rng = np.random.default_rng(3)
    c, e = (
        np.array([[5.0, 5], [15, 12], [28, 6]]),
        np.array([[1.2, 0.2, 1.1], [1, 0, 1], [1.4, -0.3, 1]]),
    )
    half = turned / 2
    sensors, streams = {}, {}
    for name, place in (("A", (0.0, -5.0)), ("B", (30.0, 25.0))):
        quaternion = np.array([[0.0, 0.0, np.sin(half), np.cos(half)]])
        at = np.array([[*place, 1.0]])
        sensors[name] = Sensor("radar", np.zeros(1, np.int64), at, quaternion)
        origin = np.repeat(np.arange(3), 25)
        v = c[origin] + (extent.triangular(e)[origin] @ rng.normal(size=(75, 2, 1)))[..., 0]
        z = np.vstack([v + 0.1 * rng.normal(size=v.shape), rng.uniform([0, 0], [35, 20], (10, 2))])
        R = np.array([[np.cos(turned), -np.sin(turned)], [np.sin(turned), np.cos(turned)]])
        x = (z - place) @ R
        if kind == "position":
            rows = {"x": x[:, 0].copy(), "y": x[:, 1].copy()}
            model = {"std_position": 0.1}
        else:
            rows = {"range": np.hypot(*x.T), "azimuth": np.arctan2(x[:, 1], x[:, 0])}
            model = {"std_range": 0.1, "std_azimuth": 0.005}
        rows["origin_id"] = np.append(origin, np.full(10, -1)).astype(np.int32)
        for i, axis in enumerate("xy"):
            rows[f"origin_{axis}"] = np.append(v[:, i], np.full(10, np.nan))
        model |= {"p_detect": 0.9, "clutter_region": [0.0, 35.0, 0.0, 20.0]}
        offset = np.array([0, 85], np.int64)
        streams[name] = Stream(kind, (name,), model, np.zeros(1, np.int64), offset, {}, rows)
    kind_, axes, rotation = extent.ellipsoid(extent.covariance(e))
    objects = Objects(
        np.zeros(1, np.int64), np.array([0, 3], np.int64), np.arange(3),
        ("x", "y", *extent.names(2)), ("m",) * 5, np.hstack([c, e]), extent_kind=kind_,
        semi_axes=axes, rotation=rotation,
    )  # fmt: skip
    recording = Recording(Meta("plane"), sensors, streams, Truth(objects))
    check(recording)
    return recording


def sea(c: np.ndarray, side: float, std: float, per_target: float, false: int) -> Recording:
    """One look at round targets c (L, 2) of a standard deviation [m] in a square of clutter."""
    rng = np.random.default_rng(11)
    origin = np.repeat(np.arange(len(c)), rng.poisson(per_target, len(c)))
    z = c[origin] + rng.normal(size=(len(origin), 2)) * np.hypot(std, 1.0)
    z = np.vstack([z, rng.uniform(0, side, (false, 2))])
    model = {"p_detect": 1.0, "std_position": 1.0, "clutter_region": [0.0, side, 0.0, side]}
    rows = {"x": z[:, 0].copy(), "y": z[:, 1].copy()}
    stream = Stream(
        "position", ("A",), model, np.zeros(1, np.int64), np.array([0, len(z)], np.int64), {}, rows
    )
    at = Sensor("radar", np.zeros(1, np.int64), np.zeros((1, 3)), np.array([[0.0, 0, 0, 1]]))
    recording = Recording(Meta("sea"), {"A": at}, {"A": stream})
    check(recording)
    return recording


@pytest.mark.parametrize(
    ("module", "each", "own"),
    [(di_gsncp, 8.0, {"spread": 100.0}), (dbscan, 12.0, {"radii": (150.0, 250.0)})],
    ids=["chain", "dbscan"],
)
def test_few_targets_on_a_wide_sea_are_found(module, each, own):
    x, y = np.meshgrid(np.linspace(1000, 9000, 5), np.linspace(2000, 8000, 3))
    c = np.stack([x.ravel(), y.ravel()], 1)
    settings = {"cell": 200.0, "hard_core_radius": 500.0, "std_position": 100.0}
    settings |= {"resolution": each / 1.25**2} | own
    found = run(module, sea(c, 1e4, 100.0, each, 30), settings).objects.state[:, :2]
    gap = np.linalg.norm(c[:, None] - found, axis=-1).min(1)
    assert len(found) == 15
    assert gap.max() < 4.5 * 100.0 * np.sqrt(2 / 4)


def test_clusters_at_the_border_stay_where_they_are_and_those_beyond_are_dropped():
    recording = sea(np.array([[-0.3, 20.0], [-9.0, 30.0], [25.0, 25.0]]), 50.0, 0.1, 40.0, 0)
    z = np.stack([recording.streams["A"].rows[a] for a in "xy"], 1)
    border = z[np.abs(z[:, 1] - 20) < 4.9]
    means = np.array([border[border[:, 0] < 10].mean(0), z[z[:, 0] > 10].mean(0)])
    assert means[0, 0] < 0
    settings = {"resolution": 40 / 1.5, "radii": (3.0,), "neighbours": (1,)}
    found = run(dbscan, recording, settings).objects.state[:, :2]
    np.testing.assert_allclose(found[np.argsort(found[:, 0])], means, atol=1e-9)


@pytest.mark.parametrize("kind", ["position", "range_bearing"])
@pytest.mark.parametrize("module", [di_gsncp, dbscan, oracle], ids=["chain", "dbscan", "oracle"])
def test_the_plane(kind, module):
    recording = planar(kind)
    settings = {"resolution": 20.0} | (SHORT if module is di_gsncp else {})
    estimates = run(module, recording, settings)
    assert estimates.objects.state_names == ("x", "y", "e00", "e10", "e11")
    assert distances(estimates, recording)[0] < 0.6


def test_rows_that_state_their_noise_need_no_parameter():
    recording = planar("position")
    streams = {}
    for name, s in recording.streams.items():
        full = np.full(len(s.rows["x"]), 0.01)
        rows = dict(s.rows) | {"cov_xx": full, "cov_xy": 0 * full, "cov_yy": full}
        streams[name] = replace(
            s, rows=rows, model={k: v for k, v in s.model.items() if k != "std_position"}
        )
    stated = replace(recording, streams=streams)
    settings = SHORT | {"resolution": 20.0}
    a, b = (run(di_gsncp, r, settings) for r in (recording, stated))
    np.testing.assert_allclose(a.objects.state, b.objects.state, atol=1e-6)


def emptied(recording: Recording, keep: int) -> Recording:
    """Only the first ``keep`` detections of the first stream, none of the others."""
    streams = {}
    for i, (name, s) in enumerate(recording.streams.items()):
        n = keep if i == 0 else 0
        offset = np.minimum(s.row_offset, n)
        streams[name] = replace(s, row_offset=offset, rows={k: v[:n] for k, v in s.rows.items()})
    return replace(recording, streams=streams)


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("keep", [0, 1])
def test_hardly_anything_to_see(recording, keep, preset):
    settings = di_gsncp.PRESETS[preset] if preset == "paper" else SHORT
    estimates = run(di_gsncp, emptied(recording, keep), {**settings, "patience": 300, "block": 100})
    assert np.isfinite(estimates.objects.state).all()
    assert (estimates.steps["cardinality_mean"] < 3).all()
    run(dbscan, emptied(recording, keep), {})
    assert len(run(oracle, emptied(recording, 0), {}).objects.state) == 0


def changed(recording: Recording, name: str, **model) -> Recording:
    stream = recording.streams[name]
    other = replace(stream, model={**stream.model, **model})
    return replace(recording, streams={**recording.streams, name: other})


def test_what_cannot_be_is_refused(recording):
    bad = np.array(recording.streams["R0"].model["cov_xx_table"])
    bad[1, 3, 4, 2] = -1.0
    with pytest.raises(InputError, match=r"covariance of scan 1 is not positive definite: .* -"):
        run(di_gsncp, changed(recording, "R0", cov_xx_table=bad), SHORT)
    with pytest.raises(InputError, match="no cov_yy_table for scan 0"):
        run(di_gsncp, changed(recording, "R1", cov_yy_table=np.zeros((2, 3, 3, 3))), SHORT)
    with pytest.raises(ParameterError, match="of a volume"):
        run(di_gsncp, recording, {"clutter_region": (0, 50, 20, 20, 0, 10)})
    with pytest.raises(InputError, match=r"need .* GB"):
        run(di_gsncp, recording, {"memory": 1e-5})
    with pytest.raises(InputError, match="give clutter_region"):
        run(di_gsncp, recording, {"clutter_region": ()})
    bare = planar("position")
    with pytest.raises(InputError, match="give p_detect"):
        run(di_gsncp, bare, {"p_detect": None})
    with pytest.raises(InputError, match="give std_position"):
        run(di_gsncp, bare, {"std_position": 0.0})
    with pytest.raises(InputError, match="three dimensions need the column 'z'"):
        run(di_gsncp, bare, {"clutter_region": (0, 35, 0, 20, 0, 5)})
    with pytest.raises(InputError, match="needs the truth"):
        run(oracle, replace(recording, truth=None), {})
    with pytest.raises(ParameterError, match="births as often as deaths"):
        run(di_gsncp, recording, {"moves": (0.5, 0.2, 0.2, 0.1, 0.0, 0.0)})


def test_every_radar_has_its_own_resolution(recording):
    unlike = changed(recording, "R1", side=16, azimuth_factor=2.0, max_resolution=30.0)
    streams = dict(unlike.streams)
    model = {k: v for k, v in streams["R0"].model.items() if k != "bandwidth"}
    streams["R0"] = replace(streams["R0"], model=model)
    setting = ("", {"resolution": 7.0})
    params = resolve(di_gsncp.Params, *sensor_model(recording, di_gsncp.Params), setting)
    for radars in (unlike, replace(unlike, streams=streams)):
        (_, scene), *_ = di_gsncp.scenes(radars.setup(), radars.scans(), params)
        c, e = np.array([[20.0, 8, 4]]), np.array([[1.2, 0.1, 1.3, 0, 0.2, 1.1]])
        told = [ofdm.Radar(), ofdm.Radar(side=16, azimuth_factor=2.0, max_resolution=30.0)]
        r = [
            float(ofdm.resolution(ofdm.State(radar, x, np.eye(3), np.zeros((0, 1))), c)[0])
            for radar, x in zip(told, scene.position, strict=True)
        ]
        if radars is not unlike:
            r[0] = 7.0
        rho, _, _ = gsncp.columns(scene, c, e)
        p, _, _ = gsncp.sensor(scene, c)
        assert r[0] != r[1]
        np.testing.assert_allclose(rho[0], p[0] * np.maximum(1, 1.2 * 1.3 * 1.1 * np.array(r)))
        state = gsncp.empty(scene, 1)
        put(state, c, e)
        compiled.refresh(scene, state)
        assert state.rho[0] == pytest.approx(rho.sum(), rel=1e-12)


def test_targets_all_closer_than_the_hard_core_leave_one_estimate(recording):
    estimates = run(di_gsncp, recording, SHORT | {"hard_core_radius": 80.0})
    np.testing.assert_array_equal(np.diff(estimates.objects.row_offset), [1, 1])


def test_epochs_limits_what_is_processed_together(recording):
    last = next(iter(recording.streams.values())).time_ns[-1]
    only = [s for s in recording.scans() if s.time_ns == last]
    assert len(only) == 2
    a = run(oracle, recording, {"epochs": 1}).objects
    b = run(oracle, recording, {"epochs": 0}).objects
    assert not np.allclose(a.state[-1], b.state[-1])
    np.testing.assert_allclose(a.state[: a.row_offset[1]], b.state[: b.row_offset[1]])


def test_labels_stay_with_their_place():
    labels = Labels()
    assert labels.of(np.array([[0.0, 0, 0], [9, 0, 0]]), 3.0).tolist() == [0, 1]
    assert labels.of(np.array([[9.5, 0, 0], [20, 0, 0], [1, 0, 0]]), 3.0).tolist() == [1, 2, 0]
    assert labels.of(np.zeros((0, 3)), 3.0).tolist() == []
    assert labels.of(np.array([[9.0, 0, 0]]), 3.0).tolist() == [3]


def test_clusters_are_scikit_learns():
    cluster = pytest.importorskip("sklearn.cluster")
    rng = np.random.default_rng(0)
    z = np.vstack([rng.normal(c, 0.6, (60, 3)) for c in ([0, 0, 0], [3, 0, 0], [1, 4, 0])])
    z = np.vstack([z, rng.uniform(-4, 8, (80, 3))])[rng.permutation(260)]
    params = dbscan.Params(radii=(0.5, 1.0, 1.6), neighbours=(1, 3, 6))
    found = dbscan.configurations(z, params, 2)
    for radius in params.radii:
        for least in params.neighbours:
            expected = cluster.DBSCAN(eps=radius, min_samples=2 * least).fit(z).labels_
            np.testing.assert_array_equal(next(found), expected)


def test_the_oracle_is_exact_without_noise_and_spread():
    recording = planar("position")
    streams = {}
    for name, s in recording.streams.items():
        n, place = 75, recording.sensors[name].position[0, :2]
        R = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
        c = recording.truth.objects.state[s.rows["origin_id"][:n], :2]
        x = (c - place) @ R
        rows = {k: v[:n] for k, v in s.rows.items()}
        rows |= {"x": x[:, 0].copy(), "y": x[:, 1].copy()}
        streams[name] = replace(s, rows=rows, row_offset=np.array([0, n], np.int64))
    found = run(oracle, replace(recording, streams=streams), {}).objects
    np.testing.assert_allclose(found.state[:, :2], recording.truth.objects.state[:, :2], atol=1e-9)
    np.testing.assert_allclose(found.state[:, [2, 4]], 1.0)


def test_the_oracle_is_told_the_covariance_at_every_point_of_reflection():
    """Its centres are least squares with the covariances that the radar's own formulas give."""
    params, rng = radar_extended.Params(epochs=1), np.random.default_rng(4)
    recording = radar_extended.simulate(params, rng, "told")
    found, truth = run(oracle, recording, {}).objects, recording.truth.objects
    rng = np.random.default_rng(4)
    radar_extended.targets(params, rng)
    z, origin, S = [], [], []
    for i, (name, s) in enumerate(recording.streams.items()):
        state = radar_extended.sensor_state(params, i, 0, rng)
        # The simulator draws the detections of a sensor before it goes on to the next.
        radar_extended._scan(params, state, truth.state[:, :3], truth.state[:, 3:], rng)
        mine = s.rows["origin_id"] >= 0
        rows = {k: v[mine] for k, v in s.rows.items()}
        points = np.stack([rows[f"origin_{a}"] for a in "xyz"], 1)
        z.append(recording.sensors[name].position[0] + np.stack([rows[a] for a in "xyz"], 1))
        S.append(ofdm.covariance(state, points))
        origin.append(rows["origin_id"])
    z, origin, S = map(np.concatenate, (z, origin, S))
    for label, centre in zip(found.label, found.state[:, :3], strict=True):
        mine = origin == label
        E = extent.covariance(truth.state[truth.label == label][0, 3:])
        W = np.linalg.inv(S[mine] + E)
        expected = np.linalg.solve(W.sum(0), np.einsum("mij,mj->i", W, z[mine]))
        np.testing.assert_allclose(centre, expected, atol=1e-6)


@pytest.mark.parametrize("module", [di_gsncp, dbscan])
def test_every_stream_has_its_own_noise_and_view(module):
    """Stated by the streams, in either order of their names: neither has the other's."""
    recording = planar("position")
    own = {"A": {"std_position": 0.1, "p_detect": 0.9}, "B": {"std_position": 3.0, "p_detect": 0.6}}
    streams = {k: replace(s, model={**s.model, **own[k]}) for k, s in recording.streams.items()}
    setup = replace(recording, streams=streams).setup()
    for names in (("A", "B"), ("B", "A")):
        renamed = dict(zip(names, (streams["A"], streams["B"]), strict=True))
        of = replace(setup, streams={k: renamed[k] for k in sorted(renamed)})
        params = module.resolved(module.Params, of, sensor_model(of, module.Params), ())
        nodes = grid(params, of)
        scans = (replace(s, scan={}) for s in replace(recording, streams=of.streams).scans())
        ((_, states),) = epochs(params, of, list(scans), nodes)
        for name, state in zip(sorted(renamed), states, strict=True):
            model = renamed[name].model
            np.testing.assert_allclose(state.table[..., 0], model["p_detect"])
            np.testing.assert_allclose(state.table[..., 1], model["std_position"] ** 2)


def test_the_first_epoch_starts_from_clusters_too():
    recording, hardly = planar("position"), {"burn_in": 500, "max_burn_in": 500, "block": 500}
    settings = SHORT | {"resolution": 20.0, "explore": 0, "max_explore": 0} | hardly
    settings |= {"moves": (0.5, 0.5, 0.0, 0.0, 0.0, 0.0)}
    found = run(di_gsncp, recording, settings)
    assert distances(found, recording)[0] < 0.6
    assert len(run(di_gsncp, recording, settings | {"restart": False}).objects.state) == 0


def test_an_undecided_number_leaves_a_state_of_the_number_shown():
    recording = planar("position")
    layers = {"resolution": 20.0, "block": 20, "explore": 40, "max_explore": 40, "max_targets": 20}
    params = resolve(di_gsncp.Params, *sensor_model(recording, di_gsncp.Params), ("", layers))
    (_, scene), *_ = di_gsncp.scenes(recording.setup(), recording.scans(), params)
    scene.table[..., 0] = 0.0
    scene, scale, undecided = scene._replace(p_false=1e-290), np.ones(2), 0
    for seed in range(200):
        state, rng = gsncp.empty(scene, 20), np.random.default_rng(seed)
        whole = explore(scene, params, state, np.array([5e-3, 1e-2]), scale, rng)
        ends = np.unique(whole.count[19::20])
        undecided += len(ends) > 1
        assert state.size[0] == max(ends, key=lambda L: (whole.count == L).sum())
    assert undecided > 10


def test_a_target_for_every_few_detections_is_not_cut():
    x, y = np.meshgrid(np.arange(10, 120, 11.0), np.arange(10, 100, 11.0))
    c = np.stack([x.ravel(), y.ravel()], 1)[:87]
    recording = sea(c, 120.0, 0.3, 30.0, 20)
    settings = SHORT | {"max_targets": 0, "resolution": 30 / 1.25**2, "std_position": 0.3}
    found = run(di_gsncp, recording, settings)
    assert np.diff(found.objects.row_offset).tolist() == [87]
    assert len(run(dbscan, recording, {"resolution": 30 / 1.25**2}).objects.state) == 87


def test_a_number_that_is_cut_is_told(caplog):
    recording = planar("position")
    found = run(di_gsncp, recording, SHORT | {"resolution": 20.0, "max_targets": 2})
    assert [r.getMessage() for r in caplog.records] == [
        "all 2 places were taken: there may be more, see max_targets"
    ]
    assert found.steps["cardinality_variance"][0] >= 1


@pytest.mark.parametrize("places", [2, 5, 8])
def test_what_is_cut_is_stated_by_its_number(places, caplog):
    """Eight targets far apart, which are plain to see: those without a place are counted."""
    x, y = np.meshgrid([15.0, 45, 75, 105], [30.0, 90.0])
    recording = sea(np.stack([x.ravel(), y.ravel()], 1), 120.0, 0.3, 30.0, 20)
    settings = {"resolution": 30 / 1.25**2, "std_position": 0.3, "max_targets": places}
    found = run(di_gsncp, recording, SHORT | settings).steps
    lost = 8 - places
    assert found["cut"][0] == lost
    assert found["cardinality_mean"][0] == pytest.approx(8.0, abs=0.2)
    if lost:
        assert found["cardinality_variance"][0] == pytest.approx(lost, abs=0.3)


def test_the_papers_preset_states_regular_covariances():
    params = radar_extended.Params(epochs=1)
    recording = radar_extended.simulate(params, np.random.default_rng(5), "many")
    found = run(di_gsncp, recording, di_gsncp.PRESETS["paper"]).objects
    assert len(found.state) > 4
    for P in found.covariance:
        scale = np.sqrt(np.diag(P))
        assert np.linalg.matrix_rank(P / scale / scale[:, None], tol=1e-6) == 9


def test_the_papers_intensity_is_per_volume_of_all_of_the_region():
    """lambda = L (M - M_c) / (|D| sum rho) as printed; by default |D| less what targets take."""
    recording, found = planar("position"), {}
    centres = recording.truth.objects.state[:, :2]
    for preset in ("default", "paper"):
        layers = di_gsncp.PRESETS[preset] | {"resolution": 20.0, "hard_core_radius": 3.0}
        params = resolve(di_gsncp.Params, *sensor_model(recording, di_gsncp.Params), ("", layers))
        (_, scene), *_ = di_gsncp.scenes(recording.setup(), recording.scans(), params)
        state = gsncp.empty(scene, 20)
        put(state, np.pad(centres, ((0, 0), (0, 1))), np.tile([1.0, 0, 1, 0, 0, 1], (3, 1)))
        compiled.refresh(scene, state)
        rng, one = np.random.default_rng(0), np.array([5e-3, 1e-2])
        clutter = (rng.random(170) * (one[1] + state.shot) < one[1]).sum()
        found[preset] = labelled(scene, params, state, one, np.random.default_rng(0))[0]
        printed = 3 * (170 - clutter) / (35 * 20 * state.rho[:3].sum())
    assert found["paper"] == pytest.approx(printed)
    # Three discs of 3 m, inside 35 m by 20 m.
    assert found["default"] / found["paper"] == pytest.approx(700 / (700 - 3 * 9 * np.pi), rel=0.01)


def test_effective_sample_size_is_that_of_what_is_averaged():
    rng, n, a = np.random.default_rng(1), 40_000, 0.9
    x = rng.normal(size=(n, 2, 9))
    x[..., 5] = 0.0
    for i in range(1, n):
        x[i, 1, 3] = a * x[i - 1, 1, 3] + x[i, 1, 3]
    assert di_gsncp.effective(x) == pytest.approx(n * (1 - a) / (1 + a), rel=0.15)
    x[:, 0, 2] = 1.0
    assert di_gsncp.effective(x) == 1.0
    assert di_gsncp.effective(np.zeros((50, 0, 9))) == 50


def test_tables_are_counted_before_they_are_made():
    recording = sea(np.array([[5.0, 5.0]]), 500.0, 1.0, 10.0, 20)
    params = resolve(di_gsncp.Params, *sensor_model(recording, di_gsncp.Params))
    nodes = 202**2
    tracemalloc.start()
    list(di_gsncp.scenes(recording.setup(), recording.scans(), params))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak > nodes * 7 * 8
    with pytest.raises(InputError, match=r"1 tables of 202 by 202 by 1 nodes need .* or cell"):
        run(di_gsncp, recording, {"memory": peak / 1e9})
