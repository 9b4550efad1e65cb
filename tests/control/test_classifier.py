"""What the classifier learns from, and that its network is PyTorch's."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from echoset.campaign.scenarios import find
from echoset.control import training
from echoset.control.windows import Windows, _varied, join, scenes
from echoset.estimators.maps.detector import SHIPPED
from echoset.estimators.maps.kernels.cnn import probabilities
from echoset.formats import weights
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.simulate import jsc

VECTORS = Path(__file__).parent / "classifier_vectors.npz"


@pytest.fixture(scope="module")
def scene():
    return resolve(jsc.Params, *find("jsc-6bs").layers)


@pytest.fixture(scope="module")
def made(scene):
    return {
        stage: join(scenes(scene, range(2), 5, f"classifier:{stage}", 3, 0.5))
        for stage in ("train", "test")
    }


def test_the_network_is_pytorchs_on_stored_vectors():
    """Probabilities that PyTorch gave for the weights that are shipped."""
    stored = np.load(VECTORS)
    found = probabilities(weights.read(SHIPPED), stored["power"].astype(np.float32))
    assert len(found) == 12 and 3 < found[:, 1].sum() < 9
    np.testing.assert_allclose(found, stored["probability"], atol=1e-5)


def test_the_shipped_weights_tell_what_they_have_not_seen(made):
    """Ninety percent of 48 windows: 4.5 standard errors below 98 percent is 89 percent."""
    windows = made["test"]
    right = probabilities(weights.read(SHIPPED), windows.power).argmax(1) == windows.kind
    assert len(right) == 48 and right.mean() > 0.89


def test_scenes_to_train_and_to_test_on_share_nothing(made):
    train, test = (made[stage].power.reshape(len(made[stage].power), -1) for stage in made)
    assert not (train[:, None] == test).all(2).any()
    assert set(made["test"].stations.tolist()) == {1, 2, 3, 4, 5, 6}


def test_windows_are_about_the_targets(scene):
    """Undisplaced, the middle of a window is brighter than its corners."""
    windows = join(scenes(replace(scene, pedestrians=2, vehicles=2), range(1), 6, "x", 4, 0.0))
    power = windows.power[windows.stations >= 3]
    middle, corner = power[:, 25:35, 25:35].mean((1, 2)), power[:, :10, :10].mean((1, 2))
    assert np.median(middle / corner) > 10
    assert np.bincount(windows.kind).tolist() == [8, 8]


def test_scenes_vary_in_power_and_layout(scene):
    """Ten draws lie in their ranges, about the middle of the area, and differ."""
    area = (0.0, 40.0, -20.0, 20.0)
    there = replace(scene, area=area, stations=((-30.0, 0.0, 0.0), (20.0, 50.0, -1.57)))
    for one in (scene, there):
        rng, found = np.random.default_rng(2), []
        for _ in range(10):
            varied = _varied(one, (20.0, 50.0), (0.7, 1.2), rng)
            middle = (20.0, 0.0) if one is there else (0.0, 0.0)
            d = np.hypot(*(varied.poses[:, :2] - middle).T)
            assert 20 <= varied.eirp <= 50
            assert (d >= 0.7 * 50 - 1e-9).all() and (d <= 1.2 * 50 + 1e-9).all()
            np.testing.assert_array_equal(varied.poses[:, 3], one.poses[:, 3])
            found.append((varied.eirp, d[0]))
        assert len(set(found)) == 10
    assert _varied(scene, None, (1.0, 1.0), rng) == scene


def test_weights_say_how_they_were_made(scene, made, monkeypatch):
    monkeypatch.setattr(training, "require_torch", lambda: type("t", (), {"__version__": "2"}))
    accuracy, params = [training.Accuracy(3, 0.91234, 0.01, 0.23456, 48)], training.Params(scenes=5)
    learnt = made["train"], made["test"]
    told = training.story("jsc-6bs", scene, params, 9, learnt, accuracy)
    assert told["seed"] == 9 and told["settings"]["scenes"] == 5 and told["scene"]["eirp"] == 30.0
    assert told["accuracy by stations"] == {"3": [0.9123, 0.01]}
    assert told["log loss by stations"] == {"3": 0.2346}
    assert json.loads(json.dumps(told))["settings"]["eirp"] == [20.0, 50.0]
    w = made["test"]
    whole = b"".join(a.tobytes() for a in (w.power, w.kind, w.stations, w.scene))
    digest = hashlib.sha256(whole).hexdigest()
    assert told["streams"]["classifier:test"] == digest != told["streams"]["classifier:train"]


def test_accuracy_and_log_loss_by_stations(monkeypatch):
    """Of four windows with known probabilities: three right; the mean of -log p by hand."""
    windows = Windows(
        np.zeros((4, 60, 60), np.float32),
        np.array([0, 1, 1, 0]),
        np.array([2, 2, 2, 2]),
        np.array([0, 0, 1, 1]),
    )
    p = np.array([[0.9, 0.1], [0.2, 0.8], [0.75, 0.25], [0.6, 0.4]])
    monkeypatch.setattr(training, "probabilities", lambda weights, power: p)
    (found,) = training.evaluate(weights.read(SHIPPED), windows)
    assert (found.stations, found.share, found.windows) == (2, 0.75, 4)
    assert found.log_loss == pytest.approx(-np.log([0.9, 0.8, 0.25, 0.6]).mean())


def test_training_learns_and_repeats(made):
    torch = pytest.importorskip("torch", reason="PyTorch is not installed")
    params = training.Params(epochs=3, batch=8)
    watch = lambda items, name, count: items  # noqa: E731
    found = [training.train(made["train"], params, 1, watch) for _ in range(2)]
    for a, b in zip(*(w.arrays().values() for w in found), strict=True):
        np.testing.assert_array_equal(a, b)
    share = [a.share for a in training.evaluate(found[0], made["train"])]
    assert np.mean(share) > 0.7
    assert torch.get_num_threads() == 1


def test_without_pytorch_a_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(ParameterError, match=r"pip install 'echoset\[train\]'"):
        training.require_torch()
