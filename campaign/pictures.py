"""The inputs of pictures, any number of them, sorted into recordings, estimates and scores."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ..formats import observed_digest
from ..formats.provenance import versions
from ..metrics import pooling
from ..models import registry
from ..models.errors import InputError
from ..models.names import scenario
from ..models.records import Estimates, Recording, Scores
from ..report import Picture, few, plots
from ..report.plots import Inputs
from . import log
from .files import inputs

PHONE = 9.3
"""Width [cm] of plots in a page: that of a phone, on which letters keep their size."""


def gather(sources: Iterable[str]) -> Inputs:
    """All inputs read and verified; a recording that came along counts where none is named.

    Raises
    ------
    InputError : estimates were made from another recording than those given
    """
    recordings: list[Recording] = []
    estimates: list[tuple[str, Estimates]] = []
    scores: list[Scores] = []
    for source in sources:
        record = inputs.read_any(source)
        if isinstance(record, Recording):
            recordings.append(record)
        elif isinstance(record, Estimates):
            estimates.append((inputs.label(source), record))
        else:
            scores.append(record)
    if not recordings:
        carried = {e.meta.name: e.recording for _, e in estimates if e.recording is not None}
        recordings = list(carried.values())
    known = {observed_digest(r) for r in recordings}
    for label, e in estimates:
        if known and e.making.digest and e.making.digest not in known:
            raise InputError(f"{label}: was made from another recording: the digests differ")
    table = Scores.join(scores) if scores else None
    return Inputs(
        tuple(recordings), tuple(e for _, e in estimates), table, pooled(table) if table else None
    )


def pooled(scores: Scores) -> Scores:
    """Scores of recordings, pooled by scenario; where there are none, all as they are."""
    single = scores.where(recording=lambda name: name != "*")
    return pooling.pool(single if len(single) else scores, by_scenario=True)


def warn_of_few(scores: Scores) -> None:
    """Say of which metrics less than half of the steps were scored."""
    for line in few(scores):
        log.logger.warning("%s", line)


def portraits(found: Inputs) -> list[Picture] | None:
    """All plots that scores alone allow, as pictures of a page; None without Matplotlib.

    The kinds that find nothing to show are left out.
    """
    if not plots.available():
        return None
    made = []
    scores, pooled = found.tables
    for scene in dict.fromkeys(map(scenario, pooled.recording)):
        one = Inputs(scores=_of(scene, scores), pooled=_of(scene, pooled))
        for kind in registry.names(plots.GROUP):
            plot = registry.load(plots.GROUP, kind)
            if "scores" in (*plot.NEEDS, *plot.USES) and set(plot.NEEDS) <= {"scores"}:
                try:
                    figure = plots.figure(kind, one, size=(PHONE, plot.SIZE[1]), grow=True)
                except InputError:
                    continue
                svg = plots.inline(figure, f"{kind} of {scene}")
                made.append(Picture(scene, kind, f"{scene}: {plot.SUMMARY}", svg))
    return made


def _of(scene: str, scores: Scores) -> Scores:
    """The scores of one scenario."""
    return scores.where(recording=lambda name: scenario(name) == scene)


def describe(kind: str, found: Inputs) -> dict[str, Any]:
    """Where a picture comes from: its kind, the provenance of its inputs, versions."""
    records: tuple[Recording | Estimates, ...] = (*found.recordings, *found.estimates)
    sources: list[Any] = [{"name": r.meta.name, **r.meta.provenance} for r in records]
    if found.scores is not None:
        sources.append(dict(found.scores.provenance))
    return {"plot": kind, "inputs": sources, "versions": versions()}
