"""Changed inputs of every reader: a few here, 10,000 each by make fuzz, 100,000 by make verify."""

from __future__ import annotations

import forge
import pytest
from fuzz import SOUND, Tally, _outcome, make, run
from fuzz_targets import TARGETS, Target

FEW, MANY, FORGED = 60, 100_000, 40


def assert_sound(tally: Tally, count: int) -> None:
    assert not tally.bad(), tally.bad()
    assert sum(tally.count[end] for end in SOUND) == count
    assert tally.count["refused"] > count // 3, "hardly anything was changed"


@pytest.mark.parametrize("reader", TARGETS)
def test_changed_inputs_are_refused_or_equal(reader):
    assert_sound(run(reader, FEW), FEW)


@pytest.mark.verification
@pytest.mark.parametrize("reader", TARGETS)
def test_very_many_changed_inputs(reader):
    assert_sound(run(reader, MANY), MANY)


def test_inputs_depend_on_their_number_alone():
    assert make("csv", 1, 5) == make("csv", 1, 5) != make("csv", 1, 6)


def bad(read, content=None, broken=None):
    """What the harness says of a reader that does so with a file."""
    target = Target(TARGETS["csv"].corpus, read, "text", content, broken)
    _, name, files = make("csv", 1, 0)
    return _outcome(target, name, files, [], "sound")[0]


def raise_(error):
    raise error


def test_the_harness_tells_what_is_bad():
    assert bad(lambda paths: 1) == "accepted"
    assert bad(lambda paths: 1, content=lambda record: "other") == "silent"
    assert bad(lambda paths: 1, broken=lambda name, files: True) == "silent"
    assert bad(lambda paths: raise_(ValueError("x"))) == "wrong-error"
    assert bad(lambda paths: raise_(MemoryError())) == "memory"


@pytest.mark.parametrize(
    ("read", "end"),
    [
        ("__import__('os').kill(__import__('os').getpid(), 9)", "crashed"),
        ("[bytearray(1 << 20) for _ in range(1 << 11)]", "memory"),
    ],
    ids=["crash", "memory"],
)
def test_what_ends_a_worker_is_counted_and_the_rest_goes_on(monkeypatch, read, end):
    started = []

    def act(paths):
        started.append(1)
        return eval(read) if len(started) == 3 else 1

    monkeypatch.setitem(TARGETS, "bad", Target(TARGETS["csv"].corpus, act, "text"))
    started.extend([0] * -len(TARGETS["csv"].corpus()))
    tally = run("bad", 4)
    assert sum(tally.count.values()) == 4 and tally.count[end] >= 1, tally


def assert_alike(tally: Tally, count: int) -> None:
    assert not tally.bad(), tally.bad()
    assert sum(tally.count[end] for end in SOUND) == count
    assert min(tally.count[end] for end in SOUND) > count // 10


def test_all_commands_say_the_same_of_forged_records():
    assert_alike(forge.run(FORGED), FORGED)


@pytest.mark.verification
def test_all_commands_say_the_same_of_very_many_forged_records():
    assert_alike(forge.run(20_000), 20_000)
