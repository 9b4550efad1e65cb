"""Records in windows: the same content and the same bytes as whole, whatever the window."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from itertools import pairwise

import h5py
import numpy as np
import pytest

from echoset import formats
from echoset.formats import leaves
from echoset.formats import windows as steps
from echoset.models.errors import FormatError
from echoset.models.records import Estimates, Objects

FORMATS = ("h5", "mcap")


@pytest.fixture(params=[16, 1024], autouse=True)
def window(request, monkeypatch):
    """Windows smaller and larger than the record."""
    monkeypatch.setattr(steps, "WINDOW", request.param)
    return request.param


def digest(record):
    return leaves.content_digest(record)


@pytest.mark.parametrize("source", FORMATS)
@pytest.mark.parametrize("target", FORMATS)
def test_a_recording_passed_on_in_windows_has_the_bytes_of_the_whole(
    recording, tmp_path, window, source, target
):
    formats.write(recording, tmp_path / "a", source)
    formats.write(recording, tmp_path / "whole", target)
    writer = formats.writer(tmp_path / "parts", target)
    with closing(formats.open_windows(tmp_path / "a")) as parts:
        count = 0
        for part in parts:
            writer.append(part)
            count += 1
        done, total = parts.progress
        writer.close(parts.head.meta)
    assert done == total and (count > 20) == (window == 16)
    assert (tmp_path / "whole").read_bytes() == (tmp_path / "parts").read_bytes()


def test_windows_hold_all_of_a_time_and_nothing_twice(recording, window):
    found = list(steps.windows(recording))
    for name, stream in recording.streams.items():
        times = [w.streams[name].time_ns for w in found]
        np.testing.assert_array_equal(np.concatenate(times), stream.time_ns)
        for before, after in pairwise(times):
            assert not set(before.tolist()) & set(after.tolist())
    sizes = [sum(map(len, w.streams.values())) + len(w.truth.objects.time_ns) for w in found]
    assert sum(sizes) == 350 and min(sizes[:-1], default=window) >= window - 1


@pytest.mark.parametrize("format", FORMATS)
def test_estimates_and_the_recording_that_they_carry(recording, estimates, tmp_path, format):
    path = tmp_path / "a"
    formats.write(replace(estimates, recording=recording), path, format)
    with closing(formats.open_windows(path)) as parts:
        assert parts.has_recording and parts.head.meta.provenance == estimates.meta.provenance
        assert len(parts.head.objects.time_ns) == 0
        assert digest(steps.concatenate(list(parts))) == digest(estimates)
    with closing(formats.open_windows(path, recording=True)) as parts:
        truth = Objects.join([w.truth.objects for w in parts])
        assert all(len(s) == 0 for s in parts.head.streams.values())
        np.testing.assert_array_equal(truth.state, recording.truth.objects.state)
    formats.write(recording, path, format)
    with pytest.raises(FormatError):
        formats.open_windows(path, recording=True)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("place", np.linspace(0.05, 0.95, 7))
def test_damage_shows_at_the_end_at_the_latest(recording, tmp_path, format, place):
    path = tmp_path / "a"
    formats.write(recording, path, format)
    data = bytearray(path.read_bytes())
    data[int(len(data) * place)] ^= 4
    path.write_bytes(data)
    try:
        with closing(formats.open_windows(path)) as parts:
            found = list(parts)
    except FormatError as error:
        assert str(error).startswith(str(path)) and error.where
    else:
        assert all(digest(r) for r in found)
        assert digest(formats.read(path)) == digest(recording)


@pytest.mark.parametrize("format", FORMATS)
def test_stamp_tells_kind_and_digests(recording, estimates, tmp_path, format):
    for record in (recording, estimates):
        path = tmp_path / "a"
        formats.write(record, path, format)
        found, whole = formats.header(path), formats.summary(path)
        kind = "estimates" if isinstance(record, Estimates) else "recording"
        assert found["kind"] == kind == whole["kind"]
        assert all(found[k] == whole[k] for k in ("content_digest", "observed_digest"))
    (tmp_path / "a").write_bytes((tmp_path / "a").read_bytes()[:-9])
    with pytest.raises(FormatError):
        formats.header(tmp_path / "a")


def test_index_that_does_not_fit_its_times(recording, tmp_path, monkeypatch):
    """A file with right digests whose times go back."""
    uwb = recording.streams["uwb"]
    back = replace(uwb, time_ns=uwb.time_ns[::-1].copy())
    monkeypatch.setattr(formats.files, "check", lambda record: None)
    monkeypatch.setattr("echoset.formats.files.windows", lambda record: [record])
    formats.write(replace(recording, streams={"uwb": back}), tmp_path / "a", "h5")
    parts = formats.open_windows(tmp_path / "a")
    with closing(parts), pytest.raises(FormatError, match="out of order"):
        list(parts)


def test_h5_without_vlen_text_or_odd_header(recording, tmp_path):
    formats.write(recording, tmp_path / "a.h5", "h5")
    for name in ("Conventions", "observed_digest"):
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            kept = file.attrs[name]
            file.attrs[name] = np.bytes_(b"other")
        with pytest.raises(FormatError, match=name):
            formats.read(tmp_path / "a.h5")
        with h5py.File(tmp_path / "a.h5", "r+") as file:
            file.attrs[name] = np.bytes_(kept)
    formats.read(tmp_path / "a.h5")
