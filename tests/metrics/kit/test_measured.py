"""Metrics in windows of steps: the scores are those of all steps at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.formats.windows import part
from echoset.metrics.beside import TruthWindow
from echoset.metrics.kit.measured import Measured, finish
from echoset.metrics.run import MetricRun
from echoset.models import registry
from echoset.models.errors import InputError
from echoset.models.records import Estimates, Meta, Objects, Recording, Truth

SECOND = 10**9
BY_STEPS = [
    name
    for name in registry.names("echoset.metrics")
    if hasattr(registry.load("echoset.metrics", name), "measure")
]


def some(rng: np.random.Generator, times: np.ndarray, labels: int, alone: bool) -> Objects:
    """Objects with all that metrics look at, up to ``labels`` at a time."""
    count = np.ones(len(times), int) if alone else rng.integers(0, labels + 1, len(times))
    m = int(count.sum())
    picked = [np.sort(rng.permutation(labels)[:c]) for c in count]
    return Objects(
        times,
        np.concatenate(([0], np.cumsum(count))),
        np.zeros(m, np.int64) if alone else np.concatenate(picked).astype(np.int64),
        ("x", "y", "device_x", "device_y"),
        ("m",) * 4,
        rng.uniform(0, 10, (m, 4)),
        covariance=np.tile(np.eye(4), (m, 1, 1)),
        class_names=("a", "b"),
        class_index=rng.integers(0, 2, m),
        extent_kind="ellipse",
        semi_axes=rng.uniform(0.5, 2, (m, 2)),
        rotation=rng.uniform(0, 3, m),
    )


def scene(alone: bool) -> tuple[Estimates, Recording]:
    """Estimates every second, and a truth at other times with a gap."""
    rng = np.random.default_rng(4)
    times = np.arange(60, dtype=np.int64) * SECOND
    known = np.sort(rng.choice(np.arange(-3, 66), 50, replace=False)) * SECOND
    provenance = {"estimator": "e", "parameters": {"regions": {"R": [0, 5, 0, 5]}}}
    numbers = {"cardinality_mean": rng.uniform(0, 4, 60)}
    numbers |= {f"region_{k}_R": rng.uniform(0, 4, 60) for k in ("mean", "variance")}
    estimates = Estimates(Meta("r", provenance=provenance), some(rng, times, 5, alone), numbers)
    return estimates, Recording(Meta("r"), {}, {}, Truth(some(rng, known, 4, alone)))


def rows(scores) -> list[tuple[object, ...]]:
    names = (scores.recording, scores.estimator, scores.metric, scores.part)
    numbers = (map(repr, c.tolist()) for c in (scores.time, scores.n))
    return list(zip(*names, *numbers, strict=True))


@pytest.mark.parametrize("name", BY_STEPS)
@pytest.mark.parametrize("size", [1, 7, 60])
@pytest.mark.parametrize("skip", [0, 10])
def test_windows_give_the_scores_of_the_whole(name, size, skip):
    metric = registry.load("echoset.metrics", name)
    has_span = "skip" in metric.Params.__dataclass_fields__
    user = (("test", {"skip": skip, "max_gap": 2.0} if has_span else {}),)
    for alone in (True, False):
        estimates, recording = scene(alone)
        truth = recording.truth.objects
        head = replace(recording, truth=Truth(truth.part(0, 0)))
        pieces = (
            replace(recording, truth=Truth(truth.part(k, min(k + 4, 50)))) for k in range(0, 50, 4)
        )
        beside = TruthWindow(head, pieces, 2 * SECOND)
        running = MetricRun(name, user, estimates, recording)
        for k in range(0, 60, size):
            window = part(estimates, k, min(k + size, 60))
            running.measure(window, beside.around(window.objects.time_ns))
        found = running.finish(required=False)
        try:
            whole = metric.score(estimates, recording, running.params)
        except InputError:
            assert found is None
            continue
        assert found is not None and rows(found) == rows(whole)
        np.testing.assert_allclose(found.value, whole.value, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(found.stderr, whole.stderr, rtol=1e-9, atol=1e-12)


def test_most_metrics_go_by_steps():
    others = set(registry.names("echoset.metrics")) - set(BY_STEPS)
    assert others == {"pcrlb", "pcrlb-star"}


def test_nothing_to_score_is_told():
    none = Measured(np.zeros(0), {}, 3)
    with pytest.raises(InputError, match="r: no step"):
        finish(lambda *args: None, ("r", "e"), [none, none], None)


def test_several_objects_one_after_the_other_are_not_one():
    estimates, recording = scene(alone=True)
    label = np.repeat([1, 2], 25)
    truth = replace(recording.truth.objects, label=label)
    metric = registry.load("echoset.metrics", "rmse")
    parts = [
        metric.measure(estimates, replace(recording, truth=Truth(truth.part(*s))), metric.Params())
        for s in ((0, 25), (25, 50))
    ]
    with pytest.raises(InputError, match="choose the true object"):
        finish(metric.summarise, ("r", "e"), parts, metric.Params())
