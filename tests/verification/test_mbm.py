"""MBM filter against the PHD filter and its own claims, over many simulated recordings."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from echoset.estimators import mbm, phd
from echoset.formats.importers import autoferry
from echoset.metrics.distances.gospa import METRIC, gospa
from echoset.metrics.kit.sets import sets
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.models.records import Estimates, Meta, Recording, Sensor, Stream
from echoset.simulate import meeting

pytestmark = pytest.mark.verification

ROOT = Path(os.environ.get("ECHOSET_DATA", Path(__file__).parents[3] / "shared" / "data"))
DATA = ROOT / "autoferry"
RUNS = 100
SCENE = {
    "p_detect": 0.9,
    "clutter_rate": 10.0,
    "clutter_region": (0.0, 300.0, 0.0, 300.0),
    "std_position": 1.0,
    "std_acceleration": 0.1,
    "birth_rate": 0.05,
    "birth_std_velocity": (1.0, 1.0),
}


def joined(parts):
    """Steps of one object table each as one table."""
    tables = [part.objects for part in parts]
    columns = {
        name: np.concatenate([getattr(table, name) for table in tables])
        for name in ("time_ns", "label", "state", "covariance", "existence")
    }
    offset = np.cumsum([0, *(len(table.label) for table in tables)])
    return dataclasses.replace(tables[0], row_offset=offset, **columns)


def errors(module, recording, cutoff=10.0, **values):
    """GOSPA of every step, p = 2, with its parts, and what the filter yielded."""
    params = resolve(module.Params, ("here", values))
    rng = np.random.default_rng(0)
    parts = list(module.estimate(recording.setup(), recording.scans(), params, rng))
    meta = Meta(recording.meta.name, provenance={"estimator": "filter"})
    found = Estimates(meta, joined(parts), {})
    aligned = sets(found, recording, METRIC.Params(order=2.0, cutoff=cutoff))
    return gospa(aligned, 2.0, cutoff), parts


@pytest.fixture(scope="module")
def recordings():
    return [
        meeting.simulate(meeting.Params(), generator(1, "simulate", f"run-{i}"), f"run-{i}")
        for i in range(RUNS)
    ]


@pytest.fixture(scope="module")
def reference(recordings):
    """Mean GOSPA of the PHD filter in every run."""
    return np.array([errors(phd, r, **SCENE)[0][""].mean() for r in recordings])


def paired(reference, mine):
    """Mean share by which ``mine`` is below the reference, and its standard error."""
    gain = reference - mine
    share = gain.mean() / reference.mean()
    return share, np.std(mine - (1 - share) * reference, ddof=1) / reference.mean() / RUNS**0.5


@pytest.mark.parametrize(
    "changes",
    [
        {"max_hypotheses": 20},
        {"max_hypotheses": 20, "poisson": True},
        {"max_hypotheses": 200, "poisson": True},
        {"max_hypotheses": 20, "poisson": True, "extraction": "cardinality"},
    ],
)
def test_meeting_targets_are_told_apart_better_than_by_the_phd_filter(
    recordings, reference, changes
):
    mine = np.array([errors(mbm, r, **SCENE, **changes)[0][""].mean() for r in recordings])
    share, error = paired(reference, mine)
    assert share - 4.5 * error > 0.2


def test_more_hypotheses_are_not_worse(recordings):
    few, many = (
        np.array(
            [
                errors(mbm, r, **SCENE, poisson=True, max_hypotheses=k)[0][""].mean()
                for r in recordings
            ]
        )
        for k in (1, 100)
    )
    difference = many - few
    assert difference.mean() < 4.5 * difference.std(ddof=1) / RUNS**0.5
    assert difference.mean() < 0


def drawn_from_the_model(rng, steps=60, side=300.0):
    """Scans of targets that behave as the filter assumes, and how many it has ever seen live."""
    start, velocity = (np.zeros((0, 2)) for _ in range(2))
    seen, scans, number = np.zeros(0, bool), [], []
    for _ in range(steps):
        alive = rng.random(len(start)) < 0.99
        push = 0.1 * rng.normal(size=start.shape)
        start, velocity = (start + velocity + push / 2)[alive], (velocity + push)[alive]
        n = rng.poisson(SCENE["birth_rate"])
        start = np.vstack((start, rng.uniform(0, side, (n, 2))))
        velocity = np.vstack((velocity, rng.normal(size=(n, 2))))
        hit = rng.random(len(start)) < 0.9
        seen = np.concatenate((seen[alive], np.zeros(n, bool))) | hit
        z = start[hit] + rng.normal(size=(hit.sum(), 2))
        scans.append(np.vstack((z, rng.uniform(0, side, (rng.poisson(10.0), 2)))))
        number.append(seen.sum())
    offset = np.cumsum([0, *map(len, scans)])
    x, y = np.vstack(scans).T.copy()
    time_ns = np.arange(steps, dtype=np.int64) * 10**9
    stream = Stream("position", ("radar",), {}, time_ns, offset, {}, {"x": x, "y": y})
    sensors = {"radar": Sensor.static("radar", (0, 0))}
    return Recording(Meta("model"), sensors, {"radar": stream}), np.array(number)


def test_stated_cardinality_is_honest_where_the_model_holds():
    """The number of detected targets has, on average, the mean and the variance that are stated."""
    bias, excess = [], []
    for i in range(RUNS):
        recording, number = drawn_from_the_model(generator(2, "simulate", f"model-{i}"))
        params = mbm.Params(**SCENE, poisson=True)
        rng = np.random.default_rng(0)
        parts = list(mbm.estimate(recording.setup(), recording.scans(), params, rng))
        mean, variance = (
            np.array([p.steps[f"cardinality_{k}"][0] for p in parts]) for k in ("mean", "variance")
        )
        bias.append(np.mean(mean - number))
        excess.append(np.mean((mean - number) ** 2 - variance))
    for value in (np.array(bias), np.array(excess)):
        assert abs(value.mean()) < 4.5 * value.std(ddof=1) / RUNS**0.5


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}; set ECHOSET_DATA")
def test_vessels_of_the_autoferry_benchmark():
    """One preset for all scenarios, chosen on 2 and 13, radar only, c = 20 m."""
    mean = {}
    least = {2: 0.95, 3: 0.88, 13: 0.85, 17: 0.93}
    for scenario, completeness in least.items():
        only = autoferry.Params(sensors=("radar",))
        recording = autoferry.read([DATA / f"scenario{scenario}"], only)
        found, _ = errors(mbm, recording, 20.0, **mbm.PRESETS["autoferry"])
        one = 20.0**2 / 2
        assert 1 - np.mean(found["missed"] ** 2) / (2 * one) >= completeness
        assert np.mean(found["false"] ** 2) / one <= 1.0
        mean[scenario] = found[""].mean()
    assert max(mean.values()) <= 18 and np.mean(list(mean.values())) <= 15


@pytest.mark.skipif(not DATA.is_dir(), reason=f"no recordings in {DATA}; set ECHOSET_DATA")
def test_a_map_of_clutter_takes_land_from_the_phd_filter():
    """At least a third of the false objects of the same filter without a map, over all scans."""
    false, total = np.zeros(2), np.zeros(2)
    for scenario in (2, 3, 13, 17):
        only = autoferry.Params(sensors=("radar",))
        recording = autoferry.read([DATA / f"scenario{scenario}"], only)
        preset = phd.PRESETS["autoferry"]
        for k, cell in enumerate((preset["clutter_cell"], 0.0)):
            found, _ = errors(phd, recording, 20.0, **{**preset, "clutter_cell": cell})
            false[k] += np.sum(found["false"] ** 2)
            total[k] += found[""].mean()
    assert false[0] < 2 / 3 * false[1] and total[0] < total[1]
