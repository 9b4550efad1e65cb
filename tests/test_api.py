"""The functions in memory give what the commands write to files."""

from __future__ import annotations

import numpy as np
import pytest

import echoset
from echoset.cli.main import main
from echoset.models.errors import InputError, ParameterError


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


def test_public_names():
    for name in echoset.__all__:
        assert callable(getattr(echoset, name))
    with pytest.raises(AttributeError, match="nothing"):
        _ = echoset.nothing
