"""Interacting multiple models against matrix exponentials, the Kalman filter and enumeration."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import multivariate_normal

from echoset.estimators.points import mbm, phd, pmb
from echoset.estimators.points.context import Context
from echoset.estimators.points.kernels.modes import Modes
from echoset.estimators.points.modes import ModeParams, initial, transitions
from echoset.models.errors import ParameterError
from echoset.models.motion import constant_velocity, coordinated_turn, white_acceleration
from echoset.models.parameters import resolve

BIRTH = (1.0, 50.0, 50.0, 3.0, -1.0, 3.0, 3.0, 1.0, 1.0)
BASE = {
    "p_detect": 1.0,
    "clutter_rate": 0.0,
    "clutter_region": (-500.0, 500.0, -500.0, 500.0),
    "std_position": 1.0,
    "p_survive": 1.0,
    "birth": "components",
    "birth_components": (BIRTH,),
    "acceleration_density": 0.1,
    "gate": 1e9,
    "min_existence": 1e-300,
}
H = np.eye(2, 4)
OWN = {pmb: {}, mbm: {}, phd: {"prune_weight": 1e-20, "extract_weight": 0.2}}
FILTERS = pytest.mark.parametrize("own", list(OWN), ids=lambda own: own.__name__.split(".")[-1])


@pytest.mark.parametrize("rate", [0.0, 1e-9, 0.3, -2.0])
def test_a_coordinated_turn_is_the_exponential_of_its_equation(rate):
    A = np.zeros((4, 4))
    A[:2, 2:] = np.eye(2)
    A[2:, 2:] = rate * np.array([[0, -1], [1, 0]])
    np.testing.assert_allclose(coordinated_turn(0.7, rate), expm(0.7 * A), atol=1e-14)
    np.testing.assert_allclose(coordinated_turn(0.7, 0.0), constant_velocity(0.7)[0])


def test_modes_are_a_chain_in_time():
    params = ModeParams(motion="imm", manoeuvre_rate=0.05, manoeuvre_time=8.0)
    _, _, two = transitions(params, 2.0)
    _, _, one = transitions(params, 1.0)
    np.testing.assert_allclose(one @ one, two, atol=1e-14)
    np.testing.assert_allclose(two.sum(1), 1.0)
    # Detailed balance: as many begin as end.
    start = initial(params)
    np.testing.assert_allclose(start @ two, start, atol=1e-14)
    assert start[1:].sum() / start[0] == pytest.approx(0.4)
    assert ModeParams().modes == 1 and ModeParams(motion="imm").modes == 4


def known(own, changes):
    """Those of the changes that are parameters of the filter, and its own."""
    return {k: v for k, v in (changes | OWN[own]).items() if hasattr(own.Params, k)}


def sequences(Z, params):
    """All mode sequences: probability given the positions Z, and moments after the last."""
    F, Q, Pi = transitions(params, 1.0)
    F = np.concatenate((constant_velocity(1.0)[0][None], F))
    Q = np.concatenate((0.1 * white_acceleration(1.0)[None], Q))
    M, start = len(F), initial(params)
    for modes in product(range(M), repeat=len(Z)):
        m, P, weight = np.array(BIRTH[1:5]), np.diag(np.square(BIRTH[5:])), start[modes[0]]
        for k, z in enumerate(Z):
            if k:
                weight *= Pi[modes[k - 1], modes[k]]
                m, P = F[modes[k]] @ m, F[modes[k]] @ P @ F[modes[k]].T + Q[modes[k]]
            S = H @ P @ H.T + np.eye(2)
            weight *= multivariate_normal.pdf(z, H @ m, S)
            K = P @ H.T @ np.linalg.inv(S)
            m, P = m + K @ (z - H @ m), P - K @ S @ K.T
        yield modes, weight, m, P


def filtered(own, recording, params):
    """The best track after every scan, without births after the first."""
    context = Context.of(recording.setup(), params)
    later = replace(context.params, birth_components=())
    state = pmb.init(params) if own is pmb else own.init(params.width, initial(params))
    for scan in recording.scans():
        state, _ = own.step(state, [scan], context)
        context = replace(context, params=later, sensing={"radar": later})
        if own is pmb:
            x = state.tracks
            yield x.take(x.r.argmax()[None])
        elif own is mbm:
            x = state.mixture
            yield x.local.take(x.table[0, [x.existence()[0].argmax()]])
        else:
            yield state.mixture.take(state.mixture.w.argmax()[None])


def turning(rng, steps):
    x = np.array(BIRTH[1:5])
    for k in range(steps):
        yield x[:2] + rng.normal(size=2)
        x = coordinated_turn(1.0, 0.5 if k else 0.0) @ x


SLOW = {"manoeuvre_rate": 1e-13, "manoeuvre_time": 1e13}


@pytest.mark.parametrize(
    ("chain", "near"),
    [
        (SLOW, 1e-8),
        ({"manoeuvre_rate": 0.1, "manoeuvre_time": 5.0}, 0.05),
        ({"manoeuvre_rate": 0.02, "manoeuvre_time": 20.0}, 0.05),
    ],
)
@FILTERS
def test_four_steps_by_enumeration_of_mode_sequences(make_recording, own, chain, near):
    """Exact where modes do not change; else the modes are merged at each step, and near."""
    for seed in range(3):
        Z = list(turning(np.random.default_rng(seed), 4))
        base = known(own, BASE)
        params = own.Params(**base, motion="imm", manoeuvres=((0.5, 0.1), (-0.5, 1.0)), **chain)
        *_, found = filtered(own, make_recording([z[None] for z in Z]), params)
        every = list(sequences(Z, params))
        w = np.array([weight for _, weight, _, _ in every])
        w /= w.sum()
        mean = w @ np.array([m for *_, m, _ in every])
        last = np.bincount([modes[-1] for modes, *_ in every], w, 3)
        spread = sum(
            q * (P + np.outer(m - mean, m - mean)) for q, (_, _, m, P) in zip(w, every, strict=True)
        )
        std = np.sqrt(np.diag(spread))
        assert found.modes is not None
        np.testing.assert_allclose(found.modes.w[0], last, atol=near)
        np.testing.assert_allclose(found.m[0] / std, mean / std, atol=3 * near)
        np.testing.assert_allclose(np.diag(found.P[0]) / std**2, 1.0, atol=6 * near)


@FILTERS
@pytest.mark.parametrize("smooth", ["none", "3s", "whole"])
def test_alike_modes_are_one(make_recording, own, smooth):
    """Modes that all are the nearly constant velocity: the Kalman filter, and the smoother."""
    rng = np.random.default_rng(4)
    Z = [np.vstack((z[None], rng.uniform(0, 100, (2, 2)))) for z in turning(rng, 8)]
    changes = {**BASE, "p_detect": 0.9, "clutter_rate": 2.0, "p_survive": 0.99, "gate": 20.0}
    one = own.Params(**known(own, changes), smooth=smooth, extract_smoothed=0.5)
    many = replace(one, motion="imm", manoeuvres=((0.0, 0.1), (0.0, 0.1)))
    none = replace(one, motion="imm", manoeuvres=())
    recording = make_recording(Z)
    a, b, c = (
        list(own.estimate(recording.setup(), recording.scans(), params, None))
        for params in (one, many, none)
    )
    assert sum(len(x.objects.label) for x in a) > 5
    for x, y, z in zip(a, b, c, strict=True):
        np.testing.assert_allclose(x.objects.state, y.objects.state, atol=1e-7)
        np.testing.assert_allclose(x.objects.covariance, y.objects.covariance, atol=1e-7)
        np.testing.assert_array_equal(x.objects.state, z.objects.state)


def test_a_step_keeps_the_moments_of_all_modes_before_and_after():
    """Mean, covariance and cross-covariance of a target's states, by drawing them."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(1, 2, 4, 4))
    modes = Modes(np.array([[0.3, 0.7]]), rng.normal(size=(1, 2, 4)), A @ A.swapaxes(2, 3))
    F = np.stack((constant_velocity(1.0)[0], coordinated_turn(1.0, 0.8)))
    Q = np.stack((0.1 * np.eye(4), 0.5 * np.eye(4)))
    Pi = np.array([[0.8, 0.2], [0.4, 0.6]])
    after, cross = modes.predict(F, Q, Pi)
    n = 200_000
    i = (rng.random(n) < 0.7).astype(int)
    x = modes.m[0, i] + np.einsum("nab,nb->na", A[0, i], rng.normal(size=(n, 4)))
    j = (rng.random(n) < Pi[i, 1]).astype(int)
    noise = rng.normal(size=(n, 4)) * np.sqrt(np.diagonal(Q[j], axis1=1, axis2=2))
    y = np.einsum("nab,nb->na", F[j], x) + noise
    joint = np.cov(np.hstack((x, y)).T)
    m, P = after.together()
    close = 4.5 * np.abs(joint).max() * np.sqrt(3 / n)
    np.testing.assert_allclose(m[0], y.mean(0), atol=4.5 * np.sqrt(joint.max() / n))
    np.testing.assert_allclose(P[0], joint[4:, 4:], atol=close)
    np.testing.assert_allclose(cross[0], joint[:4, 4:], atol=close)
    assert after.w[0, 1] == pytest.approx(0.3 * 0.2 + 0.7 * 0.6)


def test_what_is_no_manoeuvre():
    for wrong in ({"manoeuvres": [[0.1]]}, {"manoeuvres": [[0.1, -1.0]]}, {"manoeuvre_rate": 0}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            resolve(ModeParams, ("here", wrong))
