"""The filter as an estimator: from a recording's link events to estimates."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.records import Estimates, Meta, Recording, Scan
from ..kernels.passes import smoothed
from .cloud.resampling import systematic
from .cloud.start import MARGIN, SPAN
from .extract import extract
from .filter import shown, track
from .learn import learn, with_noise
from .links import NO_LINKS, Network, link_steps, network
from .odometry import Odometer, odometry_of
from .smoothing import Record, record, smoother
from .spacing import spaced
from .state import Belief, Event, Step, Target, belief

_log = logging.getLogger(__name__)
PATIENCE = 5.0
"""Longest time [s] that an event waits for odometry."""


@dataclass(frozen=True, slots=True)
class DeviceFilter:
    """An estimator: the filter for a ``target``, with or without the passive links."""

    SUMMARY: str
    Params: type[Any]
    target: Target
    passive: bool = True
    STREAMS: tuple[str, ...] = ("uwb", "odometry")
    PRESETS: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def estimate(
        self, setup: Recording, scans: Iterable[Scan], params: Any, rng: np.random.Generator
    ) -> Iterator[Estimates]:
        """Yield the estimate of each time at which the network has a link event.

        What is assumed or learnt before stands in the provenance of the first.
        """
        net = network(
            setup,
            params.device,
            params.rms_bandwidth,
            params.amplitude_threshold,
            params.sigma,
            params.sigma_factor,
            params.range_bias,
        )
        events = _events(net, scans, self.passive, odometry_of(setup, params.device), params)
        look_ahead = SPAN if params.max_range is None else 0.0
        head, events = _head(events, params.learn_span if params.learn else look_ahead)
        if not head:
            return
        _refuse_excluded(net, head, params)
        found: dict[str, Any] = {}
        if params.max_range is None:
            found["max_range"] = _reach(head)
            params = replace(params, max_range=found["max_range"])
        _warn_of_geometry(net, head[0], params)
        if params.learn:
            params, learnt = learn(net, head, self.target, params, rng)
            found |= learnt
            factor = params.sigma_factor
            events = (with_noise(event, factor / net.sigma_factor) for event in events)
        events = spaced(events, params.noise_time)
        if found:
            said = ", ".join(f"{key} {value}" for key, value in found.items())
            _log.info("%s: %s", net.name, said)
        first = belief(net, params)
        about = Meta("", provenance={"found": found} if found else {})
        forward = self._forward(events, about, params, first, net.name, rng)
        # draws of its own, so that the filter is the same with and without
        backward = smoother(self.target, params, first, rng.spawn(1)[0])
        yield from smoothed(forward, backward, params.wait)

    def _forward(
        self,
        events: Iterable[Event],
        about: Meta,
        params: Any,
        first: Belief,
        name: str,
        rng: np.random.Generator,
    ) -> Iterator[tuple[Estimates, Record | None]]:
        """The filter's estimates and, to be smoothed, what the way back needs."""
        said_lost = False
        for step in track(events, self.target, params, first, rng, name):
            if step.anew and not said_lost:
                said_lost = True
                _log.warning(
                    "%s: at %.2f s ranges contradict the position, which is sought anew; "
                    "'sought_anew' in the estimates says each time",
                    name,
                    step.time_ns * 1e-9,
                )
            kept = None if params.wait is None else record(step, self.target, params)
            yield replace(self._shown(step, params, first.height.is_known, rng), meta=about), kept

    def _shown(self, step: Step, params: Any, known: bool, rng: np.random.Generator) -> Estimates:
        """The estimate of a step; an offset that is hidden is drawn for it, and not kept."""
        state = step.state
        if params.has_object and state.hidden > 0:
            state = shown(state, params, rng)
        out = extract(state, step.time_ns, self.target, params, known)
        more = {"evidence": np.array([step.gain]), "sought_anew": np.array([float(step.anew)])}
        if params.keep:
            drawn = systematic(state.w, 0.5, params.keep)
            more["device_samples"] = state.device[:, drawn].T[None]
        return replace(out, steps={**out.steps, **more})


def _events(
    net: Network, scans: Iterable[Scan], passive: bool, odometry: str | None, params: Any
) -> Iterator[Event]:
    """The events in order; those that odometry is to tell of wait for it."""
    odometer, waiting = Odometer(params), deque[Event]()

    def listen() -> Iterator[Scan]:
        for scan in scans:
            if scan.stream == odometry:
                odometer.take([scan])
            else:
                yield scan

    for time_ns, (active, heard, differences) in link_steps(net, listen()):
        heard = heard if passive else NO_LINKS
        own = Event(time_ns, net.anchors(time_ns), active, heard, differences=differences)
        if odometry is None:
            yield own
            continue
        waiting.append(own)
        while waiting and max(odometer.seen, time_ns - PATIENCE * 1e9) >= waiting[0].time_ns:
            yield _told(waiting.popleft(), odometer)
    yield from (_told(event, odometer) for event in waiting)


def _told(event: Event, odometer: Odometer) -> Event:
    return event._replace(moved=odometer.until(event.time_ns))


def _head(events: Iterator[Event], span: float) -> tuple[list[Event], Iterator[Event]]:
    """The events of the first ``span`` [s], and all events."""
    head: list[Event] = []
    for event in events:
        head.append(event)
        if event.time_ns - head[0].time_ns >= span * 1e9:
            break
    return head, chain(head, events)


def _refuse_excluded(net: Network, head: list[Event], params: Any) -> None:
    """An offset by which most ranges would be shorter than nothing excludes the data."""
    z = np.concatenate([event.active.z for event in head])
    if len(z) and np.median(z) + 3 * params.range_bias_std < 0:
        raise InputError(
            f"{net.name}: range_bias {params.range_bias:g} m is more than half of the first "
            f"{len(z)} ranges measure: lower it, or raise range_bias_std"
        )


def _reach(head: list[Event]) -> float:
    """The largest range of the first events, and a margin [m].

    Differences do not tell it: it is then the widest distance of two anchors.
    """
    most = max(float(links.z.max(initial=0.0)) for e in head for links in e[2:4])
    if most == 0.0 and any(not e.differences.empty for e in head):
        a = head[0].anchors
        most = float(np.linalg.norm(a[:, None] - a, axis=-1).max())
    return max(round(MARGIN * most, 2), 0.01)


def _warn_of_geometry(net: Network, event: Event, params: Any) -> None:
    """Say once what anchors cannot tell, and what is assumed of heights."""
    if len(net.sensors) == 1:
        _log.warning("%s: one anchor: the position is a ring about it", net.name)
    elif len(net.sensors) == 2:
        _log.warning("%s: two anchors: the position has a mirror image", net.name)
    if net.has_heights and params.device_height is None:
        high = event.anchors[:, 2].max()
        _log.warning(
            "%s: the anchors have heights, and 'device_height' is not told: it is estimated, "
            "between the floor and %.2f m",
            net.name,
            high,
        )
