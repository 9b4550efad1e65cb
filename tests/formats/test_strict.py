"""What changes no content but is not as we write it: sound files pass, every change shows."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import h5py
import pytest
from mcap.writer import CompressionType, Writer

from echoset import formats


@pytest.mark.parametrize("format", ["h5", "mcap"])
def test_what_we_write_is_strict(recording, estimates, tmp_path, format):
    for record in (recording, estimates, replace(estimates, recording=recording)):
        formats.write(record, tmp_path / "a", format)
        assert list(formats.oddities(tmp_path / "a")) == []


@pytest.mark.parametrize(
    ("edit", "where", "reason"),
    [
        (lambda f: f.create_group("streams/uwb/extra"), "streams/uwb/extra", "empty group"),
        (lambda f: f["provenance"].attrs.update(units="m"), "provenance", "attributes"),
    ],
)
def test_h5(recording, tmp_path, edit, where, reason):
    formats.write(recording, tmp_path / "a.h5", "h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        edit(file)
    formats.read(tmp_path / "a.h5")
    ((place, found),) = formats.oddities(tmp_path / "a.h5")
    assert place == where and reason in found


def test_h5_without_checksums(recording, tmp_path):
    formats.write(recording, tmp_path / "a.h5", "h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        old = file["truth/objects/label"]
        values, attrs = old[()], dict(old.attrs)
        del file["truth/objects/label"]
        new = file.create_dataset("truth/objects/label", data=values)
        for name, text in attrs.items():
            new.attrs.create(name, text, dtype=f"S{len(text)}")
    formats.read(tmp_path / "a.h5")
    assert list(formats.oddities(tmp_path / "a.h5")) == [
        ("truth/objects/label", "has no checksums")
    ]


@pytest.fixture
def meddled(monkeypatch, tmp_path):
    """Write a file whose messages are changed on their way, the fifth of each topic."""

    def write(record, change):
        original, count = Writer.add_message, Counter()

        def add(self, channel, log_time, data, publish_time, sequence):
            count[channel] += 1
            message = {"data": data, "publish_time": publish_time, "sequence": sequence}
            if count[channel] == 5:
                message |= change(**message)
            original(self, channel, log_time, **message)

        with monkeypatch.context() as patch:
            patch.setattr(Writer, "add_message", add)
            formats.write(record, tmp_path / "a.mcap", "mcap")
        return tmp_path / "a.mcap"

    return write


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda sequence, **_: {"sequence": sequence + 1}, "has sequence number 6, not 5"),
        (lambda publish_time, **_: {"publish_time": 0}, "published at another time"),
    ],
)
def test_mcap_numbers_of_messages(estimates, meddled, change, reason):
    path = meddled(estimates, change)
    formats.read(path)
    ((place, found),) = formats.oddities(path)
    assert reason in f"{place} {found}" and "4000000000 ns" in place


def test_mcap_drawing_that_the_content_does_not_give(estimates, meddled):
    path = meddled(estimates, lambda data, **_: {} if data[:1] == b"{" else {"data": data[:-1]})
    formats.read(path)
    ((place, reason),) = formats.oddities(path)
    assert "/estimates/example/" in place and reason == "is not what the content gives"


def test_mcap_without_checksums_and_with_strange_attachments(recording, tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"

    def start(self, **kwargs):
        original(self, **kwargs)
        self.add_attachment(0, 0, "notes", "text/plain", b"")

    original = Writer.start
    init = Writer.__init__
    monkeypatch.setattr(
        Writer,
        "__init__",
        lambda self, output, **kwargs: init(
            self, output, compression=CompressionType.LZ4, enable_crcs=False
        ),
    )
    formats.write(recording, path, "mcap")
    monkeypatch.undo()
    assert [place for place, _ in formats.oddities(path)] == ["chunk", "data", "summary"]
    monkeypatch.setattr(Writer, "start", start)
    formats.write(recording, path, "mcap")
    monkeypatch.undo()
    ((place, _),) = formats.oddities(path)
    assert place == "attachment notes at 0 ns"
