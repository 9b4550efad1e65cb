"""A picture from a kind of plot: drawn without a display, saved as the same bytes every time."""

from __future__ import annotations

import html
import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import registry
from ...models.errors import InputError, ParameterError
from ...models.names import printable
from ...models.parameters import suggestion
from ...models.records import Meta, Scores
from .protocol import Inputs, Plot, Selection
from .style import CM, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GROUP = "echoset.plots"
FORMATS = {".png": "png", ".svg": "svg", ".pdf": "pdf"}
_NAMES = {"recording": "recordings", "estimates": "estimates", "scores": "scores"}


def figure(
    kind: str,
    inputs: Inputs,
    selection: Selection | None = None,
    size: tuple[float, float] | None = None,
    estimators: Sequence[str] = (),
    grow: bool = False,
) -> Figure:
    """The picture ``kind`` of ``inputs``, of ``estimators`` or all, of ``size`` [cm] or its own.

    With ``grow`` a stack of panels may become higher than ``size``.

    Raises
    ------
    ParameterError : an unknown kind, or Matplotlib is not installed
    InputError : the inputs lack what the picture shows, or hold what it cannot show
    """
    plot: Plot = registry.load(GROUP, kind)
    _check(kind, plot, inputs)
    inputs = _only(inputs, estimators)
    _check_reach(kind, inputs)
    inputs = _with_visible_names(inputs)
    if not available():
        raise ParameterError("plots need Matplotlib: pip install 'echoset[plot]'")
    from matplotlib.figure import Figure

    with style():
        width, height = size or plot.SIZE
        made = Figure(figsize=(width * CM, height * CM), layout="constrained")
        plot.draw(made, inputs, selection or Selection())
        if size and not grow:
            made.set_size_inches(width * CM, height * CM)
    return made


def save(made: Figure, form: str, description: Mapping[str, Any]) -> bytes:
    """The picture in one of the :data:`FORMATS`, with ``description`` in its metadata."""
    text = json.dumps(description, sort_keys=True, allow_nan=False)
    metadata: dict[str, dict[str, str | None]] = {
        "png": {"Software": None, "Description": text},
        "svg": {"Creator": None, "Date": None, "Description": text},
        "pdf": {"Creator": None, "Producer": None, "CreationDate": None, "Subject": text},
    }
    file = io.BytesIO()
    with style():
        made.savefig(file, format=form, metadata=metadata[form])
    data = file.getvalue()
    return _CONTROL.sub(lambda c: b"\\x%02x" % ord(c[0]), data) if form == "svg" else data


_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0c\x0e-\x1f]")
"""Characters that XML does not have, not even escaped."""
_HEAD = re.compile(r"^.*?(?=<svg)|<metadata>.*?</metadata>|<style.*?</style>", re.DOTALL)


def inline(made: Figure, label: str) -> str:
    """The picture as an ``<svg>`` element of a page, with ``label`` as its accessible name.

    Of its identifiers only those that it refers to stay, and they are the picture's own.
    """
    text = _HEAD.sub("", save(made, "svg", {}).decode()).strip()
    used = set(re.findall(r"#([\w.-]+)", text))
    own = re.sub(r"\W+", "-", label)

    def rename(match: re.Match[str]) -> str:
        return f' id="{own}-{match[1]}"' if match[1] in used else ""

    text = re.sub(r' id="([^"]*)"', rename, text)
    text = re.sub(r"(url\(#|href=\"#)", rf"\g<1>{own}-", text)
    return text.replace("<svg ", f'<svg role="img" aria-label="{html.escape(label)}" ', 1)


def available() -> bool:
    """Whether Matplotlib is installed."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        return False
    return True


def _check(kind: str, plot: Plot, inputs: Inputs) -> None:
    given = {
        "recording": bool(inputs.recordings),
        "estimates": bool(inputs.estimates),
        "scores": inputs.scores is not None,
    }
    for what in plot.NEEDS:
        if not given[what]:
            raise InputError(f"{kind}: needs {_NAMES[what]}, which no input holds")
    for what, there in given.items():
        if there and what not in (*plot.NEEDS, *plot.USES):
            raise InputError(f"{kind}: draws no {_NAMES[what]}, but an input holds them")


def _with_visible_names(inputs: Inputs) -> Inputs:
    """The inputs with recordings whose names can be drawn."""

    def shown(meta: Meta) -> Meta:
        return replace(meta, name=printable(meta.name))

    recordings = tuple(replace(r, meta=shown(r.meta)) for r in inputs.recordings)
    estimates = tuple(replace(e, meta=shown(e.meta)) for e in inputs.estimates)
    return replace(inputs, recordings=recordings, estimates=estimates)


REACH = 1e12
"""Farthest coordinate [m] and largest score that a picture can show."""


def _check_reach(kind: str, inputs: Inputs) -> None:
    """Refuse numbers so large that the scale of an axis overflows or tells nothing apart."""
    arrays: list[Any] = [e.objects.state for e in inputs.estimates]
    for r in inputs.recordings:
        arrays += [s.position for s in r.sensors.values()]
        arrays += [r.truth.objects.state] if r.truth else []
        arrays += [
            s.rows[c] for s in r.streams.values() for c in ("x", "y", "range") if c in s.rows
        ]
    arrays += [s.value for s in (inputs.scores,) if s is not None]
    largest = max((float(np.abs(a).max(initial=0.0)) for a in arrays), default=0.0)
    if largest > REACH:
        raise InputError(f"{kind}: draws numbers up to {REACH:g}, the inputs hold {largest:g}")


def _only(inputs: Inputs, estimators: Sequence[str]) -> Inputs:
    """The inputs without other estimators than these; bounds stay."""
    if not estimators:
        return inputs
    known = {e.estimator for e in inputs.estimates}
    known |= {name for name in (inputs.scores.estimator if inputs.scores else ()) if name}
    for name in estimators:
        if name not in known:
            raise InputError(f"no input holds estimator {name!r}{suggestion(name, known)}")
    wanted = {"", *estimators}

    def kept(scores: Scores | None) -> Scores | None:
        return None if scores is None else scores.where(estimator=wanted.__contains__)

    estimates = tuple(e for e in inputs.estimates if e.estimator in wanted)
    return replace(
        inputs, estimates=estimates, scores=kept(inputs.scores), pooled=kept(inputs.pooled)
    )
