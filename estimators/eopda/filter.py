"""Particle filter for a UWB device, carried by an object or alone, among anchors.

The filter of Zhu et al., "Multi-Sensor Fusion of Active and Passive Measurements for Extended
Object Tracking": each particle carries all variables, ``y = (p, v, b_rho, b_phi, extent)``, here
with the height, and a Gaussian of what ranges have too much. What the object looks like to the
links is a :class:`~.state.Target`; :mod:`.geo`, :mod:`.ideal` and :mod:`.ap_pda` say it, and
:mod:`.position` has none.

A step is: predict motion and extent; weigh by the passive links, which see only the object;
resample; turn the device about the object by a proposal that looks at its lines of sight; weigh by
the active links; extract; resample. The start is :mod:`.cloud.start`'s; where ranges contradict the
particles for a while, or after a pause, there is another one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from math import log, sqrt

import numpy as np

from ...models.errors import EstimatorError
from ...models.motion import STEP, acceleration_variance, constant_velocity, walk_std
from ...models.records import Array
from .cloud.lost import Doubt, merge, search, surprise
from .cloud.renewal import renewed
from .cloud.resampling import effective_sample_size, log_mean, normalise, systematic
from .cloud.start import SPAN, start
from .heading import drive, first_headings, is_told, log_heading
from .kernels.compiled.bias_proposal import propose_bias
from .links import NO_LINKS, Links
from .odometry import Increment
from .params import Params
from .state import Belief, Event, Height, State, Step, Target, moments
from .weighing import excess, rates, weigh_active, weigh_differences, weigh_object

GUARD = 4.0
"""Weight of ranges that are not the line of sight in the proposal, in units of clutter."""
PAUSE = 1.0
"""A pause is so long that the motion alone widens the position by this much [m]."""
WIDE = 3
"""Times as many device positions are tried where the device has been hidden."""
FEW = 0.01
"""Share of effective particles below which a device without object is proposed from its ranges."""
LEAST_ODDS = 0.01
"""A probability of having been lost that is less than this is taken for none."""


def predict(
    state: State,
    dt: float,
    target: Target,
    params: Params,
    rng: np.random.Generator,
    height: Height,
    moved: Increment | None = None,
) -> State:
    """Move centre, extent, height and errors over ``dt`` [s]; the offset waits for :func:`turn`.

    Where odometry tells how the body ``moved``, that is how it moves; its offset turns with it.
    """
    F, G = constant_velocity(dt)
    y, n = state.y.copy(), state.y.shape[1]
    if is_told(moved) and dt > 0:
        y[:4], heading = drive(state, dt, moved, rng)
        state = replace(state, heading=heading)
        y[5] += moved.turn if params.has_object else 0.0
    else:
        acceleration = sqrt(acceleration_variance(params.acceleration_std, dt))
        y[:4] = F @ y[:4] + G @ (acceleration * rng.normal(size=(2, n)))
        if len(state.heading):
            wander = params.heading_walk * sqrt(dt) * rng.normal(size=n)
            state = replace(state, heading=state.heading + wander)
    noise = rng.normal(size=(len(target.extent), n))
    y[6:-1] = np.abs(y[6:-1] + walk_std(target.walk(params)[:, None], dt) * noise)
    if not height.is_known:
        y[-1] = height.fold(y[-1] + params.height_walk * sqrt(dt) * rng.normal(size=n))
    covariance = state.covariance
    if covariance.shape[1] and params.range_bias_std > 0:
        k = np.arange(1, covariance.shape[1])
        covariance = covariance.copy()
        covariance[:, k, k] += params.range_bias_walk**2 * dt
    return replace(state, y=y, covariance=covariance, hidden=state.hidden + dt)


def turn(
    state: State, anchors: Array, links: Links, params: Params, rng: np.random.Generator
) -> tuple[State, float]:
    """Move the offset by the random walk of all the time it was hidden, with an eye on ``links``.

    What no line of sight has shown cannot have been told apart either: the walks of the steps add
    up, and a length that is reflected at zero in each step has the law of one that is reflected at
    the end. See :mod:`echoset.estimators.eopda.kernels.bias_proposal`; without links it is the
    random walk. The second value is the log of what the weights gain on average.
    """
    if not params.has_object:
        return state, 0.0
    n, hidden = state.y.shape[1], state.hidden
    tries = 1
    if not links.empty:
        tries = params.candidates * (WIDE if state.hidden > 5 * STEP else 1)
    further, round_ = (
        walk_std(std, hidden) * rng.normal(size=(tries, n))
        for std in (params.bias_distance_std, params.bias_angle_std)
    )
    length, angle = np.abs(state.y[4] + further), state.y[5] + round_
    floor, pick = GUARD * params.clutter, rng.random(n)
    y = state.y.copy()
    y[4], y[5], correction = propose_bias(
        y[:2],
        y[-1],
        length,
        angle,
        pick,
        anchors,
        *links[1:],
        *excess(state, anchors, links),
        floor,
        params.los,
    )
    return _weighed(replace(state, y=y, hidden=0.0), correction)


def shown(state: State, params: Params, rng: np.random.Generator) -> State:
    """The state with the walk of a hidden offset drawn, of each copy of a particle by itself.

    What passive links leave may be a few heavy particles, whose own draws would not be its mean.
    """
    index = systematic(state.w, rng.random(), len(state.w))
    return turn(take(state, index), np.zeros((1, 3)), NO_LINKS, params, rng)[0]


def reduce(state: State, rng: np.random.Generator) -> State:
    """Resample where less than half of the particles are effective."""
    n = len(state.w)
    if effective_sample_size(state.w) >= n / 2:
        return state
    return take(state, systematic(state.w, rng.random(), n))


def take(state: State, index: Array) -> State:
    """The particles at ``index`` (N,), with equal weights."""
    w = np.full(len(index), 1 / len(index))
    return replace(
        state,
        y=state.y[:, index],
        w=w,
        mean=state.mean[index],
        covariance=state.covariance[index],
        heading=state.heading[index] if len(state.heading) else state.heading,
    )


def track(
    events: Iterable[Event],
    target: Target,
    params: Params,
    first: Belief,
    rng: np.random.Generator,
    name: str,
) -> Iterator[Step]:
    """The filter over all events: at each its state and evidence; ``first`` is believed at first.

    Raises
    ------
    EstimatorError : all weights vanish, or one is not a number
    """
    state: State | None = None
    window: list[Event] = []
    doubt, before, last = Doubt(), first, 0
    for event in events:
        dt = (event.time_ns - last) * 1e-9
        if state is not None and widens(dt, params) > PAUSE:
            before, state = remembered(state, dt, first, params), None
        try:
            if state is None:
                if not window or event.time_ns - window[0].time_ns <= SPAN * 1e9:
                    window.append(event)
                    if not _is_enough(window):
                        continue
                    steps = _begin(window, target, params, before, rng)
                else:
                    steps = _begin(window, target, params, before, rng)
                yield from steps
                state, last = steps[-1].state, window[-1].time_ns
                doubt = Doubt(since=window[0].time_ns - 1)
                if window[-1] is event:
                    window = []
                    continue
                window = []
                dt = (event.time_ns - last) * 1e-9
                if widens(dt, params) > PAUSE:
                    before, state, window = remembered(state, dt, first, params), None, [event]
                    continue
            step, less = _step(state, event, dt, target, params, first, rng)
            doubt = doubt.after(event, step.evidence, less)
            if doubt.is_alarm:
                fresh, odds = search(doubt, target, params, first, rng)
                if odds > LEAST_ODDS:
                    # lost or not is left to the ranges to come
                    both = merge(step.state, fresh, odds, rng)
                    step = step._replace(state=both, anew=True, lost=doubt.since)
                doubt = doubt.found(odds)
            yield step
            state, last = reduce(step.state, rng), event.time_ns
            if state is not step.state and not params.has_object:
                state = renewed(state, event, first.height.low, rng)
        except EstimatorError as error:
            raise EstimatorError(f"{name}: at {event.time_ns * 1e-9:g} s: {error}") from None
    if window:
        yield from _begin(window, target, params, before, rng)


def _begin(
    window: list[Event],
    target: Target,
    params: Params,
    before: Belief,
    rng: np.random.Generator,
) -> list[Step]:
    """The steps of a window from which the filter starts; its evidence goes to the last."""
    states, evidence = start(window, target, params, before, rng)
    heading = first_headings([event.moved for event in window], len(states[-1].w), rng)
    steps = []
    for event, state in zip(window, states, strict=True):
        state = replace(state, heading=heading)
        own = evidence if event is window[-1] else 0.0
        clutter, until = _clutter(event, params), window[-1].time_ns
        steps.append(Step(event.time_ns, state, own, clutter, False, until, event.moved))
    expected = sum(rates(event, params) for event in window)
    last = steps[-1]
    gain = evidence - expected - sum(step.gain for step in steps)
    steps = [step._replace(gain=0.0) for step in steps]
    steps[-1] = last._replace(evidence=evidence - expected, gain=gain)
    return steps


def _step(
    state: State,
    event: Event,
    dt: float,
    target: Target,
    params: Params,
    first: Belief,
    rng: np.random.Generator,
) -> tuple[Step, float]:
    """The step of one event, and by how much its lines of sight surprise."""
    old = state
    state = predict(state, dt, target, params, rng, first.height, event.moved)
    evidence, less = -rates(event, params), 0.0
    if event.moved is not None and np.isfinite(event.moved.heading):
        state, gained = _weighed(state, log_heading(state, event.moved))
        evidence += gained
    if not event.passive.empty:
        log_l = weigh_object(state, event.anchors, event.passive, target, params)
        state, gained = _weighed(state, log_l)
        evidence += gained
        state = state if event.active.empty else reduce(state, rng)
    if not event.active.empty:
        state, gained = turn(state, event.anchors, event.active, params, rng)
        evidence += gained
        less = surprise(state, event._replace(differences=NO_LINKS), params)
        log_l, learnt = weigh_active(state, event.anchors, event.active, target, params)
        state, gained = _weighed(learnt, log_l)
        evidence += gained
    if not event.differences.empty:
        if event.active.empty:
            state, _ = turn(state, event.anchors, event.active, params, rng)
        less += surprise(state, event._replace(active=NO_LINKS), params)
        log_l, learnt = weigh_differences(state, event.anchors, event.differences, params)
        state, gained = _weighed(learnt, log_l)
        evidence += gained
    seen = not (event.active.empty and event.differences.empty)
    few = effective_sample_size(state.w) < FEW * len(state.w)
    if seen and few and not params.has_object:
        before = remembered(old, dt, first, params)
        states, evidence = start([event], target, params, before, rng)
        evidence -= rates(event, params)
        state = replace(states[-1], heading=state.heading)
    gain, now = evidence - _clutter(event, params), event.time_ns
    return Step(now, state, evidence, gain, False, now, event.moved), less


def _weighed(state: State, log_factor: Array) -> tuple[State, float]:
    """The state with its weights times a factor, and the log of the factor's mean."""
    with np.errstate(divide="ignore"):
        log_w = np.log(state.w) + log_factor
    w = normalise(log_w)
    return replace(state, w=w), log_mean(state.w, log_factor)


def _clutter(event: Event, params: Params) -> float:
    """Log-likelihood of an event's ranges if all were clutter."""
    kinds = (event.active, event.passive, event.differences)
    n, links = sum(len(own.z) for own in kinds), sum(len(own.tx) for own in kinds)
    return n * log(params.clutter) - links * params.clutter * float(params.max_range or 0.0)


def widens(dt: float, params: Params) -> float:
    """Standard deviation [m] that a position gains over ``dt`` [s] by the motion's noise."""
    return params.acceleration_std * sqrt(STEP * dt**3 / 3)


def _is_enough(window: list[Event]) -> bool:
    """Whether anchors that were heard, or all that there are, fix a position."""
    event = window[-1]
    if not event.passive.empty:
        return True
    heard = sorted(
        {int(j) for e in window for j in (*e.active.rx, *e.differences.rx, *e.differences.tx)}
    )
    if len(heard) == len(event.anchors):
        return True
    p = event.anchors[heard, :2]
    if len(heard) < 3:
        return False
    size = np.linalg.svd(p - p.mean(0), compute_uv=False)
    return bool(size[1] > 0.1 * size[0])


def remembered(state: State, dt: float, first: Belief, params: Params) -> Belief:
    """What is believed ``dt`` [s] after ``state``, as moments; never less than at first."""
    w, y = state.w, state.y
    height = first.height
    if not height.is_known:
        mean = float(y[-1] @ w)
        variance = float(w @ (y[-1] - mean) ** 2) + params.height_walk**2 * dt
        if not variance > height.std**2:
            height = replace(height, mean=mean, std=max(sqrt(variance), 1e-3))
    bias, P, alternative = first.mean, first.covariance, first.alternative
    if len(bias):
        own = w @ state.mean
        d = state.mean - own
        now: Array = np.tensordot(w, state.covariance, 1) + (w * d.T) @ d
        if params.range_bias_std > 0:
            k = np.arange(1, len(own))
            now[k, k] += params.range_bias_walk**2 * dt
        if (np.diag(now)[1:] <= np.diag(P)[1:] + 1e-12).all():
            bias, P, alternative = own, now, None
    motion = moments(state, dt, params)
    wide = sqrt(motion[1][:2, :2].trace()) > 2 * float(params.max_range or np.inf)
    carried = None
    if params.has_object:
        walk = np.array([params.bias_distance_std, params.bias_angle_std])
        others = y[4:-1]
        middle, apart = others @ w, np.sqrt(((others - (others @ w)[:, None]) ** 2) @ w)
        angle = np.exp(1j * y[5]) @ w
        middle[1], apart[1] = np.angle(angle), sqrt(-2 * log(min(max(abs(angle), 1e-9), 1.0)))
        total = state.hidden + dt
        apart[:2] = np.hypot(apart[:2], walk * sqrt(total / STEP))
        carried = middle, np.maximum(apart, 1e-3)
    return Belief(height, bias, P, None if wide else motion, carried, alternative)
