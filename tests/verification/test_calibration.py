"""Numbers of sensors are within two of their standard errors as often as they should be."""

import numpy as np
import pytest
from support.sensors import radar, uwb

from echoset.metrics.calibration.run import Params, calibrate

pytestmark = pytest.mark.verification
RUNS = 100
LEAST = 0.954 - 4.5 * np.sqrt(0.954 * 0.046 / RUNS)


@pytest.mark.parametrize("kind", ["position", "range_bearing", "uwb"])
def test_every_number_is_within_two_standard_errors(kind):
    within, latency = {}, []
    for seed in range(RUNS):
        recording, true = uwb(seed) if kind == "uwb" else radar(100 + seed, kind)
        (found,) = calibrate([recording], Params())
        for q in found.quantities:
            if q.name in true:
                within.setdefault(q.name, []).append(abs(q.value - true[q.name]) < 2 * q.stderr)
            if q.name == "latency":
                latency.append(q.value - true["latency"])
    for name, hits in within.items():
        assert len(hits) == RUNS and np.mean(hits) > LEAST, (name, np.mean(hits))
    # In all numbers together, which are not independent.
    assert np.mean([np.mean(hits) for hits in within.values()]) > 0.92
    if latency:
        assert np.sqrt(np.mean(np.square(latency))) < 0.02
