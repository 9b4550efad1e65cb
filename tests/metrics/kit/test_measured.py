"""Metrics in windows of steps: the scores are those of all steps at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.sets import scene

from echoset.formats.windows import part
from echoset.metrics.beside import TruthWindow
from echoset.metrics.kit.measured import Measured, finish
from echoset.metrics.protocol import load
from echoset.metrics.run import MetricRun
from echoset.models import registry
from echoset.models.errors import InputError
from echoset.models.records import Truth

BY_STEPS = [name for name in registry.names("echoset.metrics") if load(name).measure is not None]


def rows(scores) -> list[tuple[object, ...]]:
    names = (scores.recording, scores.estimator, scores.metric, scores.part)
    numbers = (map(repr, c.tolist()) for c in (scores.time, scores.n))
    return list(zip(*names, *numbers, strict=True))


@pytest.mark.parametrize("name", BY_STEPS)
@pytest.mark.parametrize("size", [1, 7, 60])
@pytest.mark.parametrize("skip", [0, 10])
@pytest.mark.parametrize("max_gap", [2.0, None])
def test_windows_give_the_scores_of_the_whole(name, size, skip, max_gap):
    metric = load(name)
    has_span = "skip" in metric.Params.__dataclass_fields__
    user = (("test", {"skip": skip, "max_gap": max_gap} if has_span else {}),)
    for alone in (True, False):
        estimates, recording = scene(alone)
        truth = recording.truth.objects
        head = replace(recording, truth=Truth(truth.part(0, 0)))
        pieces = (
            replace(recording, truth=Truth(truth.part(k, min(k + 4, 50)))) for k in range(0, 50, 4)
        )
        beside = TruthWindow(head, pieces)
        running = MetricRun(name, user, estimates, recording)
        running.settle(beside.start)
        for k in range(0, 60, size):
            window = part(estimates, k, min(k + size, 60))
            running.measure(window, beside.around(window.objects.time_ns, running.gap))
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
    assert others == {"pcrlb", "pcrlb-star", "pcrlb-smooth"}


def test_nothing_to_score_is_told():
    none = Measured(np.zeros(0), {}, 3)
    with pytest.raises(InputError, match="r: no step"):
        finish(lambda *args: None, ("r", "e"), [none, none], None)


def test_several_objects_one_after_the_other_are_not_one():
    estimates, recording = scene(alone=True)
    label = np.repeat([1, 2], 25)
    truth = replace(recording.truth.objects, label=label)
    metric = load("rmse")
    parts = [
        metric.measure(estimates, replace(recording, truth=Truth(truth.part(*s))), metric.Params())
        for s in ((0, 25), (25, 50))
    ]
    with pytest.raises(InputError, match="choose the true object"):
        finish(metric.summarise, ("r", "e"), parts, metric.Params())
