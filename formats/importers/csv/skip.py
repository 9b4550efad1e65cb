"""Conditions on the columns of a log, written as text: which of its rows are left out.

A small language, parsed here and never run as code::

    distance <= 0 or quality < 3
    not (kind in ('UWB', 'twr')) and `signal power` - noise < 2 * margin

Numbers, 'texts', columns by their names (``within backquotes`` where a name has blanks or marks, or
by their number as ``$3``), ``+ - * /``, ``abs()``, ``< <= > >= == !=``, ``in (..)``, ``and or not``
and parentheses. A comparison with a number that is missing is false; ``== ''`` finds what is empty.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import shown
from ....models.records import Array

_LONGEST, _DEEPEST = 1000, 40
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)"
    r"|'(?P<text>[^']*)'|\"(?P<text2>[^\"]*)\"|`(?P<quoted>[^`]+)`|\$(?P<count>\d+)"
    r"|(?P<word>[^\W\d]\w*)|(?P<mark><=|>=|==|!=|[-+*/()<>,]))"
)
_WORDS = ("and", "or", "not", "in", "abs")


@dataclass(frozen=True, slots=True, eq=False)
class Column:
    """A column (m,) as text, and as numbers where it has them, NaN elsewhere."""

    text: Sequence[str]
    numbers: Array


Lookup = Callable[[str | int], Column]
"""A column by its name or number; ParameterError if there is none."""
_Value = Column | Array | str
_Node = Callable[[Lookup], _Value]


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition and its text."""

    text: str
    node: _Node

    def holds(self, lookup: Lookup) -> Array:
        """Whether it holds in each row (m,)."""
        return _logical(self.node(lookup), self.text)


def parse(text: object, where: str) -> Condition:
    """The condition that ``text`` states.

    Raises
    ------
    ParameterError : it states none
    """
    if not isinstance(text, str) or not text.strip() or len(text) > _LONGEST:
        raise ParameterError(
            f"{where} must be a condition such as 'distance <= 0', got {shown(text)}"
        )
    return Condition(text, _Parser(text, where).whole())


class _Parser:
    """Recursive descent over the tokens of one condition."""

    def __init__(self, text: str, where: str) -> None:
        self.text, self.where, self.depth = text, where, 0
        self.tokens: list[tuple[str, str]] = []
        at = 0
        while text[at:].strip():
            found = _TOKEN.match(text, at)
            if found is None:
                self.fail(text[at:].strip()[:20])
            kind = str(found.lastgroup)
            token = found[kind]
            if kind == "word" and token in _WORDS:
                kind = "mark"
            self.tokens.append((kind.rstrip("2"), token))
            at = found.end()
        self.tokens.append(("end", "the end"))

    def fail(self, at: str) -> NoReturn:
        raise ParameterError(f"{self.where}: {self.text!r} is no condition: see {at!r}")

    def take(self, *marks: str) -> str:
        """The next token if it is one of ``marks``, which is consumed, or nothing."""
        kind, token = self.tokens[0]
        if kind == "mark" and token in marks:
            self.tokens.pop(0)
            return token
        return ""

    def need(self, mark: str) -> None:
        if not self.take(mark):
            self.fail(self.tokens[0][1])

    def whole(self) -> _Node:
        node = self.either()
        if self.tokens[0][0] != "end":
            self.fail(self.tokens[0][1])
        return node

    def either(self) -> _Node:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise ParameterError(f"{self.where}: the condition is nested too deeply")
        node = self.both()
        while self.take("or"):
            node = _joined(np.logical_or, node, self.both(), self.text)
        self.depth -= 1
        return node

    def both(self) -> _Node:
        node = self.negated()
        while self.take("and"):
            node = _joined(np.logical_and, node, self.negated(), self.text)
        return node

    def negated(self) -> _Node:
        count = 0
        while self.take("not"):
            count += 1
        node, text = self.compared(), self.text
        if count:
            odd = bool(count % 2)
            return lambda lookup: _logical(node(lookup), text) ^ odd
        return node

    def compared(self) -> _Node:
        left, text = self.sum(), self.text
        mark = self.take("<=", ">=", "==", "!=", "<", ">", "in", "not")
        if mark in ("in", "not"):
            if mark == "not":
                self.need("in")
            among = self.listed()

            def within(lookup: Lookup) -> Array:
                value = left(lookup)
                equal = [_compare("==", value, item(lookup), text) for item in among]
                return np.asarray(np.logical_or.reduce(equal) ^ (mark == "not"))

            return within
        if not mark:
            return left
        right = self.sum()
        return lambda lookup: _compare(mark, left(lookup), right(lookup), text)

    def listed(self) -> list[_Node]:
        self.need("(")
        items = [self.sum()]
        while self.take(","):
            items.append(self.sum())
        self.need(")")
        return items

    def sum(self) -> _Node:
        node = self.product()
        while mark := self.take("+", "-"):
            node = _joined(np.add if mark == "+" else np.subtract, node, self.product(), self.text)
        return node

    def product(self) -> _Node:
        node = self.atom()
        while mark := self.take("*", "/"):
            node = _joined(np.multiply if mark == "*" else np.divide, node, self.atom(), self.text)
        return node

    def atom(self) -> _Node:
        minus = 0
        while self.take("-"):
            minus += 1
        text = self.text
        if self.take("abs"):
            self.need("(")
            inner = self.sum()
            self.need(")")
            node: _Node = lambda lookup: np.abs(_numeric(inner(lookup), text))  # noqa: E731
        elif self.take("("):
            node = self.either()
            self.need(")")
        else:
            node = self.leaf()
        if minus:
            sign = (-1.0) ** minus
            return lambda lookup: np.asarray(sign * _numeric(node(lookup), text))
        return node

    def leaf(self) -> _Node:
        kind, token = self.tokens[0]
        if kind in ("mark", "end"):
            self.fail(token)
        self.tokens.pop(0)
        if kind == "number":
            number = np.float64(token)
            return lambda lookup: np.asarray(number)
        if kind == "text":
            return lambda lookup: token
        name = int(token) if kind == "count" else token
        return lambda lookup: lookup(name)


def _joined(operation: Callable[[Array, Array], Array], a: _Node, b: _Node, text: str) -> _Node:
    taken = _logical if operation in (np.logical_and, np.logical_or) else _numeric

    def node(lookup: Lookup) -> Array:
        with np.errstate(all="ignore"):
            return np.asarray(operation(taken(a(lookup), text), taken(b(lookup), text)))

    return node


def _logical(value: _Value, text: str) -> Array:
    if isinstance(value, np.ndarray) and value.dtype == bool:
        return value
    raise ParameterError(f"skip: {text!r} needs comparisons, with and, or, not between them")


def _numeric(value: _Value, text: str) -> Array:
    if isinstance(value, Column):
        return value.numbers
    if isinstance(value, np.ndarray) and value.dtype != bool:
        return value
    raise ParameterError(f"skip: {text!r} counts with what is no number")


def _compare(mark: str, a: _Value, b: _Value, text: str) -> Array:
    if isinstance(a, str) or isinstance(b, str):
        if mark not in ("==", "!=") or isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
            raise ParameterError(f"skip: {text!r}: a text is == or != to a column, no more")
        x, y = (v if isinstance(v, str) else np.array(v.text, object) for v in (a, b))
        equal = np.asarray(x == y, bool)
        return equal if mark == "==" else ~equal
    left, right = _numeric(a, text), _numeric(b, text)
    known = ~(np.isnan(left) | np.isnan(right))
    operation = {
        "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal,
        "==": np.equal, "!=": np.not_equal,
    }[mark]  # fmt: skip
    return np.asarray(operation(left, right) & known)
