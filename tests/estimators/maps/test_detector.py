"""The way from maps to classified targets, in the filters and part by part."""

from dataclasses import replace
from functools import partial

import map_scene
import numpy as np
import pytest
from map_scene import PEDESTRIAN, VEHICLE

from echoset.estimators import mbm, phd
from echoset.estimators.maps import detector as front
from echoset.estimators.maps import evidence
from echoset.estimators.maps.kernels.fusion import Pixels
from echoset.estimators.maps.pairs import split
from echoset.estimators.maps.stations import REFERENCE, Station
from echoset.estimators.points import mbm as points_mbm
from echoset.estimators.points import phd as points_phd
from echoset.estimators.points.source import recognised
from echoset.formats import weights
from echoset.models.checks import check, check_objects, check_steps
from echoset.models.errors import FormatError, InputError, ParameterError
from echoset.models.parameters import resolve, sensor_model
from echoset.models.records import Meta, Recording, Sensor, Stream

FILTERS = pytest.mark.parametrize("module", [phd, mbm])
START = np.array([[-10.0, -8.0], [9.0, 6.0]])
VELOCITY = np.array([[1.5, 1.0], [-2.0, 1.5]])
SCANS = 40
PIXELS = Pixels.of((-20.0, 20.0, -20.0, 20.0), 0.1)
BIRTHS = np.array([[0.05, *p, 0.0, 0.0, *(0.1**0.5,) * 4] for p in START])


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    path = tmp_path_factory.mktemp("network") / "byhand.npz"
    weights.write(path, map_scene.classifier())
    return str(path)


@pytest.fixture(scope="module")
def scene():
    """A pedestrian and a vehicle before three stations, with births where they start."""
    time = np.arange(SCANS)[:, None, None] * map_scene.SCAN / 1e9
    rng = np.random.default_rng(0)
    found = map_scene.recording(START + time * VELOCITY, [PEDESTRIAN, VEHICLE], 3, rng, BIRTHS)
    check(found)
    return found


def params(module, recording, network, preset="paper", **changes):
    layers = ("changes", {"weights": network, "p_survive": 0.99, **changes})
    told = sensor_model(recording.setup(), module.Params)
    return resolve(module.Params, *told, ("preset", module.PRESETS[preset]), layers)


def run(module, recording, network, **changes):
    settings = params(module, recording, network, **changes)
    steps = list(module.estimate(recording.setup(), recording.scans(), settings, None))
    for step in steps:
        check_objects(step.objects, "objects")
        check_steps(step.steps, 1)
    return steps


def chain(recording, network, **changes):
    return front.Chain.of(recording.setup(), params(phd, recording, network, **changes))


def first(recording):
    return [scan for scan in recording.scans() if scan.time_ns == 0]


def only(recording, scans):
    """The recording with the scans ``scans(name)`` of each stream."""
    streams = {}
    for name, s in recording.streams.items():
        kept = np.arange(len(s))[scans(name)]
        streams[name] = replace(
            s,
            time_ns=s.time_ns[kept],
            row_offset=np.zeros(len(kept) + 1, np.int64),
            scan={"map": s.scan["map"][kept]},
        )
    return replace(recording, streams=streams)


@FILTERS
def test_the_filters_find_what_was_drawn(module, scene, network):
    steps = run(module, scene, network)
    assert len(steps) == SCANS
    truth = START + np.arange(SCANS)[:, None, None] * 0.05 * VELOCITY
    labels = set()
    for k, step in enumerate(steps):
        o = step.objects
        assert o.class_names == ("pedestrian", "vehicle")
        order = np.argsort(o.state[:, 0])
        labels.add(tuple(o.label[order].tolist()))
        np.testing.assert_array_equal(o.class_index[order], [0, 1])
        assert (o.class_probability[order, [0, 1]] > 0.7).all()
        error = np.hypot(*(o.state[order, :2] - truth[k]).T)
        assert (error < (0.4, 0.8)).all()
    assert len(labels) == 1
    assert (np.abs(o.state[order, 2:] - VELOCITY) < 1.0).all()


@FILTERS
def test_presets_take_the_births_from_the_recording(module, scene, network):
    found = params(module, scene, network)
    np.testing.assert_allclose(
        found.birth_components, scene.streams["s0"].model["birth_components"]
    )
    context = module.context(scene.setup(), found)
    assert all(p.birth_components == found.birth_components for p in context.sensing.values())


@FILTERS
def test_a_target_that_is_nowhere_expected_comes_by_a_wide_birth(module, network):
    track = np.tile(np.array([[[0.8, -0.6]]]), (8, 1, 1))
    births = np.array([[0.01, 0.0, 0.0, 0.0, 0.0, *(5**0.5,) * 4]])
    scene = map_scene.recording(track, [PEDESTRIAN], 3, np.random.default_rng(1), births)
    last = run(module, scene, network)[-1].objects
    assert len(last.label) == 1
    assert np.hypot(*(last.state[0, :2] - track[0, 0])) < 0.4


@FILTERS
def test_a_target_off_the_site_plan_comes_by_its_detections(module, network):
    """What starts, and stays, where no birth is: found by the preset tuned, not by paper."""
    track = np.array([6.0, 7.0]) + np.arange(12)[:, None, None] * 0.05 * np.array([1.0, -0.5])
    scene = map_scene.recording(track, [PEDESTRIAN], 3, np.random.default_rng(3), BIRTHS[:1])
    for preset, count in (("paper", 0), ("tuned", 1)):
        last = run(module, scene, network, preset=preset)[-1].objects
        assert len(last.label) == count
    assert np.hypot(*(last.state[0, :2] - track[-1, 0])) < 0.4


@FILTERS
def test_the_step_is_a_pure_function(module, scene, network):
    context = module.context(scene.setup(), params(module, scene, network))
    points = {phd: points_phd, mbm: points_mbm}[module]
    state = points.init()
    for _ in range(2):
        results = [points.step(state, first(scene), context)[0] for _ in range(2)]
    a, b = (getattr(r.mixture, "local", r.mixture) for r in results)
    np.testing.assert_array_equal(a.m, b.m)
    assert state.next_label == 0 and not state.memory.classes
    assert results[0].memory.classes.keys() == results[1].memory.classes.keys() != set()


@FILTERS
def test_maps_and_points_of_one_time(module, scene, network):
    """Good points beside the maps make the estimates as good as they are; alone, no classes."""
    truth = START + np.arange(SCANS)[:, None, None] * 0.05 * VELOCITY
    rows = dict(zip("xy", truth.reshape(-1, 2).T.copy(), strict=True))
    model = {"std_position": 0.02, "clutter_region": [-20.0, 20.0, -20.0, 20.0]}
    time, offset = scene.streams["s0"].time_ns, 2 * np.arange(SCANS + 1)
    points = Stream("position", ("eye",), model, time, offset, {}, rows)
    sensors = {**scene.sensors, "eye": Sensor.static("radar", np.zeros(2))}
    both = replace(scene, sensors=sensors, streams={**scene.streams, "eye": points})
    alone = replace(both, streams={"eye": points})
    for recording, weights_, names in (
        (both, network, ("pedestrian", "vehicle")),
        (alone, "/nowhere.npz", ()),
    ):
        last = run(module, recording, weights_, birth_components=BIRTHS)[-1].objects
        order = np.argsort(last.state[:, 0])
        np.testing.assert_allclose(last.state[order, :2], truth[-1], atol=0.02)
        assert last.class_names == names


@FILTERS
def test_dark_maps_show_nothing(module, scene, network):
    streams = {
        name: replace(s, scan={"map": np.zeros_like(s.scan["map"])})
        for name, s in scene.streams.items()
    }
    steps = run(module, replace(scene, streams=streams), network)
    assert [len(step.objects.label) for step in steps] == [0] * SCANS
    assert steps[0].objects.class_probability.shape == (0, 2)


def test_the_sum_is_of_the_first_stations_by_name(scene, network):
    assert chain(scene, network).streams == {"s0", "s1", "s2"}
    two = chain(scene, network, stations=2)
    assert (two.streams, two.choice.unused) == ({"s0", "s1"}, {"s2"})
    whole, scans = chain(scene, network), first(scene)
    maps = [whole.fuse(0, [scan]) for scan in scans]
    sight = two.see(scans, np.zeros(0, int), np.zeros((0, 2)), {})
    np.testing.assert_array_equal(sight.soft, maps[0] + maps[1])
    np.testing.assert_allclose(whole.fuse(0, scans), sum(maps), rtol=1e-6)


def test_unused_stations_change_nothing(scene, network, caplog):
    caplog.set_level("INFO", "echoset")
    less = replace(scene, streams={k: scene.streams[k] for k in ("s0", "s1")})
    for a, b in zip(run(phd, scene, network, stations=2), run(phd, less, network), strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)
    assert "fusing the maps of s0 s1, not of s2" in caplog.text


def test_a_time_without_one_of_the_stations(scene, network):
    gap = only(scene, lambda name: slice(None) if name != "s1" else slice(0, 20))
    steps = run(phd, gap, network, excision=150.0)  # of two stations as much as 100 of three
    assert len(steps) == SCANS and len(steps[-1].objects.label) == 2
    apart = replace(
        scene,
        streams={
            name: replace(s, time_ns=s.time_ns + k)
            for k, (name, s) in enumerate(scene.streams.items())
        },
    )
    assert len(run(phd, apart, network, fuse_within=0.0)) == 3 * SCANS
    together = run(phd, apart, network)
    assert [len(step.objects.label) for step in together[-5:]] == [2] * 5
    assert [int(step.objects.time_ns[0]) for step in together] == (
        1 + map_scene.SCAN * np.arange(SCANS)
    ).tolist()
    whole = run(phd, scene, network)
    for a, b in zip(whole, together, strict=True):
        np.testing.assert_allclose(a.objects.state, b.objects.state, atol=1e-6)


def test_stations_at_half_the_rate_do_no_harm(scene, network):
    """A station every other scan: thresholds go with the stations that see a pixel."""
    half = only(scene, lambda name: slice(None) if name != "s2" else slice(0, None, 2))
    for module in (phd, mbm):
        steps = run(module, half, network, excision=150.0)
        assert [len(step.objects.label) for step in steps[-10:]] == [2] * 10
    made, scans = chain(half, network), first(half)
    np.testing.assert_allclose(made.seen(0, scans[:2]), 2 / 3, rtol=1e-6)
    assert made.seen(0, scans) is None


def test_powers_are_in_units_of_the_reference_echo_that_is_stated(scene, network, caplog):
    """Maps in another unit, or of another power, with their reference echo are the same maps."""
    plain = run(phd, scene, network)
    for factor in (1e-9, 64.0):
        streams = {
            name: replace(
                s,
                scan={"map": s.scan["map"] * np.float32(factor)},
                model={**s.model, "reference_echo": REFERENCE * factor, "noise_power": factor},
            )
            for name, s in scene.streams.items()
        }
        for a, b in zip(plain, run(phd, replace(scene, streams=streams), network), strict=True):
            np.testing.assert_allclose(a.objects.state, b.objects.state, atol=1e-4)
        assert not caplog.records
        bare = {name: replace(s, model=scene.streams[name].model) for name, s in streams.items()}
        run(phd, replace(scene, streams=bare), network)
        found = [r.getMessage() for r in caplog.records if "noise is not" in r.getMessage()]
        assert len(found) == (3 if factor < 1 else 0)
        caplog.clear()
    with pytest.raises(InputError, match="reference_echo must be a positive power, got 0"):
        Station.of(scene.sensors["s0"], {**scene.streams["s0"].model, "reference_echo": 0}, PIXELS)


def test_what_the_soft_map_does_not_show_is_said(scene, network, caplog):
    model = {**scene.streams["s0"].model, "map_region": [-60.0, 60.0, -20.0, 20.0]}
    wide = {**scene.streams, "s0": replace(scene.streams["s0"], model=model)}
    wide = replace(scene, streams=wide)
    chain(wide, network)
    assert not caplog.records
    chain(wide, network, map_region=(100.0, 140.0, 0.0, 20.0))
    text = caplog.text
    assert "s0 s1 s2: the whole sector lies outside map_region" in text
    assert "the area [-60.0, 60.0, -20.0, 20.0] that the recording states lies partly" in text
    assert "2 of 2 births lie outside map_region" in text


def test_stations_in_the_order_of_their_numbers(scene, network):
    names = {"S10": "s0", "S2": "s1", "S1": "s2"}
    streams = {a: replace(scene.streams[b], nodes=(a,)) for a, b in names.items()}
    sensors = {a: scene.sensors[b] for a, b in names.items()}
    found = chain(replace(scene, streams=streams, sensors=sensors), network, stations=2)
    assert (found.streams, found.choice.unused) == ({"S1", "S2"}, {"S10"})


def test_stations_that_are_not_there(scene, network):
    silent = only(scene, lambda name: slice(None) if name != "s1" else slice(0, 0))
    with pytest.raises(InputError, match="stream s1: has no maps"):
        run(phd, silent, network)
    assert len(run(phd, silent, network, stations=1)) == SCANS
    with pytest.raises(InputError, match="stations is 4, but only 3 streams have maps"):
        chain(scene, network, stations=4)
    for count in (0, -1):
        with pytest.raises(ParameterError, match="stations must be at least 1"):
            chain(scene, network, stations=count)


def test_a_map_that_does_not_have_the_shape_of_its_axes(scene, network):
    scan = first(scene)[0]
    bad = replace(scan, scan={"map": scan.scan["map"][:-1]})
    with pytest.raises(InputError, match=r"stream s0 at 0 ns: map of \(217, 51\), axes of \(218"):
        chain(scene, network).fuse(0, [bad])


def test_a_station_that_moves(scene, network):
    """At the second of two poses the map is resampled as that of a station that stands there."""
    a, b = scene.sensors["s0"], scene.sensors["s1"]
    moving = replace(
        a,
        time_ns=np.array([0, 10]),
        position=np.vstack((a.position, b.position)),
        quaternion=np.vstack((a.quaternion, b.quaternion)),
    )
    scan = first(scene)[0]
    goes = chain(replace(scene, sensors={**scene.sensors, "s0": moving}), network)
    for time_ns, sensor in ((0, a), (10, b)):
        stands = chain(replace(scene, sensors={**scene.sensors, "s0": sensor}), network)
        np.testing.assert_array_equal(goes.fuse(time_ns, [scan]), stands.fuse(time_ns, [scan]))
    assert (goes.fuse(0, [scan]) != goes.fuse(10, [scan])).any()


def test_one_scatterer_is_detected_where_it_is(network):
    """Seen by six stations all round, the blobs cross in the scatterer."""
    rng = np.random.default_rng(2)
    for where in rng.uniform(-12, 12, (4, 2)):
        scene = map_scene.recording(where[None, None], [PEDESTRIAN], 6, rng, np.zeros((0, 9)))
        sight = chain(scene, network).see(first(scene), np.zeros(0, int), np.zeros((0, 2)), {})
        assert len(sight.z) == 1
        assert np.abs(sight.z[0] - where).max() < 0.1


def test_the_gate_is_that_of_the_class(scene, network):
    """Pixels 5 m away belong to a vehicle, and are left to DBSCAN by a pedestrian."""
    found = chain(scene, network, excision=1.0)
    soft = np.zeros((400, 400), np.float32)
    soft[200:204, 200:204] = soft[200:208, 250:258] = 9.0
    bright = replace(found, fuse=lambda time_ns, scans: soft)
    z = {}
    for k in (0, 1):
        told = replace(bright, identify=lambda t, L, x, k=k: np.eye(2)[np.full(len(x), k)])
        sight = told.see(first(scene), np.array([7]), np.zeros((1, 2)), {})
        assert evidence.likeliest(sight.classes[7][None]) == [k]
        z[k] = sight.z
    np.testing.assert_allclose(z[0], [[0.2, 0.2], [5.4, 0.4]], atol=1e-9)
    np.testing.assert_allclose(z[1], [(np.array([0.2, 0.2]) + 4 * np.array([5.4, 0.4])) / 5])


def test_a_known_target_needs_pixels(scene, network):
    soft = np.zeros((400, 400), np.float32)
    soft[200, 200:209] = 500.0
    where, gate = np.array([[0.5, 0.0]]), np.array([4.0])
    for least, count in ((9, 1), (10, 0)):
        z, R = chain(scene, network, min_pixels=least).cluster(0, soft, where, gate, 0 * gate)
        assert z.shape == (count, 2) and R.shape == (count, 2, 2)
    np.testing.assert_allclose(
        chain(scene, network, min_pixels=1).cluster(0, soft, where, gate, 0 * gate)[1][0],
        np.diag([0.1**2 * (81 - 1) / 12 * 9 / 8, 0.0]) + 0.01 / 12 * np.eye(2),
    )


def test_new_targets_need_brighter_pixels_and_room(scene, network):
    """Of three groups beyond the gate the dim one and the one beside the known target are left."""
    soft = np.zeros((400, 400), np.float32)
    soft[200:210, 230:240] = soft[300:310, 300:310] = 5000.0
    soft[100:110, 100:110] = 500.0
    where, gate, room = np.zeros((1, 2)), np.array([2.0]), np.array([3.0])

    def places(**changes):
        z, _ = chain(scene, network, **changes).cluster(0, soft, where, gate, room * bool(changes))
        return z.tolist()

    beside, far, dim = [3.5, 0.5], [10.5, 10.5], [-9.5, -9.5]
    np.testing.assert_allclose(places(), [dim, beside, far])
    changes = {"excision_new": 200.0, "room_pedestrian": 0.6, "room_vehicle": 3.0}
    np.testing.assert_allclose(places(**changes), [far])


@pytest.mark.parametrize(("pair", "count"), [((1.5, 3.5), 2), ((0.0, 0.0), 1)])
def test_two_who_are_followed_as_one(scene, network, pair, count):
    """What is taken for a pair makes two detections, at once."""
    made = chain(scene, network, preset="tuned", pair=pair)
    pixels = Pixels.of(made.params.map_region, made.params.map_cell)
    x, y = pixels.centres().T.reshape(2, pixels.ny, pixels.nx)
    spots = sum(np.exp(-0.5 * ((x - a) ** 2 + y**2) / 0.3**2) for a in (-1.1, 1.1))
    soft = np.asarray(1e4 * spots, np.float32)
    sure = np.array([[0.99, 0.01]])

    def told(time_ns, soft, where):
        return np.repeat(sure, len(where), axis=0)

    part = partial(split, made.params, pixels, 3.0, told)
    made = replace(made, fuse=lambda t, scans: soft, identify=told, split=part)
    sight = made.see(first(scene), np.array([7]), np.zeros((1, 2)), {})
    expected = [[-1.1, 0.0], [1.1, 0.0]] if count == 2 else [[0.0, 0.0]]
    np.testing.assert_allclose(sight.z[np.argsort(sight.z[:, 0])], expected, atol=0.05)


def test_doubles_are_left_out_by_order():
    """The first of the order keeps its room; a double takes no room from a third."""
    where, room = np.array([[0.0, 0.0], [1.0, 0.0], [2.5, 0.0]]), np.array([0.6, 0.6, 1.2])
    for order, expected in (
        ([0, 1, 2], [True, False, True]),
        ([1, 0, 2], [False, True, False]),
        ([2, 1, 0], [True, False, True]),
    ):
        assert front.alone(where, room, np.array(order)).tolist() == expected
    assert front.alone(where, 0 * room, np.arange(3)).all()


def test_memory_of_classes(scene, network):
    """The mean of the log-odds of all scans, their weights fading; the same again adds nothing."""
    label, where = np.array([3]), np.zeros((1, 2))
    for readings in ([0.8] * 4, [0.8, 0.3, 0.6, 0.95]):
        for memory in (0.0, 0.5):
            told, classes = chain(scene, network, class_memory=memory), {}
            for k, p in enumerate(readings):
                one = replace(told, identify=lambda t, L, x, p=p: np.array([[p, 1 - p]]))
                classes = one.see(first(scene), label, where, classes).classes
                weight = memory ** np.arange(k, -1, -1.0)
                log_odds = np.log([q / (1 - q) for q in readings[: k + 1]]) @ weight / weight.sum()
                found = evidence.probabilities(classes[3][None])[0]
                np.testing.assert_allclose(found[0], 1 / (1 + np.exp(-log_odds)))


def test_shares_of_classes_where_the_radars_stand(scene, network):
    """By Bayes: odds of the network times those of the shares, once however often it looks."""
    label, where = np.array([3]), np.array([[-10.0, -8.0]])
    plain, told = (
        chain(scene, network, class_memory=0.9, class_prior=prior) for prior in ((), (0.9, 0.1))
    )
    odds = []
    for source in (plain, told):
        classes = {}
        for _ in range(5):
            classes = source.see(first(scene), label, where, classes).classes
        p = evidence.probabilities(classes[3][None])[0]
        odds.append(p[0] / p[1])
    assert odds[1] / odds[0] == pytest.approx(9.0)


def test_decisions_are_those_of_the_product():
    """Whatever was read, the class is that of the faded product of all readings."""
    rng = np.random.default_rng(3)
    p = rng.dirichlet([0.5, 0.5], (60, 12))
    found, product = np.zeros((60, 3)), np.zeros((60, 2))
    for k in range(12):
        found = evidence.read(p[:, k], found, 0.9)
        product = np.log(p[:, k]) + 0.9 * product
    assert (evidence.likeliest(found) == product.argmax(1)).all()


def test_what_was_not_followed_is_looked_at_where_it_is(scene, network):
    asked = []

    def identify(time_ns, soft, where):
        asked.append(where)
        return np.tile([0.3, 0.7], (len(where), 1))

    told = replace(chain(scene, network), identify=identify)
    sight = told.see(first(scene), np.array([1]), np.array([[2.0, 3.0]]), {})
    label, where = np.array([1, 5]), np.array([[2.1, 3.1], [8.0, 9.0]])
    alive, before = np.array([1, 4, 5]), {4: np.zeros(3), 6: np.zeros(3)}
    classes = recognised(sight, label, where, alive, before)
    assert [a.tolist() for a in asked] == [[[2.0, 3.0]], [[8.0, 9.0]]]
    assert classes.keys() == {1, 4, 5}


@FILTERS
def test_without_a_network(module, scene):
    fixed = {"identify": "none", "gate_pedestrian": 6.0, "gate_vehicle": 6.0}
    last = run(module, scene, "/nowhere.npz", **fixed)[-1].objects
    assert len(last.label) == 2 and last.class_names == () and last.class_index is None


@FILTERS
def test_parts_may_be_replaced(module, scene, network):
    """With soft maps from a store, and with the truth for detections."""
    context = module.context(scene.setup(), params(module, scene, network))
    plain = list(module.run(context, scene.scans()))
    store = {}
    for scan in scene.scans():
        store.setdefault(scan.time_ns, []).append(scan)
    store = {t: context.source.fuse(t, scans) for t, scans in store.items()}
    shared = replace(context, source=replace(context.source, fuse=lambda t, scans: store[t]))
    for a, b in zip(plain, module.run(shared, scene.scans()), strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)

    def told(time_ns, soft, where, gate, room):
        return START + time_ns / 1e9 * VELOCITY, np.tile(1e-4 * np.eye(2), (2, 1, 1))

    exact = replace(context, source=replace(context.source, cluster=told))
    last = list(module.run(exact, scene.scans()))[-1].objects
    truth = START + (SCANS - 1) * 0.05 * VELOCITY
    state = last.state[np.argsort(last.state[:, 0])]
    np.testing.assert_allclose(state[:, :2], truth, atol=0.02)


@FILTERS
def test_maps_without_a_preset_are_seen_as_tuned(module, scene):
    stated = sensor_model(scene.setup(), module.Params)
    bare = module.resolved(module.Params, scene, stated, ())
    tuned = (("preset tuned", module.PRESETS["tuned"]),)
    assert bare == module.resolved(module.Params, scene, stated, tuned)
    given = module.resolved(
        module.Params, scene, stated, (("--set", {"p_detect": 0.7, "clutter_rate": 1.0}),)
    )
    assert given.p_detect == 0.7 and given.gate_vehicle == module.Params.gate_vehicle
    points = Stream("position", ("s0",), {}, np.zeros(0, int), np.zeros(1, int), {}, {})
    with pytest.raises(InputError, match="p_detect"):
        module.resolved(module.Params, replace(scene, streams={"p": points}), (), ())


@FILTERS
def test_missing_weights(module, scene, network, tmp_path, monkeypatch):
    with pytest.raises(FormatError, match=r"none.npz: no weights: No such file"):
        run(module, scene, str(tmp_path / "none.npz"))
    monkeypatch.setattr(front, "SHIPPED", tmp_path / "shipped.npz")
    with pytest.raises(FormatError, match=r"shipped.npz: no weights: No such file"):
        run(module, scene, "")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"map_region": (1.0, 0.0, 0.0, 1.0)}, "map_region must be x_min < x_max"),
        ({"map_cell": 0.0}, "map_cell must be positive"),
        ({"map_cell": 0.2}, "map_cell must be 0.1 m, the pixels of the network"),
        ({"map_cell": 1e-4}, "map_cell must be so that 4000000 pixels suffice"),
        ({"excision": -1.0}, "excision must be at least 0"),
        ({"gate_vehicle": 0.0}, "gate_vehicle must be positive"),
        ({"dbscan_points": 0}, "dbscan_points must be at least 1"),
        ({"min_pixels": 0}, "min_pixels must be at least 1"),
        ({"class_memory": 1.0}, r"class_memory must be in \[0, 1\)"),
        ({"class_prior": [0.5]}, "class_prior must be one share each of pedestrian vehicle"),
        ({"class_prior": [1.0, 0.0]}, "class_prior must be positive"),
        ({"identify": "oracle"}, "identify must be one of cnn none"),
        ({"identify": "none"}, "gate_vehicle must be gate_pedestrian where nobody tells classes"),
    ],
)
def test_impossible_parameters(changes, message):
    with pytest.raises(ParameterError, match=message):
        resolve(phd.Params, ("here", {"p_detect": 0.9, "clutter_rate": 1.0, **changes}))


def test_nothing_at_all(network):
    setup = Recording(Meta("empty"), {}, {})
    found = front.Chain.of(setup, phd.Params(p_detect=0.9, clutter_rate=1.0))
    assert not found.streams and found.identify is None
    assert found.see([], np.zeros(0, int), np.zeros((0, 2)), {}) is None
