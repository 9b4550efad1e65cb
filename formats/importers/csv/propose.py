"""A mapping proposed for a log: what was recognised, and marks at what was guessed.

The rows say the delimiter, the decimal sign and the header; names and values of the columns say
what they may be. The proposal is YAML to be edited: a line that was guessed ends with
``# guessed``, and what nobody can know from a log, such as where the anchors stand, with
``# FILL IN``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ....models import plain_yaml
from .sight import (
    MISSING,
    Column,
    Sight,
    alike,
    is_digits,
    is_range,
    length_unit,
    positive,
    restarts,
    rises,
    time_unit,
)
from .times import is_clock, is_date


def propose(path: Path) -> str:
    """YAML of a mapping for the log at ``path``.

    Raises
    ------
    FormatError : it is no text, or empty
    """
    log = Sight.of(path)
    out = [f"# A mapping for {path.name}, from its first {log.rows} rows. Check what was guessed."]
    if log.delimiter != ",":
        out.append(f"delimiter: {dump(log.delimiter)}")
    if log.comment not in ("", "#"):
        out.append(f"comment: {dump(log.comment)}")
    if log.decimal == ",":
        out.append('decimal: ","')
    missing = [m for m in MISSING if any(m in column.text for column in log.columns)]
    if missing:
        out.append(f"missing: {dump(missing)}")
    return "\n".join([*out, *_Proposal(log.columns, log.header).lines()]) + "\n"


_SECONDS = {"s": 299792458, "ms": 299792.458, "us": 299.792458, "ns": 0.299792458}
"""What makes metres of differences of time."""


class _Proposal:
    """Takes the columns one role after the other, and writes the lines of the mapping."""

    def __init__(self, columns: Sequence[Column], header: bool) -> None:
        self.free = list(columns)
        self.all, self.header = list(columns), header
        self.said: list[str] = []

    def take(
        self, role: str, fits: Callable[[Column], bool] = lambda c: c.numeric
    ) -> Column | None:
        """The first free column whose name says that it plays a role."""
        found = next((c for c in self.free if c.called(role) and fits(c)), None)
        if found is not None:
            self.free.remove(found)
        return found

    def lines(self) -> list[str]:
        """The mapping, and at its end the columns that were not recognised."""
        lines = self._mapping()
        names = [c.name for c in self.free[:12]] + ["..."] * (len(self.free) > 12)
        return [*lines, *([f"# not used: {dump(names)}"] if names else [])]

    def _mapping(self) -> list[str]:
        time = self._time()
        wide = self._wide()
        if wide:
            return [*self._names(), "kind: uwb", "columns:", *time, *wide, *self._uwb_end(None)]
        x, y = self.take("x"), self.take("y")
        if x is not None and y is not None:
            main = [_field("x", x, "length"), _field("y", y, "length")]
            return [*self._names(), "kind: position", "columns:", *time, *main, *self._radar()]
        if any(c.called("azimuth") for c in self.free):
            r, azimuth = self.take("range"), self.take("azimuth")
            if r is not None and azimuth is not None:
                main = [_field("range", r, "length"), _field("azimuth", azimuth, "angle")]
                head = [*self._names(), "kind: range_bearing", "columns:"]
                return [*head, *time, *main, *self._radar()]
        return [*self._names(), "kind: uwb", "columns:", *time, *self._long()]

    def _names(self) -> list[str]:
        return [] if self.header else ["header: false"]

    def _time(self) -> list[str]:
        """The lines of the time: text, two columns, six columns, ticks or a number."""
        text = [c for c in self.free if not c.numeric and c.text]
        dated = next((c for c in text if is_date(c.text[0])), None)
        clock = next((c for c in text if is_clock(c.text[0])), None)
        if dated is not None and clock is not None and not re.search(r"\d[T ]\d", dated.text[0]):
            self._drop(dated, clock)
            return [f"  time: {{columns: {dump([dated.name, clock.name])}}}"]
        if dated is not None:
            self._drop(dated)
            return [f"  time: {dump(dated.name)}"]
        if clock is not None:
            self._drop(clock)
            return [f"  time: {{column: {dump(clock.name)}, date: 2024-01-01}}  # FILL IN the date"]
        six = self._six()
        if six:
            self._drop(*six)
            listed = dump([c.name for c in six])
            return [f'  time: {{columns: {listed}, format: "YYYY MM DD HH MM SS.f"}}']
        ticks = self.take("ticks")
        if ticks is not None:
            name = dump(ticks.name)
            return [f"  time: {{column: {name}, rate: 63.8976e9, bits: 40}}  # guessed: rate, bits"]
        found = self.take("time") or self.take("clock")
        guess = ""
        frame = self.take("scan") if found is None else None
        if frame is not None:
            name = dump(frame.name)
            return [
                f"  time: {{column: {name}, scale: 0.1}}  # FILL IN seconds from frame to frame"
            ]
        if found is None:
            rising = (c for c in self.free if c.numeric and len(c.known) > 1)
            found = next((c for c in rising if rises(c.known)), None)
            guess = "  # guessed"
        if found is None:
            return ["  time: TIME  # FILL IN"]
        self._drop(found)
        nano = self.take("nanoseconds")
        if nano is not None:
            listed = dump([found.name, nano.name])
            return [f"  time: {{columns: {listed}, unit: [s, ns]}}"]
        if is_digits(found):
            return [f"  time: {{column: {dump(found.name)}, format: HHMMSSmmm}}  # guessed"]
        unit, guessed = time_unit(found)
        end = guess or ("  # guessed" if guessed else "")
        if restarts(found):
            end += "\nrestarts: split  # guessed: the clock begins anew; or wrap, or sort"
        line = f"{{column: {dump(found.name)}, unit: {unit}}}" if unit != "s" else dump(found.name)
        self.said += end.split("\n")[1:]
        return [f"  time: {line}{end.split(chr(10))[0]}"]

    def _six(self) -> list[Column]:
        """Columns of year, month, day, hour, minute and second, one after the other."""
        limits = [(1990, 2100), (1, 12), (1, 31), (0, 23), (0, 59), (0, 61)]
        for k in range(len(self.all) - 5):
            six = self.all[k : k + 6]
            if all(
                c in self.free and c.numeric and low <= c.known.min() and c.known.max() <= high
                for c, (low, high) in zip(six, limits, strict=True)
            ):
                return six
        return []

    def _drop(self, *columns: Column) -> None:
        self.free = [c for c in self.free if all(c is not d for d in columns)]

    def _wide(self) -> list[str]:
        """The lines of distances that have a column for each anchor, if there are such columns."""
        groups: dict[str, list[Column]] = {}
        for c in self.free:
            if c.numeric and self.header:
                groups.setdefault(re.sub(r"\d+", "\0", str(c.name)), []).append(c)
        groups = {k: g for k, g in groups.items() if len(g) > 1 and k.count("\0") in (1, 2)}
        if any(_distance(c) for c in self.free):
            groups = {k: g for k, g in groups.items() if is_range(k)}
        if groups:
            key = max(groups, key=lambda k: (is_range(k), len(groups[k])))
            group = groups[key]
            words = ["anchor", "device"] if key.count("\0") == 2 else ["anchor"]
            tag = re.search(r"(t|tag|d|device)[-_ ]*\0", key, re.I)
            if len(words) == 2 and tag and key.index("\0") > tag.start():
                words.reverse()
            pattern = key
            for word in words:
                pattern = pattern.replace("\0", f"{{{word}}}", 1)
            told = f"pattern: {dump(pattern)}"
            found = [re.findall(r"\d+", str(c.name)) for c in group]
            ids = sorted({one[words.index("anchor")] for one in found})
            tags = sorted({one[words.index("device")] for one in found}) if words[1:] else []
            if set(tags) & set(ids):
                self.said.append(f"rename: {{device: {dump({t: f'T{t}' for t in tags})}}}")
        else:
            group = [] if self.header else alike(self.free)
            if len(group) < 3:
                return []
            told = f"columns: {dump({f'A{k}': c.name for k, c in enumerate(group)})}"
            ids = [f"A{k}" for k in range(len(group))]
        self._drop(*group)
        self.anchors = ids
        unit, guessed = length_unit(group)
        return [
            f"  distance: {{{told}, unit: {unit}}}  # guessed" + (": unit" if guessed else ""),
            *self._device(),
            *self._skip(group, "distance"),
        ]

    def _device(self) -> list[str]:
        device = self.take("device", lambda c: True)
        return [] if device is None else [f"  device: {dump(device.name)}"]

    def _skip(self, group: Sequence[Column], name: str) -> list[str]:
        known = np.concatenate([c.known for c in group])
        self.skip = bool(len(known) and (known <= 0).any())
        return []

    def _long(self) -> list[str]:
        """The lines of one distance a row, with its anchor."""
        reference = self.take("reference", lambda c: True)
        difference = self.take("difference") if reference is not None else None
        if reference is not None and difference is not None:
            return self._differences(reference, difference)
        if reference is not None:
            self.free.append(reference)
        distance = self.take("distance") or self.take("range")
        if distance is None:
            distance = next((c for c in self.free if c.numeric and _distance(c)), None)
            self._drop(*[c for c in [distance] if c is not None])
        if distance is None:
            distance = next((c for c in self.free if c.numeric and positive(c)), None)
            end = "  # guessed"
            if distance is None:
                return ["  distance: DISTANCE  # FILL IN", *self._uwb_end(None)]
            self._drop(distance)
        else:
            end = ""
        guess = ""
        anchor = self.take("anchor", lambda c: True)
        if anchor is None:
            few = (c for c in self.free if 1 < len(set(c.text)) <= 40)
            anchor = next(few, None)
            if anchor is not None:
                self._drop(anchor)
        if anchor is not None and not anchor.called("anchor"):
            guess = "  # guessed"
        lines = [_field("distance", distance, "length") + end]
        self.anchors = sorted(set(anchor.text) - {""}) if anchor is not None else ["A"]
        name = dump(anchor.name) if anchor is not None else "{value: A}  # FILL IN"
        lines.append(f"  anchor: {name}{guess}")
        lines += self._device()
        std = self.take("std")
        lines += [] if std is None else [_field("std", std, "length")]
        self._skip([distance], "distance")
        return [*lines, *self._uwb_end(std)]

    def _differences(self, reference: Column, difference: Column) -> list[str]:
        """The lines of a difference of distance or of time a row, and of the anchors it is of."""
        anchor = self.take("anchor", lambda c: True)
        ids = set(reference.text) | set(anchor.text if anchor is not None else [])
        self.anchors = sorted(ids - {""})
        seconds = _SECONDS.get(difference.unit)
        told = f"{{column: {dump(difference.name)}, scale: {seconds}}}"
        line = (
            _field("distance", difference, "length") if seconds is None else f"  distance: {told}"
        )
        name = dump(anchor.name) if anchor is not None else "ANCHOR  # FILL IN"
        lines = [line, f"  anchor: {name}", f"  reference: {dump(reference.name)}"]
        return [*lines, *self._device(), *self._uwb_end(None)]

    def _uwb_end(self, std: Column | None) -> list[str]:
        anchors = getattr(self, "anchors", ["A"])
        out = [] if std is not None else ["  std: {value: 0.1}  # FILL IN: how good a range is [m]"]
        out += self.said
        kind = self.take("kind", lambda c: not c.numeric and len(set(c.text)) > 1)
        if kind is not None:
            words = dump(sorted(set(kind.text))[:8])
            out.append(f"# rows: {{{dump(kind.name)}: {words}}}  # keep the kinds that are ranges")
        if getattr(self, "skip", False):
            out.append("skip: distance <= 0")
        quality = self.take("quality")
        if quality is not None:
            low = float(np.min(quality.known))
            out.append(f"# skip: [distance <= 0, '`{quality.name}` < {low:g}']  # by the quality")
        out.append("anchors:  # FILL IN where they stand [m]")
        return [*out, *(f"  {dump(str(a))}: [x, y]" for a in anchors)]

    def _radar(self) -> list[str]:
        """The lines of what radars tell beside the position."""
        lines = []
        for role, kind in (
            ("z", "length"), ("elevation", "angle"), ("doppler", "speed"), ("power", "ratio"),
        ):  # fmt: skip
            found = self.take(role)
            if found is not None:
                lines.append(_field(role, found, kind))
        for role in ("scan", "sensor"):
            found = self.take(role, lambda c: True)
            if found is not None:
                lines.append(f"  {role}: {dump(found.name)}")
                if role == "sensor":
                    ids = sorted(set(found.text))
                    lines.append("sensors:  # FILL IN where they stand [m]")
                    lines += [f"  {dump(i)}: [x, y]" for i in ids]
        return [*lines, *self.said]


def _field(key: str, column: Column, kind: str) -> str:
    unit, guessed = column.unit, False
    if kind == "length":
        unit, guessed = length_unit([column])
    elif kind == "angle" and not unit:
        wide = len(column.known) > 0 and np.abs(column.known).max() > 2 * np.pi
        unit, guessed = ("deg" if wide else "rad"), True
    elif kind == "ratio" and not unit and len(column.known) and column.known.min() < 0:
        unit, guessed = "dB", True
    name = dump(column.name)
    said = name if unit in ("", "m", "rad", "m/s") else f"{{column: {name}, unit: {unit}}}"
    return f"  {key}: {said}" + ("  # guessed: unit" if guessed else "")


def _distance(column: Column) -> bool:
    """Whether the name of a column speaks of a distance, among other words."""
    return re.search(r"(^|[_ ])(range|distance|dist)([_ ]|$)", str(column.name), re.I) is not None


def dump(value: object) -> str:
    """A value as YAML that may stand within braces."""
    return plain_yaml.dump([value]).removeprefix("[").removesuffix("]")
