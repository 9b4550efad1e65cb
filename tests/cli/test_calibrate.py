"""``echoset calibrate``: a table, parameters that ``estimate --config`` takes, and a picture."""

import numpy as np
import pytest
import yaml
from support.sensors import radar, uwb

from echoset import formats
from echoset.models.records import Recording


def kept(recording: Recording, path):
    formats.write(recording, path, "h5")
    return path


@pytest.fixture
def late(tmp_path):
    return kept(radar(1, scans=60)[0], tmp_path / "late.h5")


def test_parameters_that_estimate_takes(run, late, tmp_path):
    done = run("calibrate", late, "-o", tmp_path / "s.yaml", "--plot", tmp_path / "p.svg")
    assert done.code == 0 and done.err == ""
    assert "latency" in done.out and "residuals of either half" in done.out
    text = (tmp_path / "s.yaml").read_text()
    assert text.startswith("# Sensors by echoset calibrate from radar-1.\nsensors:\n  R:\n")
    found = yaml.safe_load(text)["sensors"]["R"]
    assert found["latency"] == pytest.approx(0.8, abs=0.1)
    assert found["registration"] == pytest.approx([3.0, -2.0], abs=1.5)
    assert found["p_detect"] == pytest.approx(0.85, abs=0.1)
    assert b"<svg" in (tmp_path / "p.svg").read_bytes()
    config = ("--config", tmp_path / "s.yaml", "--set", "clutter_region=[-1000,1000,-1000,1000]")
    done = run("estimate", "-e", "pmb", late, "-o", tmp_path / "est.h5", *config)
    assert (done.code, done.err) == (0, "")
    made = formats.read(tmp_path / "est.h5")
    own = made.meta.provenance["parameters"]["sensors"]["R"]
    assert own["latency"] == found["latency"]
    assert made.objects.time_ns[0] == 5 * 10**9 - round(found["latency"] * 1e9)


def test_truth_from_elsewhere_and_stdout(run, late, tmp_path):
    whole = run("calibrate", late, "-o", "-").out
    assert yaml.safe_load(whole)["sensors"]["R"]["std_position"] > 0
    blind = kept(formats.read(late).observed(), tmp_path / "blind.h5")
    done = run("calibrate", blind, "-o", "-")
    assert done.code == 4 and "has no truth" in done.err
    assert run("calibrate", blind, "--truth", late, "-o", "-").out == whole
    other = kept(radar(2, scans=60)[0], tmp_path / "other.h5")
    assert run("calibrate", blind, "--truth", other, "-o", "-").code == 4


def test_equal_inputs_give_equal_bytes(run, late, tmp_path):
    for name in "ab":
        words = ("-o", tmp_path / f"{name}.yaml", "--plot", tmp_path / f"{name}.png", "-q")
        assert run("calibrate", late, *words).code == 0
    for suffix in (".yaml", ".png"):
        a, b = ((tmp_path / f"{name}{suffix}").read_bytes() for name in "ab")
        assert a == b


def test_uwb(run, tmp_path):
    ranges = kept(uwb(1)[0], tmp_path / "uwb.h5")
    done = run("calibrate", ranges, "-o", tmp_path / "u.yaml", "--plot", tmp_path / "u.png")
    assert (done.code, done.err) == (0, "")
    found = yaml.safe_load((tmp_path / "u.yaml").read_text())
    assert found["sigma"] == pytest.approx(0.08, abs=0.01)
    assert found.keys() == {"sigma", "range_bias", "mean_clutter", "device_height"}
    assert "offset A4" in done.out and "scale" in done.out
    config = ("--config", tmp_path / "u.yaml", "--set", "particles=200", "--set", "max_range=20")
    done = run("estimate", "-e", "position", ranges, "-o", tmp_path / "e.h5", *config)
    assert done.code == 0, done.err


def test_refused(run, late, tmp_path):
    for words, code, said in (
        ((late, "-o", late), 2, "is an input too"),
        ((late, "-o", "-", "--plot", "x.gif"), 2, "pictures are written as"),
        ((late, "-o", "-", "--stream", "Q"), 4, "no stream to calibrate; there are R"),
        ((late, "-o", "-", "--set", "reech=3"), 2, "did you mean 'reach'"),
        ((tmp_path / "none.h5", "-o", "-"), 4, "none.h5"),
    ):
        done = run("calibrate", *words)
        assert done.code == code and said in done.err, done.err
    (tmp_path / "there.yaml").write_text("")
    assert run("calibrate", late, "-o", tmp_path / "there.yaml").code == 5
    assert np.all(run("calibrate", late, "-o", tmp_path / "there.yaml", "--overwrite").code == 0)
