"""What is legal is one question for all formats, readers and writers."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import replace

import h5py
import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from echoset import formats
from echoset.formats import leaves
from echoset.models.checks import check, check_objects
from echoset.models.errors import FormatError
from echoset.models.records import Meta

FORMATS = ("h5", "mcap")


@pytest.fixture
def unchecked(monkeypatch, tmp_path):
    """Write a record with right digests and another provenance, whatever is in it."""

    def write(record, form, text=None):
        with monkeypatch.context() as patch:
            patch.setattr(formats.files, "check", lambda record: None)
            if text is not None:
                patch.setattr(leaves, "json_of", lambda provenance: text)
            formats.write(record, tmp_path / f"a.{form}", form)
        return tmp_path / f"a.{form}"

    return write


def refused(path, *words):
    """Each way to read refuses it in the same place."""
    found = []

    def scan():
        with closing(formats.open_source(path)) as source:
            list(source.scans())

    for read in (lambda: formats.read(path), lambda: formats.summary(path), scan):
        with pytest.raises(FormatError) as caught:
            read()
        found.append((caught.value.where, caught.value.reason))
    assert len(set(found)) == 1 and all(word in str(found[0]) for word in words), found


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "not JSON"),
        ("{", "not JSON"),
        ("[]", "not a JSON object"),
        ("3", "not a JSON object"),
        ('{"a": NaN}', "NaN is not a finite number"),
        ('{"a": 1e999}', "1e999 is not a finite number"),
        ('{"a": %s}' % ("9" * 6000), "is not a finite number"),
        ('{"a":' * 100 + "1" + "}" * 100, "nested too deeply"),
        ('{"a":' * 100_000, "nested too deeply"),
        ('{"a": 1, "a": 2}', "twice"),
    ],
    ids=["empty", "open", "list", "number", "NaN", "1e999", "digits", "deep", "deeper", "twice"],
)
def test_provenance_that_is_no_plain_object(recording, unchecked, form, text, word):
    refused(unchecked(recording, form, text), "provenance", word)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("name", ["a\nb", "\x1b[31m", "a\u202eb", "\x9b", "=1+1"])
def test_names_that_cannot_be_shown(recording, unchecked, form, name):
    record = replace(recording, meta=replace(recording.meta, name=name))
    with pytest.raises(FormatError, match="name: "):
        formats.write(record, unchecked(recording, form), form)
    refused(unchecked(record, form), "name")


def test_halves_of_characters(recording, tmp_path):
    with pytest.raises(FormatError, match="frame: "):
        check(replace(recording, meta=Meta("x", frame="\ud800")))


def covariance(objects, P):
    return replace(objects, covariance=np.broadcast_to(P, (len(objects.label), 4, 4)).copy())


@pytest.mark.parametrize("form", FORMATS)
def test_covariances_are_semidefinite(recording, estimates, unchecked, tmp_path, form):
    """By what the entries mean: no weighted sum of the state may have a negative variance."""
    one = np.eye(4)
    bad = one.copy()
    bad[0, 1] = bad[1, 0] = 1.5
    units = np.diag([1e6, 1e-6, 1.0, 1e3])
    rank = np.outer([1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0])
    weights = np.array([1.0, -1.0, 0.0, 0.0])
    assert weights @ bad @ weights < 0
    for good in (one, rank, units @ rank @ units, np.zeros((4, 4)), 1e-300 * one):
        check_objects(covariance(estimates.objects, good), "objects")
    flat = np.diag([0.0, 1.0, 1.0, 1.0])
    flat[0, 1] = flat[1, 0] = 0.1
    for wrong in (bad, units @ bad @ units, flat):
        record = replace(estimates, objects=covariance(estimates.objects, wrong))
        with pytest.raises(FormatError, match=r"covariance\[0, 0\]"):
            formats.write(record, tmp_path / "b", form)
        with pytest.raises(FormatError, match="semidefinite"):
            formats.read(unchecked(record, form))


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize(
    ("steps", "word"),
    [
        ({"label": np.zeros(1500)}, "name of a column"),
        ({"time_ns": np.zeros(1500)}, "name of a column"),
        ({"a/b": np.zeros(1500)}, "not a legal name"),
        ({"half": np.zeros(1500, "f2")}, "array of numbers"),
        ({"big": np.zeros(1500, ">f8")}, "array of numbers"),
    ],
)
def test_steps_that_not_all_formats_hold(estimates, tmp_path, form, steps, word):
    with pytest.raises(FormatError, match=word):
        formats.write(replace(estimates, steps=steps), tmp_path / "a", form)


@pytest.mark.parametrize("form", FORMATS)
def test_steps_of_every_type_that_formats_hold(estimates, tmp_path, form):
    types = ("?", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "f4", "f8")
    steps = {f"of {t}": (np.arange(3000).reshape(1500, 2) % 2).astype(t) for t in types}
    formats.write(replace(estimates, steps=steps), tmp_path / "a", form)
    found = formats.read(tmp_path / "a").steps
    for name, values in steps.items():
        assert found[name].dtype == values.dtype
        np.testing.assert_array_equal(found[name], values)


@pytest.mark.parametrize("form", FORMATS)
@pytest.mark.parametrize("value", [2**64, 10**400, -(2**63) - 1])
def test_integers_that_do_not_fit(recording, tmp_path, form, value):
    uwb = replace(recording.streams["uwb"], model={"p": value})
    with pytest.raises(FormatError, match="model/p: is an integer"):
        formats.write(replace(recording, streams={"uwb": uwb}), tmp_path / "a", form)


def test_times_up_to_the_ends_of_their_type(recording, tmp_path):
    ends = np.iinfo(np.int64)
    stream = recording.streams["bearing"].part(0, 2)
    stream = replace(stream, time_ns=np.array([ends.min, ends.max]))
    record = replace(recording, streams={"bearing": stream}, truth=None)
    formats.write(record, tmp_path / "a.h5", "h5")
    with closing(formats.open_source(tmp_path / "a.h5")) as source:
        assert [s.time_ns for s in source.scans()] == [ends.min, ends.max]


@pytest.mark.parametrize(
    "options",
    [
        {"index_types": IndexType.NONE},
        {
            "index_types": IndexType.NONE,
            "repeat_channels": False,
            "repeat_schemas": False,
            "use_statistics": False,
            "use_summary_offsets": False,
        },
        {"use_chunking": False},
        {"compression": CompressionType.NONE},
    ],
    ids=["no index", "no summary", "no chunks", "plain"],
)
def test_legal_mcap_is_read_in_every_way(recording, estimates, tmp_path, monkeypatch, options):
    """The end tells nothing of where things are; the summary of the second is empty."""
    original = Writer.__init__
    monkeypatch.setattr(
        Writer, "__init__", lambda self, out, **kwargs: original(self, out, **kwargs | options)
    )
    path = tmp_path / "a.mcap"
    for record in (recording, estimates, replace(estimates, recording=recording)):
        formats.write(record, path, "mcap")
        digest = leaves.content_digest(record)
        assert leaves.content_digest(formats.read(path)) == digest
        assert formats.header(path)["content_digest"] == digest
        assert formats.summary(path)["content_digest"] == digest
        with closing(formats.open_windows(path)) as parts:
            assert parts.has_recording == (getattr(record, "recording", None) is not None)
            assert sum(1 for _ in parts) > 0


def test_mcap_out_of_the_order_of_time(recording, tmp_path, monkeypatch):
    """A stream that stands after the others, though its scans are before."""
    add, held = Writer.add_message, []

    def later(self, channel, log_time, *args, **kwargs):
        held.append((channel, log_time, args, kwargs))

    def finish(self):
        for channel, log_time, args, kwargs in sorted(held, key=lambda m: m[0]):
            add(self, channel, log_time, *args, **kwargs)
        original(self)

    original = Writer.finish
    monkeypatch.setattr(Writer, "add_message", later)
    monkeypatch.setattr(Writer, "finish", finish)
    formats.write(recording, tmp_path / "a.mcap", "mcap")
    refused(tmp_path / "a.mcap", "out of order")


def test_foreign_hdf5_is_called_so(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["x"] = np.arange(3)
    for read in (formats.read, formats.header, formats.summary):
        with pytest.raises(FormatError, match=r"not a file of echoset: Conventions .* --from"):
            read(path)


def test_what_is_no_leaf_is_refused(recording, tmp_path):
    """A group where an array belongs, and an array where a group belongs."""
    whole = leaves.of(recording)
    for path in ("streams", "streams/uwb", "streams/uwb/rows", "truth", "truth/objects/state/x"):
        with pytest.raises(FormatError, match="has no place"):
            leaves.record({**whole, path: np.zeros(3)}, "a")
    for path, value in (
        ("name", 3),
        ("kind", np.zeros(2)),
        ("sensors/A1/object", True),
        ("sensors/A1/object", 1.0),
        ("streams/uwb/nodes", "A1"),
        ("streams/uwb/time_ns", 3),
        ("streams/uwb/time_ns", np.zeros(())),
        ("streams/uwb/model/p", np.float64(3.0)),
    ):
        with pytest.raises(FormatError, match=f"a: {path}: "):
            leaves.record({**whole, path: value}, "a")
    assert json.loads(json.dumps(leaves.digests(whole))) == leaves.digests(leaves.of(recording))
