"""Columns of text held as runs are the sequences that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.models.runs import Runs

TEXT = ("a", "a", "b", "", "", "a")


def test_a_sequence():
    column = Runs.of(TEXT)
    assert tuple(column) == TEXT and len(column) == 6 and column == TEXT
    assert [column[i] for i in range(-6, 6)] == [TEXT[i] for i in range(-6, 6)]
    assert column[1:4] == TEXT[1:4]
    assert list(column.runs()) == [("a", 2), ("b", 1), ("", 2), ("a", 1)]
    assert Runs.of(column) is column and "b" in column and "c" not in column
    with pytest.raises(IndexError):
        column[6]


def test_equal_and_chained():
    assert Runs.join([TEXT[:1], Runs.of(TEXT[1:5]), (), TEXT[5:]]) == Runs.of(TEXT)
    assert hash(Runs.of(TEXT)) == hash(Runs.join([TEXT]))
    assert Runs.of(TEXT) != Runs.of(TEXT[:5]) and Runs.of(TEXT) != ("a",)
    assert Runs([]) == () and len(Runs([("x", 0)])) == 0


@pytest.mark.parametrize("text", [TEXT, (), ("a",)])
def test_asked_and_taken(text):
    column = Runs.of(text)
    assert column.where(lambda t: t in "ax").tolist() == [t in "ax" for t in text]
    rows = np.array([5, 0, 1, 1, 2, 4, 3, 0][: 8 * bool(text)]) % max(len(text), 1)
    assert column.take(rows) == Runs.of(text[i] for i in rows)
    assert column.take(np.zeros(0, int)) == ()
