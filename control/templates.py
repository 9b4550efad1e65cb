"""What bodies reflect, learnt from maps with truth: the templates of track-before-detect.

The sizes and cross sections for which the maps are most likely, given where the objects truly are
(:mod:`echoset.estimators.maps.tbd`). What is learnt is told on recordings apart from those learnt
from.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.optimize import minimize

from ..estimators.maps.choice import Choice
from ..estimators.maps.params import MAPS
from ..estimators.maps.tbd import filter as tbd
from ..estimators.maps.tbd.params import BodyParams
from ..estimators.maps.tbd.scene import Layout, View
from ..estimators.maps.tbd.targets import DIM, ORDER
from ..models.classifier import CLASSES
from ..models.errors import InputError
from ..models.parameters import parameter
from ..models.records import Array, Recording

LEARNT = "vehicle_length", "vehicle_width", "rcs_pedestrian", "rcs_surface", "rcs_corner"


@dataclass(frozen=True, slots=True)
class Params:
    """How much to learn from."""

    scans: int = parameter(20, "1", "scans of a recording, spread over its time", within="[1, inf)")
    held_out: float = parameter(
        0.25, "1", "share of the recordings, the last ones, that the result is tried on",
        within="[0, 1)",
    )  # fmt: skip
    trials: int = parameter(600, "1", "most evaluations of the likelihood", within="[10, inf)")


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Maps of one time, and the classes (n,) and states (n, 7) of what is there."""

    view: View
    kinds: Array
    vectors: Array


@dataclass(frozen=True, slots=True, eq=False)
class Learnt:
    """Parameters by name, and how much likelier a scan is by them than by those stated.

    ``gain`` [nats, of independent cells] is that of ``tried`` recordings apart, NaN without any.
    """

    values: Mapping[str, float]
    gain: float
    learnt_from: tuple[str, ...]
    tried_on: tuple[str, ...]


def seen(recording: Recording, scans: int) -> list[Seen]:
    """Maps and truth of as many ``scans``, spread over the recording.

    Raises
    ------
    InputError : no truth with classes and headings; a stream that does not state its waveform
    """
    o = None if recording.truth is None else recording.truth.objects
    if o is None or o.class_index is None or o.rotation is None or o.rotation.ndim != 1:
        raise InputError("no truth with classes and headings to learn templates from")
    own = [o.class_names.index(c) if c in o.class_names else -1 for c in CLASSES]
    setup, given = recording.setup(), tbd.Params()
    choice = Choice.of(setup, given)
    if not choice.used:
        raise InputError(f"no stream of the kind {MAPS}")
    layout = Layout.of(setup, choice.used, given)
    index = {t: k for k, t in enumerate(o.time_ns.tolist())}
    chosen = set(o.time_ns[np.unique(np.linspace(0, len(o.time_ns) - 1, scans).astype(int))])
    state = o.columns("x", "y", "vx", "vy")
    found = []
    for t, together in groupby(recording.scans(), key=lambda s: s.time_ns):
        maps = [s for s in together if s.stream in choice.used]
        if t not in chosen or not maps:
            continue
        rows = slice(o.row_offset[index[t]], o.row_offset[index[t] + 1])
        kinds = np.array([own.index(c) for c in o.class_index[rows].tolist()], np.int64)
        x = np.zeros((len(kinds), 7))
        x[:, :4], x[:, 4], x[:, 5] = state[rows], o.rotation[rows], DIM
        vectors = x[:, ORDER]
        found.append(Seen(View.of(layout, maps, setup).shown(kinds, vectors), kinds, vectors))
    return found


def likelihood(moments: Iterable[Seen], bodies: BodyParams) -> float:
    """Log-likelihood of the maps, in independent cells."""
    given, total = tbd.Params(), 0.0
    for s in moments:
        view = replace(s.view, layout=replace(s.view.layout, bodies=bodies.bodies))
        total += view.log_likelihood(view.mean(s.kinds, s.vectors), given.shape)
    return given.weight * total


def learn(recordings: Sequence[Recording], params: Params) -> Learnt:
    """The bodies for which the maps of the ``recordings`` are most likely.

    Raises
    ------
    InputError : see :func:`seen`
    """
    apart = min(int(np.ceil(params.held_out * len(recordings))), len(recordings) - 1)
    some, others = recordings[: len(recordings) - apart], recordings[len(recordings) - apart :]
    moments = [s for r in some for s in seen(r, params.scans)]
    stated = BodyParams()
    start = np.log([getattr(stated, name) for name in LEARNT])

    def bodies(x: Array) -> BodyParams:
        return replace(stated, **dict(zip(LEARNT, np.exp(x).tolist(), strict=True)))

    simplex = start + np.vstack((np.zeros(len(start)), 0.3 * np.eye(len(start))))
    found = minimize(
        lambda x: -likelihood(moments, bodies(x)),
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": simplex, "xatol": 5e-3, "fatol": 0.1, "maxfev": params.trials,
        },
    )  # fmt: skip
    best, gain = bodies(found.x), float("nan")
    if others:
        tried = [s for r in others for s in seen(r, params.scans)]
        gain = (likelihood(tried, best) - likelihood(tried, stated)) / len(tried)
    names = [tuple(r.meta.name for r in group) for group in (some, others)]
    return Learnt({name: float(f"{getattr(best, name):.4g}") for name in LEARNT}, gain, *names)
