"""What a parameter may be: said with the field, checked when layers are resolved."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from echoset.models.errors import ParameterError
from echoset.models.parameters import groups, is_within, parameter, resolve, rule


@dataclass(frozen=True, slots=True)
class Base:
    TITLE = "sensors"
    STREAMS = ("position",)
    share: float = parameter(0.5, "1", "a share", within="[0, 1)")


@dataclass(frozen=True, slots=True)
class Params(Base):
    TITLE = "rest"
    sizes: tuple[float, ...] = parameter((1.0, 2.0), "m", "sizes", within="(0, inf)")
    count: int | None = parameter(None, "1", "a count", within="[1, inf)")
    kind: str = parameter("a", "1", "a kind", within=("a", "b"))


@pytest.mark.parametrize(
    ("value", "within", "ok"),
    [
        (0, "[0, 1)", True),
        (1, "[0, 1)", False),
        (0, "(0, inf)", False),
        (1e300, "(0, inf)", True),
        (-1, "(-inf, 0]", True),
        ([1, 2, 0], "(0, inf)", False),
        ((), "(0, inf)", True),
        (None, "[1, inf)", True),
        ("b", ("a", "b"), True),
        ("c", ("a", "b"), False),
        (-7, "", True),
    ],
)
def test_intervals_and_choices(value, within, ok):
    assert is_within(value, within) == ok


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"share": 1}, "here: share must be in [0, 1), got 1.0"),
        ({"sizes": [3, 0]}, "here: sizes must be positive, got (3.0, 0.0)"),
        ({"count": 0}, "here: count must be at least 1, got 0"),
        ({"kind": "c"}, "here: kind must be one of a b, got 'c'"),
    ],
)
def test_what_is_not_within_is_refused_by_its_source(values, message):
    with pytest.raises(ParameterError) as caught:
        resolve(Params, ("there", {"kind": "b"}), ("here", values))
    assert str(caught.value) == message


def test_rules_in_words():
    assert [rule(w) for w in ("(2, inf)", "[0, 1]", "")] == ["more than 2", "in [0, 1]", ""]


def test_fields_go_by_the_class_that_declares_them():
    found = [(cls.TITLE, [f.name for f in fields]) for cls, fields in groups(Params)]
    assert found == [("sensors", ["share"]), ("rest", ["sizes", "count", "kind"])]
