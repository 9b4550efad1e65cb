"""Columns of text held as runs are the sequences that they stand for."""

from __future__ import annotations

import pytest

from echoset.models.words import Words, chain, words

TEXT = ("a", "a", "b", "", "", "a")


def test_a_sequence():
    column = words(TEXT)
    assert tuple(column) == TEXT and len(column) == 6 and column == TEXT
    assert [column[i] for i in range(-6, 6)] == [TEXT[i] for i in range(-6, 6)]
    assert column[1:4] == TEXT[1:4]
    assert list(column.runs()) == [("a", 2), ("b", 1), ("", 2), ("a", 1)]
    assert words(column) is column and "b" in column and "c" not in column
    with pytest.raises(IndexError):
        column[6]


def test_equal_and_chained():
    assert chain([TEXT[:1], words(TEXT[1:5]), (), TEXT[5:]]) == words(TEXT)
    assert hash(words(TEXT)) == hash(chain([TEXT]))
    assert words(TEXT) != words(TEXT[:5]) and words(TEXT) != ("a",)
    assert Words([]) == () and len(Words([("x", 0)])) == 0
