"""``convert --recover``: what comes before the damage, and an exit code that says so."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from echoset import formats


@pytest.fixture
def whole(rec, tmp_path, monkeypatch):
    """A recording in chunks of a few messages."""
    from mcap.writer import Writer

    original = Writer.__init__
    monkeypatch.setattr(
        Writer,
        "__init__",
        lambda self, output, **kwargs: original(self, output, chunk_size=4096, **kwargs),
    )
    formats.write(formats.read(rec), tmp_path / "whole.mcap", "mcap")
    return tmp_path / "whole.mcap"


def recovered(run, path, tmp_path, form="h5"):
    out = tmp_path / f"out.{form}"
    result = run("convert", "--recover", path, "-o", out, "--overwrite")
    return result, out


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_a_truncated_file_gives_its_beginning(run, whole, tmp_path, form):
    data, record = whole.read_bytes(), formats.read(whole)
    counts = []
    for share in (0.1, 0.25, 0.4):
        (tmp_path / "cut.mcap").write_bytes(data[: int(len(data) * share)])
        result, out = recovered(run, tmp_path / "cut.mcap", tmp_path, form)
        assert result.code == 3 and result.err.count("\n") == 1, result
        found = formats.read(out)
        note = found.meta.provenance["recovered"]
        assert f"cut.mcap: recovered {note['messages']} messages" in result.err
        assert note["file"] == "cut.mcap" and "ends in the middle" in note["damage"]
        n = len(found.streams["uwb"])
        counts.append(n)
        for name in ("time_ns", "row_offset"):
            original = getattr(record.streams["uwb"], name)
            np.testing.assert_array_equal(
                getattr(found.streams["uwb"], name), original[: n + (name != "time_ns")]
            )
        assert (
            len(found.truth.objects.time_ns) + n + len(found.truth.blocked_time_ns)
            == note["messages"]
        )
        assert run("validate", "--strict", out).code == 0
    assert 0 < counts[0] < counts[1] < counts[2] < len(record.streams["uwb"])


def test_a_whole_file_is_converted_as_ever(run, whole, tmp_path):
    result, out = recovered(run, whole, tmp_path)
    assert result.code == 0
    assert "recovered" not in formats.read(out).meta.provenance
    assert formats.summary(out)["content_digest"] == formats.summary(whole)["content_digest"]


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_only_the_end_is_missing(run, whole, tmp_path, form):
    """All content is there, and so is where it comes from."""
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-1])
    result, out = recovered(run, tmp_path / "cut.mcap", tmp_path, form)
    found, record = formats.read(out), formats.read(whole)
    assert result.code == 3 and found.meta.provenance.pop("recovered")
    assert found.meta.provenance == record.meta.provenance
    assert formats.observed_digest(found) == formats.observed_digest(record)


@pytest.mark.parametrize("size", [0, 8, 50, 300])
def test_nothing_to_be_had(run, whole, tmp_path, size):
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:size])
    result, out = recovered(run, tmp_path / "cut.mcap", tmp_path)
    assert result.code == 4 and result.err.count("\n") == 1 and not out.exists()


def test_damage_in_the_middle(run, whole, tmp_path):
    data = bytearray(whole.read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "cut.mcap").write_bytes(data)
    result, out = recovered(run, tmp_path / "cut.mcap", tmp_path)
    assert result.code == 3 and formats.read(out).meta.provenance["recovered"]["damage"]


def test_estimates_with_their_recording(run, whole, rec, tmp_path):
    assert run("estimate", "-e", "mean", rec, "-o", tmp_path / "e.mcap").code == 0
    both = replace(formats.read(tmp_path / "e.mcap"), recording=formats.read(rec))
    formats.write(both, tmp_path / "e.mcap", "mcap")
    data = (tmp_path / "e.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: int(len(data) * 0.6)])
    result, out = recovered(run, tmp_path / "cut.mcap", tmp_path)
    found = formats.read(out)
    assert result.code == 3 and found.estimator == "mean"
    assert len(found.objects.time_ns) == 20 and 0 < len(found.recording.streams["uwb"]) < 240
    assert run("score", out, "-m", "rmse", "-o", "-").code == 0


def test_hdf5_is_lost(run, rec, tmp_path):
    (tmp_path / "cut.h5").write_bytes(rec.read_bytes()[:-1])
    result, _ = recovered(run, tmp_path / "cut.h5", tmp_path)
    assert result.code == 4 and "only MCAP can be recovered" in result.err
    assert run("convert", "--recover", "--from", "csv", rec, "-o", tmp_path / "x.h5").code == 2


def test_a_campaign_is_resumed(run, whole, tmp_path):
    """What was whole stays; what is damaged is recovered again, and the exit code says so."""
    (tmp_path / "cut.mcap").write_bytes(whole.read_bytes()[:-400])
    words = ("convert", "--recover", whole, tmp_path / "cut.mcap", "-o", f"{tmp_path}/out/")
    assert run(*words, "-j", 2).code == 3
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    assert sorted(before) == ["cut.h5", "whole.h5"]
    planned = run(*words, "--skip-existing", "--dry-run")
    assert planned.code == 0
    assert [line.split()[0] for line in planned.out.splitlines()] == ["skip", "redo"]
    assert run(*words, "--skip-existing").code == 3
    assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_strict_validation_by_command(run, whole, tmp_path):
    assert run("validate", "--strict", whole).code == 0
    info = json.loads(run("info", "--json", whole).out)
    assert info["kind"] == "recording"
    result = run("validate", "--strict", tmp_path / "none.mcap")
    assert result.code == 4
