"""Passes forwards and backwards: what waits for what, what is kept, and in how much memory."""

from __future__ import annotations

from tempfile import TemporaryFile

import numpy as np
import pytest

from echoset.estimators.kernels import passes
from echoset.estimators.kernels.passes import SmoothParams, Stack, smoothed
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.models.records import Estimates, Meta, Objects

SECOND = 10**9


def at(time_ns, value):
    """One object at x = ``value``."""
    state = np.array([[value]], float)
    offset, label = np.array([0, 1]), np.zeros(1, np.int64)
    return Objects(np.array([time_ns], np.int64), offset, label, ("x",), ("m",), state)


def forward(values):
    """The values, one a second, each the record of its time."""
    for k, value in enumerate(values):
        steps = {"number": np.array([k])}
        yield Estimates(Meta("run"), at(k * SECOND, value), steps), (k * SECOND, value)


def backward(carried, record):
    """The sum of a value and of those that came later."""
    time_ns, value = record
    total = value + (carried or 0.0)
    return total, at(time_ns, total)


@pytest.mark.parametrize(
    ("wait", "expected"),
    [
        (None, [1, 2, 4, 8, 16]),
        (np.inf, [31, 30, 28, 24, 16]),
        (0.0, [1, 2, 4, 8, 16]),
        (2.0, [7, 14, 28, 24, 16]),
        (1.5, [7, 14, 28, 24, 16]),
        (9.0, [31, 30, 28, 24, 16]),
    ],
)
def test_estimates_wait_for_what_comes(wait, expected):
    found = list(smoothed(forward([1, 2, 4, 8, 16]), backward, wait))
    assert [float(e.objects.state[0, 0]) for e in found] == expected
    assert [int(e.objects.time_ns[0]) for e in found] == [k * SECOND for k in range(5)]
    assert [int(e.steps["number"][0]) for e in found] == list(range(5))


@pytest.mark.parametrize(("wait", "expected"), [(np.inf, 5), (2.0, 5)])
def test_only_what_is_yielded_is_made(wait, expected):
    made = []

    def lazy(carried, record):
        total, objects = backward(carried, record)

        def make():
            made.append(record)
            return objects

        return total, make

    found = list(smoothed(forward([1, 2, 4, 8, 16]), lazy, wait))
    own = list(smoothed(forward([1, 2, 4, 8, 16]), backward, wait))
    assert [e.objects.state[0, 0] for e in found] == [e.objects.state[0, 0] for e in own]
    assert len(made) == expected


def test_what_has_waited_long_enough_is_not_kept_back():
    """With a lag of 2 s the first estimate comes with the third time."""
    seen = []

    def watched():
        for pair in forward([1, 2, 4, 8]):
            seen.append(pair[1])
            yield pair

    next(smoothed(watched(), backward, 2.0))
    assert len(seen) == 3


def test_nothing_is_smoothed_to_nothing():
    assert not list(smoothed(forward([]), backward, np.inf))


def test_a_stack_gives_the_last_first_from_memory_and_from_its_file(monkeypatch):
    monkeypatch.setattr(passes, "SPILL", 50_000)
    monkeypatch.setattr(passes, "BLOCK", 16)
    rng = np.random.default_rng(1)
    items = [rng.normal(size=100) for _ in range(1000)]
    largest = 0
    with Stack() as stack:
        for item in items:
            stack.push(item)
            largest = max(largest, stack.in_memory)
        assert stack.spilled and largest < 60_000
        found = list(stack)
        assert not list(stack) and not stack.spilled
    assert len(found) == 1000
    for a, b in zip(found, reversed(items), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_stack_may_grow_again_while_it_is_taken_off(monkeypatch):
    monkeypatch.setattr(passes, "SPILL", 1000)
    monkeypatch.setattr(passes, "BLOCK", 2)
    rng, expected = np.random.default_rng(2), []
    with Stack() as stack:
        for k in range(3000):
            if rng.random() < 0.6 or not expected:
                stack.push((k, bytes(50)))
                expected.append(k)
            else:
                assert next(iter(stack))[0] == expected.pop()
        assert stack.spilled
        assert [k for k, _ in stack] == expected[::-1]


def test_the_file_is_where_it_is_told_and_the_way_back_is_watched(monkeypatch, tmp_path):
    monkeypatch.setattr(passes, "SPILL", 1000)
    monkeypatch.setattr(passes, "BLOCK", 2)
    folders, steps = [], []

    def file(dir):
        folders.append(dir)
        return TemporaryFile(dir=dir)

    def watch(items, total):
        for k, item in enumerate(items):
            steps.append((k, total))
            yield item

    monkeypatch.setattr(passes, "TemporaryFile", file)
    token = passes.AROUND.set(passes.Around(tmp_path, watch))
    try:
        out = list(smoothed(forward(range(99)), backward, np.inf))
    finally:
        passes.AROUND.reset(token)
    assert [float(e.objects.state[0, 0]) for e in out] == [sum(range(k, 99)) for k in range(99)]
    assert folders == [tmp_path, tmp_path] and not list(tmp_path.iterdir())
    assert steps == [(k, 99) for k in range(99)]


@pytest.mark.parametrize(
    ("word", "wait"),
    [("none", None), ("whole", np.inf), ("5s", 5.0), ("0.25s", 0.25), (".5s", 0.5)],
)
def test_times_to_wait(word, wait):
    assert SmoothParams(smooth=word).wait == wait


@pytest.mark.parametrize("word", ["", "5", "-1s", "all", "1e3s", "5 s"])
def test_what_is_no_time_to_wait(word):
    with pytest.raises(ParameterError, match="smooth must be none, whole or a time"):
        resolve(SmoothParams, ("here", {"smooth": word}))
