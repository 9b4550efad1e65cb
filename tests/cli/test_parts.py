"""The exit code of several failures, and parameters as people write them."""

from __future__ import annotations

import subprocess

import pytest

from echoset.campaign.batch.run import _portable
from echoset.campaign.exits import worst
from echoset.campaign.layers import assignments
from echoset.models.errors import FormatError, ParameterError
from echoset.models.plain_yaml import dump, parse


@pytest.mark.parametrize(
    ("codes", "partial", "code"),
    [
        ([], False, 0),
        ([4], False, 4),
        ([4], True, 4),
        ([4, 5, 4], True, 5),
        ([5, 7], True, 7),
        ([7, 1, 4], False, 1),
        ([2], True, 3),
        ([2], False, 2),
    ],
)
def test_gravest_exit_code(codes, partial, code):
    assert worst(codes, partial) == code


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("-2E+5", -2e5),
        (".5e1", 5.0),
        ("1.5", 1.5),
        ("3", 3),
        ("[1e2, 2]", [100.0, 2]),
        ("2026-01-01", "2026-01-01"),
        ("e3", "e3"),
        ("true", True),
        ("", None),
    ],
)
def test_values(text, value):
    found = assignments([f"a.b={text}"])["a"]["b"]
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize("items", [["a"], ["=1"], ["a.=1"], ["a=1", "a.b=2"], ["a={b: [}"]])
def test_what_is_no_assignment(items):
    with pytest.raises(ParameterError, match="--set"):
        assignments(items)


@pytest.mark.parametrize(
    "value", [1e-10, 1e300, 0.1, 3, "1e3", "yes", "", "a: b", None, True, (1.0, (2, 3)), {"a": [1]}]
)
def test_dump_is_read_back(value):
    plain = [1.0, [2, 3]] if isinstance(value, tuple) else value
    assert parse(dump(value), "test") == plain
    assert type(parse(dump(value), "test")) is type(plain)


def test_signal_in_a_finalizer_is_not_lost(command):
    """Where Python drops exceptions, the signal comes again; nothing is said of it."""
    code = """
import os, signal, sys, time
from echoset.campaign import exits
from echoset.cli.main import run

class Last:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(1000):
            pass

def work():
    Last()
    time.sleep(20)

sys.exit(run(work))
"""
    found = subprocess.run([command[0], "-c", code], capture_output=True, timeout=15)
    assert (found.returncode, found.stderr) == (143, b"")


class Odd(Exception):
    """One that another process cannot have."""

    def __init__(self, one, two):
        super().__init__(f"{one} and {two}")


def test_errors_from_workers_can_be_sent():
    """What cannot is told by name; the cause is left out if that is what cannot."""
    assert repr(_portable(Odd(1, 2))) == "RuntimeError('Odd: 1 and 2')"
    error = FormatError("x", "byte 3", "odd")
    assert _portable(error) is error
