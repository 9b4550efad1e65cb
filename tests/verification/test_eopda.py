"""The UWB estimators on 100 runs of ``uwb-olos``, as ``make marks`` prints them.

The bounds are those of a plain bootstrap filter on the same scene (40 runs), of the posterior
Cramér-Rao bound, and of the comparison in Zhu et al., section V-B. All allow two standard errors.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from papers import uwb as marks

RUNS = 100
BOOTSTRAP_FILTER = np.array([0.062, 0.303, 0.130, 0.111, 0.255, 0.048])
"""RMSE [m] of a plain bootstrap filter with the geometry-based model, by segment, of 40 runs."""
BEFORE, AFTER = (11, 30), (131, 180)
"""Steps outside the blockages."""

pytestmark = pytest.mark.verification


@cache
def campaign(name: str, runs: int = RUNS, particles: int = 5000):
    return marks.campaign(name, runs, particles=particles)


@pytest.mark.parametrize(("name", "mark"), [("eopda-geo", 0.135), ("eopda-ideal", 0.125)])
def test_mean_error_and_no_run_is_lost(name, mark):
    values, errors = campaign(name).figures()
    assert values[0] <= mark + 2 * errors[0]
    assert campaign(name).lost == 0


def test_geo_is_no_worse_than_a_bootstrap_filter_in_any_segment():
    values, errors = campaign("eopda-geo").figures()
    combined = errors[1:] * np.sqrt(1 + RUNS / 40)
    assert (values[1:] <= BOOTSTRAP_FILTER + 2 * combined).all()


@pytest.mark.parametrize(("segment", "bound"), [(BEFORE, 0.030), (AFTER, 0.025)])
def test_ideal_comes_near_the_bound_outside_the_blockages(segment, bound):
    assert campaign("eopda-ideal").rmse(*segment) <= 1.4 * bound


def test_ideal_is_better_than_geo():
    assert campaign("eopda-ideal").mean_rmse() < campaign("eopda-geo").mean_rmse()


@pytest.mark.parametrize("model", ["geo", "ideal"])
def test_passive_links_halve_the_error(model):
    both, active, pda = (
        campaign(name) for name in (f"eopda-{model}", f"a-eopda-{model}", "ap-pda")
    )
    assert both.rmse(31, 130) <= 0.5 * active.rmse(31, 130)
    assert both.mean_rmse() <= 0.5 * pda.mean_rmse()


@pytest.mark.parametrize("segment", [BEFORE, AFTER])
def test_more_particles_do_not_help_geo_outside_the_blockages(segment):
    few, many = (campaign("eopda-geo", 20, n) for n in (5000, 50_000))
    assert few.rmse(*segment) <= 1.1 * many.rmse(*segment)
