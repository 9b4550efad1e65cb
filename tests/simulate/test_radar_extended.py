"""The radar scene: its counts, spreads and tables against the model that it declares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.formats import read, write
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.geometry import extent
from echoset.models.parameters import resolve
from echoset.models.radar import ofdm
from echoset.models.records import Recording
from echoset.simulate import radar_extended
from echoset.simulate.radar_extended import Params, simulate

PARAMS = Params(epochs=2)


@pytest.fixture(scope="module")
def recording() -> Recording:
    return simulate(PARAMS, np.random.default_rng(2), "x")


def test_a_recording_is_valid_and_survives_its_file(recording, tmp_path):
    check(recording)
    write(recording, tmp_path / "x.h5", "h5")
    again = read(tmp_path / "x.h5")
    model, found = recording.streams["R0"].model, again.streams["R0"].model
    np.testing.assert_array_equal(found["cov_xz_table"], model["cov_xz_table"])
    assert list(recording.streams) == ["R0", "R1"]
    np.testing.assert_allclose(recording.sensors["R1"].position, [[50, 24, 5], [40, 24, 5]])


def test_targets_satisfy_the_prior():
    params = Params(mean_targets=1.0)
    rng = np.random.default_rng(3)
    draws = [radar_extended.targets(params, rng) for _ in range(600)]
    empty = np.array([d[2] for d in draws])
    # Retained points are few and far between: nearly Poisson, drawn again if there is none.
    p = np.exp(-1.0)
    assert abs(empty.mean() - p / (1 - p)) < 4.5 * empty.std() / np.sqrt(len(draws)) + 0.05
    e = np.concatenate([d[1] for d in draws])
    assert (e[:, [0, 2, 5]] >= 1).all() and (e[:, [0, 2, 5]] <= 1.5).all()
    middle = np.array([1.25, 0, 1.25, 0, 0, 1.25])
    assert (np.abs(e.mean(0) - middle) < 4.5 * e.std(0) / np.sqrt(len(e))).all()


def test_counts_and_spread_follow_the_model():
    params = replace(PARAMS, epochs=1)
    rng = np.random.default_rng(4)
    state = radar_extended.sensor_state(params, 0, 0, rng)
    c, e = np.array([[20.0, 10, 5], [35, 4, 3]]), np.array([[1.2, 0.3, 1.4, -0.2, 0.1, 1.1]] * 2)
    runs, counts, z = 400, [], [[], []]
    for _ in range(runs):
        rows = radar_extended._scan(params, state, c, e, rng)
        counts.append(np.bincount(rows["origin_id"] + 1, minlength=3))
        x = np.stack([rows[a] for a in "xyz"], 1) + state.position
        for l in (0, 1):
            z[l].append(x[rows["origin_id"] == l])
        point = np.stack([rows[f"origin_{a}"] for a in "xyz"], 1)
        assert (np.isnan(point).any(1) == (rows["origin_id"] < 0)).all()
    volume = 1.2 * 1.4 * 1.1
    mean = ofdm.p_detect(state, c) * np.maximum(1, volume * ofdm.resolution(state, c))
    mean = np.array([params.clutter_rate, *mean])
    assert (np.abs(np.mean(counts, 0) - mean) < 4.5 * np.sqrt(mean / runs)).all()
    for l in (0, 1):
        x = np.concatenate(z[l]) - c[l]
        v = extent.covariance(e[l]) + np.mean(
            [ofdm.covariance(state, c[l] + 1.2 * rng.normal(size=3)) for _ in range(4000)], 0
        )
        error = np.sqrt((np.outer(np.diag(v), np.diag(v)) + v**2) / len(x))
        assert (np.abs(x.T @ x / len(x) - v) < 4.5 * error + 0.05 * np.abs(v)).all()


def test_tables_are_the_closed_forms_at_the_nodes(recording):
    rng = np.random.default_rng(2)
    radar_extended.targets(PARAMS, rng)
    states = [radar_extended.sensor_state(PARAMS, 0, t, rng) for t in (0, 1)]
    model = recording.streams["R0"].model
    assert model["p_detect_table"].shape == (2, 22, 10, 6)
    node = model["grid_origin"] + np.array([7, 3, 2]) * model["grid_spacing"]
    for t, state in enumerate(states):
        S = ofdm.covariance(state, node)
        assert model["cov_xy_table"][t, 7, 3, 2] == pytest.approx(S[0, 1])
        assert model["cov_zz_table"][t, 7, 3, 2] == pytest.approx(S[2, 2])
        assert model["p_detect_table"][t, 7, 3, 2] == pytest.approx(ofdm.p_detect(state, node))


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        ({"region": [0, 50, 0, 20, 10, 10]}, "region"),
        ({"mean_targets": 40}, "one per ball"),
        ({"starts": [[0, 0, 0]]}, "velocities"),
        ({"subcarriers": 7}, "subcarriers"),
        ({"extent_diagonal": [0.0, 1.0]}, "extent_diagonal"),
    ],
)
def test_impossible_scenes_are_refused(wrong, word):
    with pytest.raises(ParameterError, match=word):
        simulate(resolve(Params, ("", wrong)), np.random.default_rng(0), "x")
