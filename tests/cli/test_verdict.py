"""The same bytes get the same verdict, whatever reads them, from a file or from a pipe."""

from __future__ import annotations

import io
import subprocess
from dataclasses import replace

import pytest

from echoset import formats
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
