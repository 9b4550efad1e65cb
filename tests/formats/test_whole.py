"""A format that knows whole records only gives the same in windows as one that knows windows."""

from __future__ import annotations

import sys
from contextlib import closing
from dataclasses import replace

import pytest

from echoset import formats
from echoset.formats import hdf5, leaves
from echoset.formats import windows as steps
from echoset.formats.whole import WholeWriter
from echoset.models.errors import FormatError


def found(path, **how):
    """Digests of head and windows."""
    with closing(formats.open_windows(path, **how)) as parts:
        digests = [leaves.content_digest(record) for record in (parts.head, *parts)]
        assert parts.progress[0] == parts.progress[1] > 0
        return parts.has_recording, digests


@pytest.fixture(params=[16, 1024])
def plain(request, monkeypatch):
    """Takes windows away from HDF5, once it is called."""
    monkeypatch.setattr(steps, "WINDOW", request.param)

    def take() -> None:
        windows = hdf5.windows

        def read(source, path):
            (record,) = windows(source, path, size=sys.maxsize)
            parts = windows(source, path)
            beside = windows(source, path, True, size=sys.maxsize) if parts.has_recording else None
            return replace(record, recording=next(iter(beside))) if beside else record

        monkeypatch.setattr(hdf5, "read", read, raising=False)
        for name in ("windows", "header", "oddities"):
            monkeypatch.delattr(hdf5, name)

    return take


def test_windows_are_the_same(recording, estimates, tmp_path, plain):
    carrying = replace(estimates, recording=recording)
    records = {"recording": recording, "estimates": estimates, "both": carrying}
    asked = [(name, {}) for name in records]
    asked += [("both", {"recording": True})]
    for name, record in records.items():
        formats.write(record, tmp_path / name, "h5")
    before = [found(tmp_path / name, **how) for name, how in asked]
    stamped = formats.header(tmp_path / "recording")
    plain()
    assert [found(tmp_path / name, **how) for name, how in asked] == before
    whole = formats.header(tmp_path / "recording")
    assert {k: str(whole[k]) for k in stamped} == {k: str(v) for k, v in stamped.items()}
    assert list(formats.oddities(tmp_path / "recording")) == []
    with pytest.raises(FormatError, match="no recording"):
        formats.open_windows(tmp_path / "estimates", recording=True)


@pytest.mark.parametrize("truth", [True, False])
def test_gathered_windows_make_the_bytes_of_the_whole(recording, tmp_path, monkeypatch, truth):
    monkeypatch.setattr(steps, "WINDOW", 16)
    record = recording if truth else replace(recording, truth=None)
    formats.write(record, tmp_path / "whole", "h5")
    writer = WholeWriter(
        lambda record, target: formats.write(record, target, "h5"), tmp_path / "parts"
    )
    windows = list(steps.windows(record))
    assert len(windows) > 10
    for window in windows:
        writer.append(window)
    writer.close(record.meta)
    assert (tmp_path / "parts").read_bytes() == (tmp_path / "whole").read_bytes()
