"""HDF5 and MCAP: equal content, equal bytes, streaming, and damage that never passes."""

from __future__ import annotations

import io
import os
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from mcap.writer import Writer

from echoset import formats
from echoset.formats import leaves
from echoset.formats.windows import part
from echoset.models.errors import FormatError

FORMATS = ("h5", "mcap")


def assert_equal(first, second):
    a, b = leaves.of(first), leaves.of(second)
    assert a.keys() == b.keys()
    for path, leaf in a.items():
        if isinstance(leaf, np.ndarray):
            assert leaf.dtype == b[path].dtype
            np.testing.assert_array_equal(leaf, b[path], err_msg=path)
        else:
            assert leaf == b[path] and type(leaf) is type(b[path]), path


@pytest.mark.parametrize("format", FORMATS)
def test_reading_gives_what_was_written(recording, estimates, tmp_path, format):
    carried = replace(estimates, recording=recording)
    for k, record in enumerate((recording, estimates, carried)):
        path = tmp_path / f"{k}.{format}"
        formats.write(record, path, format)
        assert_equal(formats.read(path), record)


@pytest.mark.parametrize("kind", ["recording", "estimates", "carried"])
def test_conversion_there_and_back_gives_equal_bytes(recording, estimates, tmp_path, kind):
    carried = replace(estimates, recording=recording)
    record = {"recording": recording, "estimates": estimates, "carried": carried}[kind]
    h5, mcap = tmp_path / "a.h5", tmp_path / "a.mcap"
    formats.write(record, h5, "h5")
    formats.write(formats.read(h5), mcap, "mcap")
    formats.write(formats.read(mcap), tmp_path / "b.h5", "h5")
    assert h5.read_bytes() == (tmp_path / "b.h5").read_bytes()
    formats.write(record, tmp_path / "b.mcap", "mcap")
    assert mcap.read_bytes() == (tmp_path / "b.mcap").read_bytes()
    digests = ("content_digest", "observed_digest")
    assert [formats.summary(h5)[d] for d in digests] == [formats.summary(mcap)[d] for d in digests]


@pytest.mark.parametrize("format", FORMATS)
def test_step_by_step_gives_the_bytes_of_the_whole(estimates, tmp_path, format):
    formats.write(estimates, tmp_path / "whole", format)
    writer = formats.writer(tmp_path / "steps", format)
    for k in range(len(estimates.objects.time_ns)):
        writer.append(part(estimates, k, k + 1))
    writer.close(estimates.meta)
    assert (tmp_path / "whole").read_bytes() == (tmp_path / "steps").read_bytes()


@pytest.mark.parametrize("format", FORMATS)
def test_who_holds_frames_changes_no_byte(recording, tmp_path, format):
    """As the profilers of Dask workers and of debuggers do, here and there."""
    formats.write(recording, tmp_path / "a", format)
    held: list[object] = []
    before = sys.getprofile()
    sys.setprofile(lambda frame, event, arg: held.append(frame))
    try:
        formats.write(recording, tmp_path / "b", format)
    finally:
        sys.setprofile(before)
    assert len(held) > 1000
    held.clear()
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


@pytest.mark.parametrize("format", FORMATS)
def test_streaming_yields_the_scans_without_evaluation_columns(recording, tmp_path, format):
    path = tmp_path / "a"
    formats.write(recording, path, format)
    source = formats.open_source(path)
    scans = list(source.scans())
    source.close()
    expected = list(recording.scans())
    assert len(scans) == len(expected) == 330
    for scan, other in zip(scans, expected, strict=True):
        assert (scan.stream, scan.time_ns) == (other.stream, other.time_ns)
        assert scan.rows.keys() == other.rows.keys()
        assert not any(name.startswith("origin") for name in scan.rows)
        for columns, others in ((scan.scan, other.scan), (scan.rows, other.rows)):
            for name, values in columns.items():
                np.testing.assert_array_equal(values, others[name])
    assert source.setup.truth is None and not source.setup.meta.provenance
    assert source.observed_digest == formats.observed_digest(recording)


def test_observed_digest_ignores_truth_and_sees_measurements(recording):
    digest = formats.observed_digest(recording)
    assert formats.observed_digest(replace(recording, truth=None)) == digest
    assert formats.observed_digest(recording.observed()) == digest
    uwb = recording.streams["uwb"]
    moved = replace(uwb, rows={**uwb.rows, "distance": uwb.rows["distance"] + 1e-9})
    changed = replace(recording, streams={**recording.streams, "uwb": moved})
    assert formats.observed_digest(changed) != digest


def test_mcap_passes_through_a_pipe(recording):
    read, write = os.pipe()
    if os.fork() == 0:
        os.close(read)
        with os.fdopen(write, "wb") as out:
            formats.write(recording, out, "mcap")
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as file:
        source = formats.open_source(file, keep=True)
        assert len(list(source.scans())) == 330
        assert_equal(source.recording(), recording)
    os.wait()


def exhaust(path: Path) -> None:
    """Read by both ways in: whole, and scan by scan."""
    with pytest.raises(FormatError) as error:
        formats.read(path)
    assert "\n" not in str(error.value) and str(error.value).startswith(str(path))
    with pytest.raises(FormatError):
        source = formats.open_source(path)
        try:
            list(source.scans())
            source.recording()
        finally:
            source.close()


@pytest.mark.parametrize("format", FORMATS)
def test_truncation_anywhere_is_refused(recording, tmp_path, format):
    formats.write(recording, tmp_path / "a", format)
    data = (tmp_path / "a").read_bytes()
    cuts = [0, 4, 8, 100, *(len(data) * k // 7 for k in range(1, 7)), len(data) - 1]
    for cut in cuts:
        (tmp_path / "cut").write_bytes(data[:cut])
        exhaust(tmp_path / "cut")
    (tmp_path / "cut").write_bytes(data + b"junk")
    exhaust(tmp_path / "cut")


@pytest.mark.parametrize("format", FORMATS)
def test_no_flipped_bit_changes_content_unseen(recording, tmp_path, format):
    formats.write(recording, tmp_path / "a", format)
    data = bytearray((tmp_path / "a").read_bytes())
    expected = leaves.content_digest(recording)
    rng = np.random.default_rng(3)
    refused = 0
    for bit in rng.integers(0, 8 * len(data), 150):
        data[bit // 8] ^= 1 << (bit % 8)
        (tmp_path / "b").write_bytes(data)
        data[bit // 8] ^= 1 << (bit % 8)
        try:
            record = formats.read(tmp_path / "b")
        except FormatError:
            refused += 1
        else:
            assert leaves.content_digest(record) == expected
    assert refused > 30


def edit(path: Path, change) -> None:
    with h5py.File(path, "r+") as file:
        change(file)


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (lambda f: f["streams/uwb/rows/distance"].attrs.modify("units", "cm"), "distance"),
        (lambda f: f["streams/uwb/rows/distance"].__setitem__(0, 1.0), "distance"),
        (lambda f: f["streams/uwb/model"].attrs.modify("mean_clutter", 6.0), "mean_clutter"),
        (lambda f: f["sensors/A1/position"].__setitem__((0, 0), 9.0), "position"),
        (lambda f: f["streams/uwb"].__setitem__("loop", f["streams"]), "deep"),
        (lambda f: f.__setitem__("link", h5py.ExternalLink("/etc/passwd", "/")), "link"),
        (lambda f: f.__setitem__("link", h5py.SoftLink("/streams")), "link"),
        (lambda f: f.create_dataset("bomb", (10**12,), "f8", chunks=(1024,)), "bomb"),
        (lambda f: f.attrs.modify("format_version", 99), "format_version"),
        (lambda f: f["truth"].__delitem__("objects"), "truth"),
    ],
)
def test_edited_hdf5_is_refused_with_its_place(recording, tmp_path, change, where):
    path = tmp_path / "a.h5"
    formats.write(recording, path, "h5")
    edit(path, change)
    with pytest.raises(FormatError, match=where):
        formats.read(path)


def test_other_files_are_refused(tmp_path):
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["x"] = np.arange(3)
    (tmp_path / "text").write_text("not a recording\n")
    (tmp_path / "empty").touch()
    for name in ("foreign.h5", "text", "empty", "missing", "."):
        with pytest.raises(FormatError):
            formats.read(tmp_path / name)
    with pytest.raises(FormatError):
        formats.read(io.BytesIO(b"1234"))


def test_mcap_bomb_is_refused(tmp_path):
    path = tmp_path / "bomb.mcap"
    with path.open("wb") as out:
        writer = Writer(out, chunk_size=1 << 30)
        writer.start()
        schema = writer.register_schema("s", "jsonschema", b"{}")
        channel = writer.register_channel("/t", "json", schema)
        for _ in range(33):
            writer.add_message(channel, 0, bytes(1 << 23), 0)
        writer.finish()
    assert path.stat().st_size < 1 << 20
    with pytest.raises(FormatError, match="declares"):
        formats.read(path)


def test_invalid_records_are_not_written(recording, tmp_path):
    uwb = recording.streams["uwb"]
    distance = uwb.rows["distance"].copy()
    distance[3] = np.nan
    broken = replace(uwb, rows={**uwb.rows, "distance": distance})
    with pytest.raises(FormatError, match=r"distance\[3\]"):
        formats.write(replace(recording, streams={"uwb": broken}), tmp_path / "a", "h5")
