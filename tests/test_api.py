"""The functions in memory give what the commands write to files."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from support import builders

import echoset
from echoset.cli.main import main
from echoset.estimators import run
from echoset.models import registry
from echoset.models.errors import EstimatorError, InputError, ParameterError
from echoset.models.records import Estimates, Meta


def test_functions_equal_commands(tmp_path):
    rec, est = tmp_path / "rec.h5", tmp_path / "est.h5"
    few = ("--set", "particles=200")
    assert main(["simulate", "uwb-olos", "--set", "steps=5", "-o", str(rec)]) == 0
    assert main(["estimate", "-e", "eopda-geo", *few, "--seed", "3", str(rec), "-o", str(est)]) == 0
    recording, written = echoset.read(rec), echoset.read(est)
    made = echoset.estimate(recording, "eopda-geo", seed=3, particles=200)
    np.testing.assert_array_equal(made.objects.state, written.objects.state)
    np.testing.assert_array_equal(made.objects.covariance, written.objects.covariance)
    assert made.meta.provenance == written.meta.provenance
    scores = echoset.score(made, recording, "rmse", parts=["device"])
    device = made.objects.columns("device_x", "device_y")
    error = device - recording.truth.objects.columns("device_x", "device_y")
    np.testing.assert_allclose(scores.value[:5], np.linalg.norm(error, axis=1), rtol=1e-12)
    echoset.write(recording, tmp_path / "rec.mcap")
    echoset.write(echoset.read(tmp_path / "rec.mcap"), tmp_path / "again.h5")
    assert rec.read_bytes() == (tmp_path / "again.h5").read_bytes()


def test_errors_are_those_of_the_commands(recording):
    with pytest.raises(ParameterError, match="did you mean 'eopda-geo'"):
        echoset.estimate(recording, "eopda-goe")
    with pytest.raises(ParameterError, match="did you mean 'particles'"):
        echoset.estimate(recording, "eopda-geo", particle=3)
    estimates = echoset.estimate(recording, "eopda-geo", particles=200, rms_bandwidth=1e8)
    with pytest.raises(InputError):
        echoset.score(estimates, recording.observed(), "rmse")


class Diverging:
    """An estimator whose second step is not finite."""

    SUMMARY, STREAMS, PRESETS = "diverges", ("position",), {}

    @dataclass(frozen=True, slots=True)
    class Params:
        """Nothing to choose."""

    @staticmethod
    def estimate(setup, scans, params, rng):
        for scan, x in zip(scans, (1.0, np.nan), strict=True):
            made = replace(builders.objects([[[x, 0.0]]]), time_ns=np.array([scan.time_ns]))
            yield Estimates(Meta(""), made, {})


def test_estimates_that_are_not_finite_are_refused_as_by_the_command(monkeypatch):
    load = registry.load
    found = {("echoset.estimators", "diverging"): Diverging}
    for module in (registry, run):
        monkeypatch.setattr(module, "load", lambda *key: found.get(key) or load(*key))
    with pytest.raises(EstimatorError, match=r"small: step 2: objects/state.* not finite"):
        echoset.estimate(builders.recording({"R": builders.radar([[], []])}), "diverging")


def test_streams_that_an_estimator_cannot_process_are_left_out_as_by_the_command(tmp_path):
    """A radar beside a UWB network, whose parameters have the same name in both models."""
    known = {"p_detect": 0.9, "clutter_rate": 1.0, "std_position": 0.1, "max_range": 9.0}
    radar = builders.radar([[[1.0, 2.0]], [[1.1, 2.0], [4.0, 4.0]]], **known)
    both = builders.recording({"R": radar, "uwb": builders.uwb([[1.0], [2.0, 3.0]], p_detect=0.1)})
    rec, est = tmp_path / "rec.h5", tmp_path / "est.h5"
    echoset.write(both, rec)
    assert main(["estimate", "-e", "phd", str(rec), "-o", str(est)]) == 0
    made, written = echoset.estimate(both, "phd"), echoset.read(est)
    assert made.meta.provenance == written.meta.provenance
    np.testing.assert_array_equal(made.objects.state, written.objects.state)
    alone = echoset.estimate(builders.recording({"R": radar}), "phd")
    np.testing.assert_array_equal(made.objects.state, alone.objects.state)
    with pytest.raises(InputError, match="small: has position, but eopda-geo needs a stream"):
        echoset.estimate(builders.recording({"R": radar}), "eopda-geo")


def test_public_names():
    for name in echoset.__all__:
        assert callable(getattr(echoset, name))
    with pytest.raises(AttributeError, match="nothing"):
        _ = echoset.nothing
