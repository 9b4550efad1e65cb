"""Regional scores: errors by hand, and regions named after the estimation."""

import numpy as np
import pytest

from echoset.estimators.points import phd
from echoset.metrics import regional
from echoset.models.errors import InputError, ParameterError
from echoset.models.random import generator
from echoset.models.records import Estimates, Meta, Objects
from echoset.simulate import many

REGIONS = {"west": [-1000.0, 0.0, -1000.0, 1000.0], "all": [-1000.0, 1000.0, -1000.0, 1000.0]}


@pytest.fixture(scope="module")
def recording():
    return many.simulate(many.Params(steps=15), generator(1, "test", "regional"), "many")


def run(recording, **changes):
    model = recording.streams["radar"].model
    params = phd.Params(**{**model, **changes})
    rng = np.random.default_rng(0)
    steps = list(phd.estimate(recording.setup(), recording.scans(), params, rng))
    provenance = {"estimator": "phd", "parameters": {"regions": params.regions}}
    objects = [s.objects for s in steps]
    joined = Objects(
        np.concatenate([o.time_ns for o in objects]),
        np.cumsum([0, *(len(o.label) for o in objects)]),
        np.concatenate([o.label for o in objects]),
        objects[0].state_names,
        objects[0].state_units,
        np.concatenate([o.state for o in objects]),
    )
    values = {key: np.concatenate([s.steps[key] for s in steps]) for key in steps[0].steps}
    return Estimates(Meta("many", provenance=provenance), joined, values)


def column(scores, metric, part):
    rows = [i for i, key in enumerate(zip(scores.metric, scores.part, strict=True))
            if key == (metric, part) and np.isfinite(scores.time[i])]  # fmt: skip
    return scores.value[rows]


def test_errors_are_the_mean_less_the_number_of_targets(recording):
    estimates = run(recording, regions=REGIONS)
    scores = regional.METRIC.score(estimates, recording, regional.METRIC.Params())
    truth = recording.truth.objects
    number = [
        sum(x < 0 for x in truth.state[a:b, 0])
        for a, b in zip(truth.row_offset, truth.row_offset[1:], strict=False)
    ]
    assert column(scores, "regional-true", "west").tolist() == number
    error = estimates.steps["region_mean_west"] - number
    np.testing.assert_allclose(column(scores, "regional-error", "west"), error)
    np.testing.assert_allclose(column(scores, "regional", "west"), np.abs(error))
    std = np.sqrt(estimates.steps["region_variance_west"])
    np.testing.assert_allclose(column(scores, "regional-std", "west"), std)


def test_regions_named_afterwards_are_those_named_before(recording):
    before = regional.METRIC.score(
        run(recording, regions=REGIONS), recording, regional.METRIC.Params()
    )
    kept = run(recording, keep=True, keep_components=2000)
    after = regional.METRIC.score(kept, recording, regional.METRIC.Params(regions=REGIONS))
    assert after.metric == before.metric and after.part == before.part
    np.testing.assert_allclose(after.value, before.value, atol=1e-7)


def test_what_is_not_known_is_said(recording):
    with pytest.raises(InputError, match="no regions"):
        regional.METRIC.score(run(recording), recording, regional.METRIC.Params())
    with pytest.raises(InputError, match="--keep"):
        regional.METRIC.score(run(recording), recording, regional.METRIC.Params(regions=REGIONS))
    with pytest.raises(ParameterError, match=r"regions\.west"):
        regional.METRIC.Params(regions={"west": [1, 2, 3]})
