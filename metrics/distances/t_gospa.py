"""Trajectory GOSPA metric between sets of tracks over the whole recording.

Every true and estimated track, by label, is paired with at most one of the other side at each step,
and changing the pairs costs. With weights W(i, j, k) in [0, 1] that pair true track i with
estimated track j at step k, at most 1 for each track and step::

    T-GOSPA^p = min over W of sum over k of  sum over pairs of d^p W
                + c^p / 2 (missed + false) + gamma^p / 2 sum over i, j of |W(k) - W(k - 1)|

which is the linear-programming metric of A. F. Garcia-Fernandez, A. S. Rahmathullah and
L. Svensson, "A metric on the space of finite sets of trajectories for evaluation of multi-target
tracking algorithms", IEEE Trans. Signal Process. 68 (2020) 3917-3928, eq. (23). A pair in which
only one track is there, or which is c or more apart, counts as missed and false. Parts are
``localisation``, ``missed``, ``false`` and ``switch``; a switch belongs to the later of its two
steps. The aggregate is the p-th root of the mean of the p-th powers over the steps.

A pair can only gain where it is nearer than c. So tracks that are never that near to each other
solve problems of their own, and steps at which nothing in a problem gains drop out of it: from one
side of such a gap to the other the weights change at no more than their difference.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.optimize import linprog
from scipy.sparse.csgraph import connected_components

from ...models.errors import EchosetError
from ...models.parameters import parameter
from ...models.records import Array, Scores
from ..kit.measured import Measured, Names
from ..kit.series import Distance, mean_stderr
from ..kit.table import rows
from ..protocol import Metric
from .ospa2 import measure

PARTS = ("localisation", "missed", "false", "switch")


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, with which order, cut-off and cost of a switch."""

    order: float = parameter(1.0, "1", "order p: how much outliers weigh", within="[1, inf)")
    switch: float = parameter(
        2.0, "m", "gamma: half its p-th power for each pair begun or given up", within="(0, inf)"
    )


def t_gospa(measured: Measured, order: float, cutoff: float, switch: float) -> dict[str, Array]:
    """p-th powers (n,) of T-GOSPA at each step, called ``""``, and of its parts, which add up.

    ``measured`` is that of :func:`.ospa2.measure` with the same order and cut-off.
    """
    n, lists = len(measured), measured.lists
    step = np.repeat(np.arange(n), measured.values["pairs"])
    ends = [
        np.searchsorted(np.unique(lists[side]), lists[end])
        for side, end in (("true", "first"), ("estimated", "second"))
    ]
    pairs, pair = np.unique(np.stack(ends), axis=1, return_inverse=True)
    pair = pair.ravel()
    size = pairs.max(axis=1, initial=-1) + 1
    graph = sparse.coo_array(
        (np.ones(pairs.shape[1]), (pairs[0], size[0] + pairs[1])), shape=(size.sum(),) * 2
    )
    problem = connected_components(graph, directed=False)[1][pairs[0]]
    gain = cutoff**order - lists["power"]
    w, moved = np.ones(len(pair)), np.zeros(n)
    own = problem[pair]
    by_problem = np.argsort(own, kind="stable")
    for near in np.split(by_problem, np.flatnonzero(np.diff(own[by_problem])) + 1):
        those, column = np.unique(pair[near], return_inverse=True)
        if len(those) < 2:
            continue
        used, row = np.unique(step[near], return_inverse=True)
        gains = np.zeros((len(used), len(those)))
        gains[row, column] = gain[near]
        weight = _weights(gains, pairs[:, those], switch**order / 2)
        w[near] = weight[row, column]
        moved[used[1:]] += np.abs(np.diff(weight, axis=0)).sum(1)
    found = np.bincount(step, w, n)
    half = cutoff**order / 2
    powers = {
        "localisation": np.bincount(step, w * lists["power"], n),
        "missed": half * (measured.values["true"] - found),
        "false": half * (measured.values["estimated"] - found),
        "switch": switch**order / 2 * moved,
    }
    return {"": sum(powers.values(), np.zeros(n)), **powers}


def _weights(gain: Array, ends: Array, cost: float) -> Array:
    """Weights (S, K) of K pairs with the ``ends`` (2, K) at S steps, best for what they ``gain``.

    They maximise the sum of weight times ``gain`` (S, K) less ``cost`` times all their changes.

    Raises
    ------
    EchosetError : the linear programme was not solved
    """
    S, K = gain.shape
    member = np.concatenate([side == np.unique(side)[:, None] for side in ends])
    contested = sparse.csr_array(member[member.sum(1) > 1].astype(float))
    most = sparse.kron(sparse.eye_array(S), contested, format="csr")
    none = sparse.csr_array((most.shape[0], 2 * (S - 1) * K))
    change = sparse.diags_array([-np.ones(S - 1), np.ones(S - 1)], offsets=(0, 1), shape=(S - 1, S))
    one = sparse.eye_array((S - 1) * K)
    by = sparse.hstack((sparse.kron(change, sparse.eye_array(K)), -one, one), format="csr")
    solved = linprog(
        np.concatenate((-gain.ravel(), np.full(2 * (S - 1) * K, cost))),
        A_ub=sparse.hstack((most, none), format="csr"),
        b_ub=np.ones(most.shape[0]),
        A_eq=by,
        b_eq=np.zeros((S - 1) * K),
        bounds=(0, 1),
        method="highs",
    )
    if not solved.success:
        raise EchosetError(f"t-gospa: {solved.message}")
    return np.asarray(np.clip(solved.x[: S * K].reshape(S, K), 0.0, 1.0))


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """T-GOSPA [m] and its parts per step and over all, and the number of steps left out."""
    p, n = params.order, len(measured)
    tables = []
    for part, powers in t_gospa(measured, p, params.cutoff, params.switch).items():
        key, mean = (*names, "t-gospa", part), powers.mean()
        spread = mean_stderr(powers, params.block) / p
        spread *= mean ** (1 / p - 1) if mean > 0 else np.nan
        tables.append(rows(key, measured.time, powers ** (1 / p)))
        tables.append(rows(key, np.nan, mean ** (1 / p), n, spread))
    left_out = (*names, "t-gospa-left-out", "")
    tables.append(rows(left_out, np.nan, measured.left_out, n + measured.left_out))
    return Scores.join(tables)


METRIC = Metric(
    "T-GOSPA distance between estimated and true tracks over the whole recording, and its parts",
    Params,
    measure,
    summarise,
    PARTS=PARTS,
    FOR_SETS=True,
)
