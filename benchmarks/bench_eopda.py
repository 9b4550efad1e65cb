"""The UWB estimators on ``uwb-olos``: ``python benchmarks/bench_eopda.py``.

Prints, for each estimator, milliseconds per step on loaded data after compilation (5000 particles,
9 passive and 3 active links, one core), their ratio to a fixed calibration kernel timed in the same
run, and the twins' gain over NumPy. The paper states 0.67 s and 0.33 s per step for the ideal and
the geometry-based model; the ratio of the two stands beside ours.
"""

from __future__ import annotations

from collections import deque
from functools import partial

import numpy as np
from calibration import fastest, kernel
from scene import simulated

from echoset.estimators.eopda.kernels import bias_proposal, link_likelihood, range_error
from echoset.estimators.eopda.kernels.compiled import bias_proposal as fast_bias_proposal
from echoset.estimators.eopda.kernels.compiled import link_likelihood as fast_link_likelihood
from echoset.estimators.eopda.kernels.compiled import range_error as fast_range_error
from echoset.estimators.run import Estimation
from echoset.models.records import Recording
from echoset.models.scatter import unit_square_nodes

NAMES = ("eopda-geo", "eopda-ideal", "a-eopda-geo", "a-eopda-ideal", "ap-pda", "position")
STEPS = 60


def estimate(estimator: str, recording: Recording) -> None:
    """Run the estimator over the whole recording."""
    deque(Estimation(estimator).on(recording.setup(), "bench").steps(recording.scans()), maxlen=0)


def gains(n: int = 500) -> dict[str, float]:
    """How many times faster each twin is than its definition, on ``n`` particles."""
    rng = np.random.default_rng(1)
    anchors = np.array([[4.0, 4.5, 0.0], [0.0, 0.5, 0.0], [6.5, 0.0, 0.0]])
    nothing, height = np.zeros((0, 0)), np.zeros(n)
    centre = np.array([[3.0], [2.0]]) + 0.1 * rng.normal(size=(2, n))
    rx, tx, offset = np.repeat([0, 1, 2], 4), np.tile([3, 0, 1, 2], 3), np.arange(13) * 10
    z, variance = rng.uniform(0, 20, 120), rng.uniform(0.02, 0.2, 120) ** 2
    axes, width = rng.uniform(0.1, 0.5, (2, n)), rng.uniform(0.01, 0.2, n)
    links = (tx, rx, offset, z, variance)
    common = (centre, centre + 0.3, height, anchors, *links, nothing, nothing, 0.25)
    theta = (np.zeros((n, 4)), np.tile(0.01 * np.eye(4), (n, 1, 1)))
    biases = (rng.uniform(0, 0.6, (4, n)), rng.uniform(-3, 3, (4, n)), rng.random(n))
    nodes = unit_square_nodes(50)
    work = {
        "geo": (link_likelihood.geo, fast_link_likelihood.geo),
        "ideal": (link_likelihood.ideal, fast_link_likelihood.ideal),
        "point": (link_likelihood.point, fast_link_likelihood.point),
        "propose_bias": (bias_proposal.propose_bias, fast_bias_proposal.propose_bias),
        "direct": (range_error.direct, fast_range_error.direct),
    }
    arguments = {
        "geo": (*common, 1.0, 5.0, axes[0], width, 2.0, True),
        "ideal": (*common, 1.0, 5.0, axes, width, 2.0, *nodes),
        "point": (*common, 0.9),
        "propose_bias": (
            *(centre, height, *biases, anchors, *links[1:], nothing, nothing),
            *(1.0, 1.0),
        ),
        "direct": (centre, height, anchors, *links[1:], *theta, 1.0, 1.0),
    }
    return {
        name: fastest(partial(slow, *arguments[name])) / fastest(partial(fast, *arguments[name]))
        for name, (slow, fast) in work.items()
    }


def main() -> None:
    """Time all estimators."""
    recording, short = (simulated("uwb-los", "bench", steps=n) for n in (STEPS, 2))
    unit = fastest(kernel)
    per_step = {}
    for name in NAMES:
        estimate(name, short)
        start = fastest(partial(estimate, name, short))
        taken = fastest(partial(estimate, name, recording))
        per_step[name] = (taken - start) / (STEPS - 2)
        print(
            f"{name:14s} {1e3 * per_step[name]:7.2f} ms/step {per_step[name] / unit:7.3f} x"
            f"   (first two steps {1e3 * start:.0f} ms)"
        )
    ratio = per_step["eopda-ideal"] / per_step["eopda-geo"]
    print(f"ideal / geo: {ratio:.1f}   (paper: 0.67 / 0.33 = {0.67 / 0.33:.1f})")
    for name, gain in gains().items():
        print(f"twin of {name}: {gain:.0f} times faster than NumPy")


if __name__ == "__main__":
    main()
