"""``echoset train-templates``, and what ``info`` says of weights."""

from dataclasses import replace

import pytest
from support.straight import straight

import echoset
from echoset.estimators.maps.detector import SHIPPED
from echoset.formats import weights


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    folder, paths = tmp_path_factory.mktemp("maps"), []
    for seed in range(2):
        where = [[6.0, 3.0], [-5.0, 0.0]]
        made = straight([0, 1], where, [0.0, 0.5], [1.0, 1.0], seed, scans=3)
        paths.append(folder / f"{seed}.h5")
        echoset.write(made, paths[-1])
    return paths


def test_templates_are_parameters_of_tbd(run, recordings, tmp_path):
    path = tmp_path / "bodies.yaml"
    words = ("train-templates", *recordings, "-o", path, "--set", "trials=20", "--set", "scans=2")
    result = run(*words)
    assert result.code == 0, result.err
    assert "nats a scan in 1 recordings apart" in result.out
    text = path.read_text()
    assert text.startswith("# What reflects in range-angle maps, learnt by echoset train-templates")
    used = run("estimate", "-e", "tbd", recordings[0], "-o", tmp_path / "e.h5", "--config", path)
    assert used.code == 0, used.err
    again = run(*words)
    assert again.code == 5 and "exists" in again.err


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("-o", "bodies.txt"), 2, "templates are written as .yaml"),
        (("-o", "b.yaml", "--set", "scans=0"), 2, "scans"),
    ],
)
def test_what_is_refused(run, recordings, tmp_path, monkeypatch, words, code, message):
    monkeypatch.chdir(tmp_path)
    result = run("train-templates", recordings[0], *words)
    assert result.code == code and message in result.err


def test_info_says_how_weights_were_made(run, tmp_path):
    path = tmp_path / "w.npz"
    weights.write(path, replace(weights.read(SHIPPED), made={"seed": 7, "scenario": "jsc-6bs"}))
    result = run("info", path)
    assert result.code == 0
    assert weights.sha256(path) in result.out and '"jsc-6bs"' in result.out + result.err
    assert '"echoset train-classifier --scenario jsc-6bs --seed 1"' in run("info", SHIPPED).out
    bare = tmp_path / "bare.npz"
    weights.write(bare, replace(weights.read(SHIPPED), made={}))
    assert "nobody has said how" in run("info", bare).out
    assert '"kind": "weights"' in run("info", "--json", path).out
