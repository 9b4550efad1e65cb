"""Whether the probabilities of classes are what they claim: the logarithmic score.

Of every object that was found, by the assignment of :mod:`.accuracy`, minus the logarithm of the
probability that its true class was given, in nats. Who gives C classes the same probability has
log C; who is wrong and sure has much more, so that the mean is least for probabilities that come
true as often as they say. I. J. Good, "Rational decisions", J. R. Stat. Soc. B 14 (1952) 107-114.
"""

from __future__ import annotations

import numpy as np

from ..models.errors import InputError
from ..models.records import Estimates, Recording, Scores
from .accuracy import SAID, Params, assigned_pairs, index
from .kit.measured import Measured, Names
from .kit.series import mean_stderr
from .kit.sets import align
from .kit.table import rows
from .protocol import Metric

LEAST = 1e-9
"""Probability that a class is given at least: who says never and errs loses 21 nats."""


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """Per step the number of the objects found, and the sum of their losses.

    Raises
    ------
    InputError : no truth, no positions in common, no classes, or none with probabilities
    """
    aligned = align(estimates, recording, params)
    truth, said = aligned.truth, aligned.estimate
    true = index(truth, truth.class_names, "the truth")
    if said.class_index is None or said.class_probability is None:
        raise InputError(f"{SAID} have no probabilities of classes")
    names = [said.class_names.index(n) if n in said.class_names else -1 for n in truth.class_names]
    step, first, second = assigned_pairs(aligned, params)
    # A column of zeros is what the index -1 picks: of classes that the estimates do not know.
    p = np.hstack((said.class_probability, np.zeros((len(said.class_probability), 1))))
    column = np.array([*names, -1])[true[first]]
    loss = -np.log(np.maximum(p[second, column], LEAST))
    n = len(aligned)
    values = {"found": np.bincount(step, minlength=n), "loss": np.bincount(step, loss, n)}
    return Measured(aligned.time, values, aligned.left_out, {})


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """The mean loss per step and over all objects that were found [nats]."""
    found, loss = measured.values["found"], measured.values["loss"]
    some = found > 0
    share = loss[some] / found[some]
    key = (*names, "class-log-loss", "")
    tables = [rows(key, measured.time[some], share, found[some])]
    if some.any():
        spread, total = mean_stderr(share, params.block), int(found.sum())
        tables.append(rows(key, np.nan, loss.sum() / total, total, spread))
    return Scores.join(tables)


METRIC = Metric(
    "log-loss of the probabilities of classes [nats], of the objects found",
    Params,
    measure,
    summarise,
    FOR_SETS=True,
)
