"""Bad recordings of maps: one line that names the place, an exit code, nothing left behind."""

from __future__ import annotations

import sys
from dataclasses import replace

import map_scene
import numpy as np
import pytest

from echoset import formats
from echoset.formats import weights as network
from echoset.models.errors import FormatError

SCANS = 4


@pytest.fixture(scope="module")
def scene():
    """One pedestrian before two stations."""
    track, births = np.zeros((SCANS, 1, 2)), np.array([[0.1, 0, 0, 0, 0, 1, 1, 1, 1.0]])
    rng = np.random.default_rng(0)
    return map_scene.recording(track, [map_scene.PEDESTRIAN], 2, rng, births)


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    path = tmp_path_factory.mktemp("network") / "byhand.npz"
    network.write(path, map_scene.classifier())
    return path


def changed(scene, **changes):
    """The scene with something else in the stream s1."""
    streams = {**scene.streams, "s1": replace(scene.streams["s1"], **changes)}
    return replace(scene, streams=streams)


@pytest.fixture
def estimate(run, tmp_path, weights):
    def call(path, *words, name="phd"):
        out = tmp_path / "out" / "estimates.h5"
        preset = ("--preset", "paper", "--set", f"weights={weights}")
        result = run("estimate", "-e", name, *preset, *words, path, "-o", out)
        return result, out

    return call


def refused(result, code, message):
    assert result.code == code
    lines = [line for line in result.err.splitlines() if "compiling" not in line]
    assert len(lines) == 1 and message in lines[0], result.err


@pytest.mark.parametrize("name", ["phd", "mbm"])
@pytest.mark.parametrize("format", ["h5", "mcap"])
def test_sound_maps_give_classes_and_equal_bytes(scene, estimate, run, tmp_path, name, format):
    path = tmp_path / f"maps.{format}"
    formats.write(scene, path, format)
    result, out = estimate(path, name=name)
    assert result.code == 0, result.err
    objects = formats.read(out).objects
    assert objects.class_names == ("pedestrian", "vehicle")
    assert objects.class_index.tolist() == [0] * SCANS
    data = out.read_bytes()
    out.unlink()
    estimate(path, name=name)
    assert out.read_bytes() == data


@pytest.mark.parametrize(
    ("settings", "code", "message"),
    [
        (("stations=0",), 2, "stations must be at least 1, or null for all, got 0"),
        (("stations=3",), 4, "stations is 3, but only 2 streams have maps"),
        (("weights=/nowhere.npz",), 4, "/nowhere.npz: no weights: No such file or directory"),
        (("identify=none",), 2, "gate_vehicle must be gate_pedestrian"),
    ],
)
def test_settings(scene, estimate, empty, tmp_path, settings, code, message):
    formats.write(scene, tmp_path / "maps.h5", "h5")
    words = [word for s in settings for word in ("--set", s)]
    refused(estimate(tmp_path / "maps.h5", *words)[0], code, message)
    assert empty()


def test_a_station_without_maps(scene, estimate, empty, tmp_path):
    silent = scene.streams["s1"].part(0, 0)
    streams = {**scene.streams, "s1": silent}
    formats.write(replace(scene, streams=streams), tmp_path / "maps.h5", "h5")
    refused(estimate(tmp_path / "maps.h5")[0], 4, "stream s1: has no maps")
    assert empty()
    assert estimate(tmp_path / "maps.h5", "--set", "stations=1")[0].code == 0


def test_zeros_are_no_detections(scene, estimate, tmp_path):
    streams = {
        name: replace(s, scan={"map": np.zeros_like(s.scan["map"])})
        for name, s in scene.streams.items()
    }
    formats.write(replace(scene, streams=streams), tmp_path / "maps.h5", "h5")
    result, out = estimate(tmp_path / "maps.h5")
    assert result.code == 0
    assert formats.read(out).objects.row_offset.tolist() == [0] * (SCANS + 1)


def spoilt(scene, value):
    power = scene.streams["s1"].scan["map"].copy()
    power[2, 5, 7] = value
    return {"scan": {"map": power}}


BAD = {
    "nan": (lambda s: spoilt(s, np.nan), "streams/s1/scan/map[2, 5, 7]: nan is not finite"),
    "negative": (lambda s: spoilt(s, -1), "streams/s1/scan/map[2, 5, 7]: -1.0 is negative"),
    "no axis": (
        lambda s: {"model": {"range_axis": map_scene.RANGE}},
        "streams/s1/model/azimuth_axis: is missing",
    ),
    "another grid": (
        lambda s: {"model": {**s.streams["s1"].model, "range_axis": map_scene.RANGE[1:]}},
        "streams/s1/scan/map: is (218, 51) a scan, the axes (217, 51)",
    ),
}


@pytest.mark.parametrize("problem", BAD)
def test_maps_are_refused_by_place(scene, estimate, empty, tmp_path, monkeypatch, problem):
    change, message = BAD[problem]
    bad = changed(scene, **change(scene))
    with pytest.raises(FormatError):
        formats.write(bad, tmp_path / "bad.h5", "h5")
    with monkeypatch.context() as patch:
        patch.setattr(formats.files, "check", lambda record: None)
        formats.write(bad, tmp_path / "bad.h5", "h5")
    refused(estimate(tmp_path / "bad.h5")[0], 4, message)
    assert empty()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "cnn.txt"), "weights are written as .npz"),
        (("-o", "cnn.npz", "--scenario", "meeting"), "has no range-angle maps"),
        (("-o", "cnn.npz", "--set", "scenes=0"), "scenes must be at least 1"),
        (("-o", "cnn.npz", "--set", "scene=1"), "did you mean"),
    ],
)
def test_impossible_trainings_are_refused(run, monkeypatch, tmp_path, words, message):
    from echoset.control import training

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(training, "require_torch", lambda: None)
    refused(run("train-classifier", *words), 2, message)
    assert not list(tmp_path.iterdir())


def test_training_says_what_to_install(run, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "torch", None)
    result = run("train-classifier", "-o", tmp_path / "cnn.npz")
    refused(result, 2, "training needs PyTorch: pip install 'echoset[train]'")
    (tmp_path / "cnn.npz").write_bytes(b"")
    refused(run("train-classifier", "-o", tmp_path / "cnn.npz"), 5, "exists")
