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
from .pooling import is_rms
from .protocol import maker

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
            raise ParameterError(f"--fail-if {self.text.strip()}: {self._missing(scores)}")
        pooled = rows.where(recording="*")
        told = pooled if len(pooled) else rows
        return [
            f"{' '.join(name[:3])}:{name[3]} is {value:g} ({self.text.strip()})"
            for name, value in zip(keys(told), told.value.tolist(), strict=True)
            if _RELATIONS[self.relation](value, self.limit)
        ]

    def _missing(self, scores: Scores) -> str:
        """Why there is no such score, and how to get it."""
        asked = self.metric.removesuffix("-mean")
        made = set(scores.where(timed=False).metric)
        if asked not in made and (name := maker(asked)) is not None:
            return f"{self.metric} was not computed: ask for it by -m {name}"
        if self.metric not in made and asked in made and is_rms(asked):
            return f"{self.metric} is of pooled scores: ask for it by --pool"
        if self.part and "@" in self.part and not any("@" in part for part in scores.part):
            return "there are no scores of spans: ask for them by --segments"
        known = {f"{m}:{p}" for m, p in zip(scores.metric, scores.part, strict=True)}
        name = f"{self.metric}:{self.part or ''}"
        return f"there is no such score{suggestion(name, known)}"
