"""Which streams of maps are fused, and their scans in windows."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.names import natural
from ...models.parameters import Layer, is_preset
from ...models.radar.multibeam import BaseStation
from ...models.records import Recording, Scan
from .frames import frames
from .params import MAPS, FusionParams

STRANGE = 1e-2, 1e3
"""Medians of a map, between which its unit may be the noise."""
_log = logging.getLogger(__name__)


def with_default(
    setup: Recording,
    stated: Sequence[Layer],
    layers: Sequence[Layer],
    presets: Mapping[str, Mapping[str, Any]],
) -> Sequence[Layer]:
    """The layers, over a preset where a recording has maps and nobody says how they are to do.

    That is, without a preset and without the probability of detection, which has no default: by
    templates where all maps state their waveform, ``tuned`` where not.
    """
    maps = [s for s in setup.streams.values() if s.kind == MAPS]
    said = any(is_preset(source) or "p_detect" in layer for source, layer in layers)
    if not maps or said or any("p_detect" in layer for _, layer in stated):
        return layers
    computed = all(f.name in s.model for s in maps for f in fields(BaseStation))
    preset = "templates" if computed else "tuned"
    _log.info("maps, and no preset: %s", preset)
    return [(f"preset {preset}", presets[preset]), *layers]


@dataclass(frozen=True, slots=True)
class Choice:
    """Streams of maps by the natural order of their names: ``used``, and those ``unused``.

    The unit of the powers in streams that are ``stated`` is known.
    """

    used: tuple[str, ...]
    unused: frozenset[str]
    stated: frozenset[str]

    @staticmethod
    def of(setup: Recording, params: FusionParams) -> Choice:
        """The first so many of a recording.

        Raises
        ------
        InputError : there are fewer
        """
        maps = {name: s for name, s in setup.streams.items() if s.kind == MAPS}
        names = sorted(maps, key=natural)
        wanted = len(names) if params.stations is None or not names else params.stations
        if wanted > len(names):
            raise InputError(f"stations is {wanted}, but only {len(names)} streams have maps")
        used, unused = names[:wanted], names[wanted:]
        if unused:
            _log.info("fusing the maps of %s, not of %s", " ".join(used), " ".join(unused))
        stated = frozenset(n for n in used if "reference_echo" in maps[n].model)
        return Choice(tuple(used), frozenset(unused), stated)

    def scans(self, scans: Iterable[Scan], within: float | None) -> Iterator[Scan]:
        """The scans but for those unused, the maps at the time of their window.

        Raises
        ------
        InputError : at the end, if a stream that is used had no scan
        """
        missing = set(self.used)

        def chosen() -> Iterator[Scan]:
            for scan in scans:
                if scan.stream in missing:
                    missing.discard(scan.stream)
                    if scan.stream not in self.stated:
                        _doubt_unit(scan)
                if scan.stream not in self.unused:
                    yield scan

        yield from frames(chosen(), frozenset(self.used), within)
        if missing:
            raise InputError(f"stream {min(missing, key=natural)}: has no maps")


def _doubt_unit(scan: Scan) -> None:
    """Warn of a map whose unit can hardly be the noise."""
    median = float(np.median(scan.scan["map"]))
    low, high = STRANGE
    if median and not low < median < high:
        _log.warning(
            "stream %s: half of the powers of its first map exceed %.3g, so that the noise is not "
            "their unit; thresholds count in it: state reference_echo in the stream's model",
            scan.stream,
            median,
        )
