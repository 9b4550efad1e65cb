"""The same bytes get the same verdict, whatever reads them, from a file or from a pipe."""

from __future__ import annotations

import io
import os
import subprocess
from dataclasses import replace
from unittest.mock import patch

import pytest
from mcap.writer import IndexType, Writer

from echoset import formats
from echoset.formats.mcap.windows import Windows
from echoset.models.errors import FormatError


@pytest.fixture(params=["h5", "mcap"])
def broken(request, rec, tmp_path, monkeypatch):
    """A recording with right digests in whose truth an axis is negative."""
    record = formats.read(rec)
    truth = record.truth
    axes = truth.objects.semi_axes.copy()
    axes[3, 0] = -1.0
    record = replace(record, truth=replace(truth, objects=replace(truth.objects, semi_axes=axes)))
    path = tmp_path / f"broken.{request.param}"
    with monkeypatch.context() as patch:
        patch.setattr(formats.files, "check", lambda record: None)
        formats.write(record, path, request.param)
    return path


def test_broken_truth_is_refused_in_a_pipe(command, broken, plugins):
    words = [*command, "estimate", "-e", "mean", "-", "-o", "-"]
    with broken.open("rb") as file:
        done = subprocess.run(words, stdin=file, capture_output=True)
    assert done.returncode == 4
    with pytest.raises(FormatError):
        formats.read(io.BytesIO(done.stdout))
    assert b"truth/objects/semi_axes[3, 0]" in done.stderr and done.stderr.count(b"\n") == 1


@pytest.mark.parametrize(
    "words",
    [
        ("info",),
        ("validate",),
        ("convert", "-o", "{out}/x.h5"),
        ("convert", "--recover", "-o", "{out}/y.h5"),
        ("estimate", "-e", "mean", "-o", "{out}/z.h5"),
    ],
    ids=lambda words: "-".join(words[:2]),
)
def test_broken_truth_is_refused_by_every_command(run, broken, words, tmp_path):
    (tmp_path / "out").mkdir()
    words = [word.format(out=tmp_path / "out") for word in words]
    result = run(*words, broken)
    assert result.code == 4 and result.err.count("\n") == 1, result
    assert "semi_axes[3, 0]" in result.err or "only MCAP" in result.err
    assert not list((tmp_path / "out").iterdir())


@pytest.fixture
def bare(rec, tmp_path, monkeypatch):
    """A recording in MCAP without indices, summary or checksums, which is legal."""
    original, options = Writer.__init__, {
        "index_types": IndexType.NONE, "repeat_channels": False, "repeat_schemas": False,
        "use_statistics": False, "use_summary_offsets": False, "enable_crcs": False,
    }  # fmt: skip
    with monkeypatch.context() as other:
        other.setattr(
            Writer, "__init__", lambda self, out, **kwargs: original(self, out, **kwargs | options)
        )
        formats.write(formats.read(rec), tmp_path / "bare.mcap", "mcap")
    return tmp_path / "bare.mcap"


def test_mcap_without_summary_is_read_by_every_command(run, rec, bare, tmp_path):
    for words in (
        ("info",),
        ("validate",),
        ("convert", "-o", tmp_path / "c.h5"),
        ("convert", "--recover", "-o", tmp_path / "r.h5"),
        ("estimate", "-e", "mean", "-o", tmp_path / "e.h5"),
        ("plot", "scene", "-o", tmp_path / "p.svg"),
        ("score", tmp_path / "e.h5", "-m", "rmse", "-o", tmp_path / "s.csv", "--truth"),
    ):
        result = run(*words, bare)
        assert result.code == 0, (words, result)
    for name in ("c.h5", "r.h5"):
        assert (tmp_path / name).read_bytes() == rec.read_bytes()


def test_what_recovery_can_not_tell_from_the_whole_leaves_no_output(run, bare, tmp_path):
    """Refused only as its end and its content tell differently of where it comes from."""
    data = bare.read_bytes()
    (tmp_path / "x.mcap").write_bytes(data)
    with patch.object(Windows, "_ahead", lambda self: {"": "{}"}):
        for words in (("validate",), ("convert", "--recover", "-o", tmp_path / "r.h5")):
            result = run(*words, tmp_path / "x.mcap")
            assert result.code == 4 and "does not fit the content" in result.err, result
    assert not (tmp_path / "r.h5").exists()


@pytest.mark.parametrize("name", [b"a\xffb.h5", b"a\x1b[31mb.h5", b"a\nb.h5"])
def test_names_of_files_are_shown_escaped(run, rec, tmp_path, name):
    path = tmp_path / os.fsdecode(name)
    path.write_bytes(rec.read_bytes())
    for words in (("info",), ("info", "--json"), ("validate",)):
        result = run(*words, path)
        assert result.code == 0 and "\x1b" not in result.out and result.err == ""
        assert words[0] == "info" or result.out.count("\n") == 1
    path.write_bytes(b"\x89HDF\r\n\x1a\n")
    result = run("validate", path)
    assert result.code == 4 and "\x1b" not in result.err and result.err.count("\n") == 1
