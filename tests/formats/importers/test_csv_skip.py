"""The language of conditions, against Python's own reading of the same words."""

from __future__ import annotations

import itertools
import string

import numpy as np
import pytest

from echoset.formats.importers.csv.skip import Column, parse
from echoset.models.errors import ParameterError

ROWS = [
    {"a": a, "b": b, "kind": kind, "signal power": a + 1}
    for a, b, kind in itertools.product((-1.0, 0.0, 2.5), (0.5, 2.5), ("twr", "", "tdoa"))
]


def lookup(name: str | int) -> Column:
    names = list(ROWS[0])
    key = names[name - 1] if isinstance(name, int) and 0 < name <= len(names) else name
    if key not in names:
        raise ParameterError(f"no column {key!r}")
    values = [row[key] for row in ROWS]
    numbers = [np.nan if isinstance(v, str) else v for v in values]
    return Column([str(v) for v in values], np.array(numbers, np.float64))


CONDITIONS = {
    "a <= 0": lambda a, b, k: a <= 0,
    "a<=0 or b>1": lambda a, b, k: a <= 0 or b > 1,
    "a > 0 and not b > 1": lambda a, b, k: a > 0 and not b > 1,
    "not a > 0 and b > 1": lambda a, b, k: (not a > 0) and b > 1,
    "not (a > 0 and b > 1)": lambda a, b, k: not (a > 0 and b > 1),
    "not not a > 0": lambda a, b, k: a > 0,
    "a > 0 or b > 1 and kind == 'twr'": lambda a, b, k: a > 0 or (b > 1 and k == "twr"),
    "(a > 0 or b > 1) and kind == 'twr'": lambda a, b, k: (a > 0 or b > 1) and k == "twr",
    "a - b * 2 < -3": lambda a, b, k: a - b * 2 < -3,
    "(a - b) * 2 == -3.0": lambda a, b, k: (a - b) * 2 == -3,
    "a - b - 1 < 0": lambda a, b, k: a - b - 1 < 0,
    "5 / b / 2 > 1": lambda a, b, k: 5 / b / 2 > 1,
    "-a == 1 or --a == 2.5": lambda a, b, k: a in (-1, 2.5),
    "abs(a - b) < 2": lambda a, b, k: abs(a - b) < 2,
    "`signal power` >= 3.5e0": lambda a, b, k: a + 1 >= 3.5,
    "$2 != .5 and $4 > 0": lambda a, b, k: b != 0.5 and a + 1 > 0,
    'kind == ""': lambda a, b, k: k == "",
    "kind != 'twr'": lambda a, b, k: k != "twr",
    "kind in ('twr', 'tdoa')": lambda a, b, k: k in ("twr", "tdoa"),
    "a not in (0, 2.5)": lambda a, b, k: a not in (0, 2.5),
    "a in (b, -1)": lambda a, b, k: a in (b, -1),
    "kind < 3": lambda a, b, k: False,
    "not kind < 3": lambda a, b, k: True,
    "1 < 2": lambda a, b, k: True,
}


@pytest.mark.parametrize("text", CONDITIONS)
def test_conditions_mean_what_they_say(text: str):
    found = np.broadcast_to(parse(text, "skip").holds(lookup), len(ROWS))
    expected = [CONDITIONS[text](row["a"], row["b"], row["kind"]) for row in ROWS]
    assert found.tolist() == expected


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "a", "a +", "a < ", "< 3", "a < 3 < 4", "a = 3", "a < 3)", "(a < 3", "a b",
        "a < 3 b", "kind < 'x'", "a == 1 == 2", "1 + (a < 2)", "not a", "a and b",
        "'x' == 'y' + 1", "a in b", "a in ()", "a in (1", "a not 3", "abs a < 3", "abs(a < 3)",
        "$ < 3", "`a < 3", "'a", "a; b", "a < 3 # more", "__import__('os')", "a.b < 3", "a[0] < 3",
        "lambda: 3", "a ** 2 > 1", "a if b", "a < 1e", "kind == 3 + 'x'", "$0 < 3", "$9 < 3",
        "(" * 100 + "a < 3" + ")" * 100, "not " * 2000 + "a < 3", "a < 3 or " * 200 + "a", "c < 3",
        3, None, ["a < 3"],
    ],
)  # fmt: skip
def test_what_is_no_condition_is_refused(text: object):
    with pytest.raises(ParameterError):
        parse(text, "skip").holds(lookup)


def test_any_text_is_a_condition_or_refused():
    rng = np.random.default_rng(5)
    plain = ["a", "b", "2", "<", "==", "and", "not", "(", ")", "-", "kind", "'twr'"]
    odd = ["or", "in", "+", "*", "/", ",", "abs", "`a`", "$1", *string.punctuation]
    parsed = 0
    for k in range(4000):
        text = " ".join(rng.choice(plain + odd * (k % 2), rng.integers(1, 9)))
        try:
            parse(text, "skip").holds(lookup)
            parsed += 1
        except ParameterError:
            pass
    assert parsed > 5
