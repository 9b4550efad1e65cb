"""Regional statistics of the PHD filter against sampling of the posterior that they describe."""

import dataclasses

import numpy as np
import pytest

from echoset.estimators.points import phd
from echoset.estimators.points.model.sensing import look
from echoset.models.geometry.regions import contains, polygons
from echoset.models.parameters import resolve, sensor_model
from echoset.models.random import generator
from echoset.simulate import many

pytestmark = pytest.mark.verification

REGIONS = {
    "box": (-400.0, 200.0, -300.0, 500.0),
    "triangle": ((-900.0, -900.0), (900.0, -700.0), (100.0, 800.0)),
}


def sample(posterior, corners, n, rng):
    """Numbers of targets (n,) in a region: Poisson of the missed, at most one per detection."""
    x, count = posterior.mixture, np.zeros(n)
    L = np.linalg.cholesky(x.P[:, :2, :2])
    for d in np.unique(posterior.detection):
        of = np.flatnonzero(posterior.detection == d)
        total = x.w[of].sum()
        size = rng.poisson(total, n) if d < 0 else (rng.random(n) < total).astype(int)
        run = np.repeat(np.arange(n), size)
        j = rng.choice(of, len(run), p=x.w[of] / total)
        place = x.m[j, :2] + np.einsum("kab,kb->ka", L[j], rng.normal(size=(len(j), 2)))
        count += np.bincount(run[contains(corners, place)], minlength=n)
    return count


def test_mean_and_variance_are_those_of_samples():
    n, rng = 40_000, generator(1, "test", "regions")
    recording = many.simulate(many.Params(steps=12, clutter_rate=20.0), rng, "many")
    births = {"regions": REGIONS, "birth_rate": 1.0, "birth_std_velocity": (10.0, 10.0)}
    params = resolve(phd.Params, *sensor_model(recording, phd.Params), ("test", births))
    state = phd.init()
    for scan in recording.scans():
        state, is_new, gone = phd.predict(state, params, scan.time_ns)
        seen = look(params, scan, False, recording.sensors["radar"])
        posterior = phd.update(state.mixture, [(seen, params)], params, is_new)
        mixture, _ = phd.reduce(posterior.mixture, params, len(seen.z))
        waiting, _ = phd.born(params, [seen], posterior.novelty, gone)
        state = dataclasses.replace(state, mixture=mixture, waiting=waiting)
    x, y = posterior.mixture.m[posterior.mixture.w.argmax(), :2]
    across_a_target = {"target": (x - 1.0, x + 20.0, y - 3.0, y + 30.0)}
    regions = polygons({**REGIONS, **across_a_target})
    numbers = phd._numbers(posterior, regions)
    for name, corners in regions.items():
        count = sample(posterior, corners, n, rng)
        mean, variance = numbers[f"region_mean_{name}"][0], numbers[f"region_variance_{name}"][0]
        assert mean > 0.1
        assert abs(count.mean() - mean) < 4.5 * count.std() / np.sqrt(n)
        fourth = ((count - count.mean()) ** 4).mean()
        stderr = np.sqrt((fourth - count.var() ** 2) / n)
        assert abs(count.var() - variance) < 4.5 * stderr
