"""Gates on scores, such as ``rmse:device > 0.2``: true, they fail the command."""

from __future__ import annotations

import math
import operator
import re
from dataclasses import dataclass

from ..models.errors import ParameterError
from ..models.parameters import suggestion
from ..models.records import Scores
from .kit.table import keys

_RELATIONS = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}
_GATE = re.compile(r"\s*([^\s:<>=]+)(?::([^<>\s]*))?\s*(>=|<=|>|<)\s*(\S+)\s*")


@dataclass(frozen=True, slots=True)
class Gate:
    """``metric:part relation limit``; without a part, of every part."""

    text: str
    metric: str
    part: str | None
    relation: str
    limit: float

    @staticmethod
    def parse(text: str) -> Gate:
        """The gate that ``text`` says.

        Raises
        ------
        ParameterError : it does not read so
        """
        found = _GATE.fullmatch(text)
        try:
            limit = float(found[4]) if found else math.nan
        except ValueError:
            limit = math.nan
        if not found or math.isnan(limit):
            raise ParameterError(f"--fail-if must be METRIC[:PART] > NUMBER, got {text!r}")
        return Gate(text, found[1], found[2], found[3], limit)

    def failures(self, scores: Scores) -> list[str]:
        """A line for each aggregate that lies behind the gate: of the pool where there is one.

        Raises
        ------
        ParameterError : there is no such score
        """
        rows = scores.where(metric=self.metric, part=self.part, timed=False)
        if not len(rows):
            known = {f"{m}:{p}" for m, p in zip(scores.metric, scores.part, strict=True)}
            hint = suggestion(f"{self.metric}:{self.part or ''}", known)
            raise ParameterError(f"--fail-if {self.text}: there is no such score{hint}")
        pooled = rows.where(recording="*")
        told = pooled if len(pooled) else rows
        return [
            f"{' '.join(name[:3])}:{name[3]} is {value:g} ({self.text.strip()})"
            for name, value in zip(keys(told), told.value.tolist(), strict=True)
            if _RELATIONS[self.relation](value, self.limit)
        ]
