"""What the sensor control paper found, on 100 runs with the same targets and luck.

A finding holds if the paired difference is more than three of its standard errors on the right
side: pytest -m verification -s prints the numbers. Two do not come out as the paper has them and
are tested for what they are: over the crossing, the gain is in B1 and in the three regions
together, not in B2 or B3 alone; among false alarms an empty B3 is better by just under three, and
an empty B2 only until births that passed B1 unseen are counted there.
"""

import os
from concurrent.futures import ProcessPoolExecutor
from functools import cache

import numpy as np
import pytest

from echoset.control import figures
from echoset.control.runs import campaign, join, mean_over, paired
from echoset.control.surveillance import Params

pytestmark = pytest.mark.verification

RUNS, SEED, DECISIVE = 100, 1, 3.0
B1, B2, B3 = range(3)


def part(name, runs):
    return campaign(Params(**figures.CONDITIONS[name]), runs, SEED)


@cache
def runs(name):
    """All runs under a condition, shared by the processors."""
    workers = os.cpu_count() or 1
    with ProcessPoolExecutor(workers) as pool:
        parts = [range(w, RUNS, workers) for w in range(workers)]
        return join(pool.map(part, [name] * workers, parts))


def z(a, b, where, regions, title):
    """Mean error of ``b`` less that of ``a`` in ``regions`` over ``where``, in standard errors."""
    where = where[..., regions]
    difference = mean_over(b.error[..., regions], where) - mean_over(a.error[..., regions], where)
    mean, stderr = paired(difference)
    print(f"\n{title}: {mean:+.3f} ± {stderr:.3f}", end="")
    return mean / stderr


def crossing(campaign):
    """Where a region holds targets."""
    return campaign.true > 0


def test_variance_beats_naive_over_the_crossing():
    """Figure 3: (0.6, 1)."""
    naive, variance = runs("naive 0.6 1"), runs("variance 0.6 1")
    assert np.array_equal(naive.true, variance.true)
    b1, b2, b3, together = (
        z(naive, variance, crossing(naive), regions, f"crossing, {title}, variance less naive")
        for regions, title in (([B1], "B1"), ([B2], "B2"), ([B3], "B3"), ([B1, B2, B3], "all"))
    )
    assert b1 < -DECISIVE
    assert together < -DECISIVE
    assert abs(b2) < DECISIVE and abs(b3) < DECISIVE


def test_births_make_the_variance_policy_overestimate_b1_when_it_is_empty():
    """Section IV-B: the bias that figure 2 shows once the wave has passed."""
    naive, variance = runs("naive 0.6 1"), runs("variance 0.6 1")
    empty = ~crossing(naive)
    bias, stderr = paired(mean_over((variance.mean - variance.true)[..., B1], empty[..., B1]))
    print(f"\nbias of B1 when empty: {bias:+.3f} ± {stderr:.3f}", end="")
    assert bias > DECISIVE * stderr
    assert z(naive, variance, empty, [B1], "empty, B1, variance less naive") > DECISIVE


def test_where_there_is_nothing_among_false_alarms():
    """Figure 5: (0.8, 10), steps in which the region holds no target."""
    naive, variance = runs("naive 0.8 10"), runs("variance 0.8 10")
    empty = ~crossing(naive)
    b2, b3 = (
        z(naive, variance, empty, [b], f"empty, B{b + 1}, variance less naive") for b in (B2, B3)
    )
    assert b3 < 0
    assert b2 > DECISIVE
    before = empty.copy()
    before[:, 150:] = False
    title = "empty, B2 until the wave is in B3, variance less naive"
    assert z(naive, variance, before, [B2], title) < -DECISIVE


def test_few_births_miss_later_waves():
    """Figure 6: steps with an error of half a wave once the first wave has left B1."""
    few, some = runs("birth 0.05"), runs("birth 1")
    half, after = Params().mean_size / 2, 80
    missed = [(c.error[:, after:] >= half).sum((1, 2)).astype(float) for c in (few, some)]
    mean, stderr = paired(missed[0] - missed[1])
    print(f"\nsteps missed with 0.05 births less those with 1: {mean:+.1f} ± {stderr:.1f}", end="")
    assert mean > DECISIVE * stderr


def test_many_births_keep_the_sensor_on_b1():
    few, some, many = (runs(f"birth {rate}").looks()[:, B1] for rate in ("0.05", "1", "20"))
    for other in (few, some):
        mean, stderr = paired(many - other)
        print(f"\nshare of looks at B1 with 20 births less: {mean:+.3f} ± {stderr:.3f}", end="")
        assert mean > DECISIVE * stderr


def test_one_birth_is_best_over_all():
    few, some, many = (runs(f"birth {rate}") for rate in ("0.05", "1", "20"))
    everywhere = np.ones(few.true.shape, bool)
    assert z(few, some, everywhere, [B1, B2, B3], "all steps, 1 less 0.05") < -DECISIVE
    assert z(many, some, everywhere, [B1, B2, B3], "all steps, 1 less 20") < -DECISIVE
