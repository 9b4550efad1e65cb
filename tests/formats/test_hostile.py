"""Small files that ask for much: memory, time, other files. Each is refused, with place and reason.

Every file is read by a process that has little room, so that what asks for memory gets none.
"""

from __future__ import annotations

import io
import json
import multiprocessing
import resource
import struct
import zipfile
import zlib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import h5py
import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, Writer

from echoset import formats
from echoset.formats import leaves, scores, weights
from echoset.formats.importers import autoferry, labyrinth
from echoset.formats.mcap.container import HEADER
from echoset.models import plain_yaml
from echoset.models.errors import FormatError, ParameterError

ROOM = 1 << 30
SECONDS = 30
"""The limit is 10; a loaded machine is given more."""


def _read(read, path, pipe):
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + ROOM,) * 2)
    try:
        read(path)
        pipe.send(("accepted", "", ""))
    except Exception as error:
        memory = isinstance(error, MemoryError) or isinstance(error.__cause__, MemoryError)
        where = getattr(error, "where", "")
        pipe.send(("memory" if memory else type(error).__name__, where, str(error)))


def refused(path, *words, read=formats.read, error=FormatError):
    """Have another process read the file, and look at how it is refused."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    process = context.Process(target=_read, args=(read, path, there))
    process.start()
    assert here.poll(SECONDS), "hangs"
    kind, where, text = here.recv()
    process.join(SECONDS)
    assert kind == error.__name__ and process.exitcode == 0, (kind, text)
    assert "\n" not in text and len(text) < 600 and (where or error is ParameterError), text
    assert all(word in text for word in words), text


def resealed(path, edit, **tokens):
    """The file after ``edit``, with other ``tokens`` (None: without) and digests that fit."""
    with h5py.File(path, "r+") as file:
        edit(file)
        found = json.loads(file["tokens"][()]) | tokens
        found = {name: text for name, text in found.items() if text is not None}
        del file["tokens"]
        file["tokens"] = np.bytes_(json.dumps(found).encode())
        for name, value in (("content", leaves.digest(found)), ("observed", "")):
            file.attrs[f"{name}_digest"] = np.bytes_(value.encode())
    return path


@pytest.fixture
def h5(recording, tmp_path):
    """A sound file to be changed."""
    formats.write(recording, tmp_path / "a.h5", "h5")
    return tmp_path / "a.h5"


def edited(path, edit):
    with h5py.File(path, "r+") as file:
        edit(file)
    return path


@pytest.mark.parametrize(
    ("edit", "tokens", "words"),
    [
        (lambda f: f.attrs.__delitem__("kind"), {"kind": None}, ("/:", "kind")),
        (lambda f: f.attrs.__setitem__("kind", np.bytes_(b"x")), {}, ("kind: ", "digest")),
        (lambda f: f.attrs.__delitem__("name"), {}, ("name: ", "digest")),
        (lambda f: None, {"provenance": 'str:"{}"'}, ("provenance: ", "digest")),
    ],
    ids=["none", "other", "nameless", "provenance"],
)
def test_headers_of_h5_that_do_not_fit(estimates, tmp_path, edit, tokens, words):
    formats.write(estimates, tmp_path / "a.h5", "h5")
    refused(resealed(tmp_path / "a.h5", edit, **tokens), *words, read=formats.header)


def test_headers_of_h5_of_deep_json_or_cut(estimates, tmp_path):
    def put(name, data):
        def edit(file):
            del file[name]
            file[name] = np.bytes_(data)

        return edit

    path, deep = tmp_path / "a.h5", b"[" * 100_000
    for name, data in (("tokens", deep), ("tokens", b"[]"), ("tokens", b"3")):
        formats.write(estimates, path, "h5")
        refused(edited(path, put(name, data)), "/: ", read=formats.header)
    formats.write(estimates, path, "h5")
    text = {"provenance": leaves.digest_of(deep.decode())}
    refused(resealed(path, put("provenance", deep), **text), "provenance", read=formats.header)
    formats.write(estimates, path, "h5")
    path.write_bytes(path.read_bytes()[:-9])
    refused(path, "superblock", read=formats.header)


def test_headers_of_mcap_with_huge_lengths(estimates, tmp_path):
    """Every place of the attachment that holds them, one after the other."""
    path = tmp_path / "a.mcap"
    formats.write(estimates, path, "mcap")
    whole = path.read_bytes()
    start = whole.index(HEADER.encode()) - 40
    for at in range(start, start + 120, 2):
        path.write_bytes(whole[:at] + b"\xff" * 8 + whole[at + 8 :])
        with suppress(FormatError):
            formats.header(path)


def test_headers_of_h5_hold_nothing_else(estimates, tmp_path):
    formats.write(estimates, tmp_path / "a.h5", "h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file.attrs["seed"] = 7
    assert "seed" not in formats.header(tmp_path / "a.h5")


def test_h5_that_declares_more_than_it_has(h5):
    def grow(file):
        file["streams/uwb/rows/distance"].resize(2**40, axis=0)

    refused(edited(h5, grow), "streams/uwb/rows/distance", "declares")


def test_h5_with_a_huge_chunk(h5):
    def put(file):
        file.create_dataset("x", (2**24,), "f8", chunks=(2**24,), compression="gzip")

    refused(edited(h5, put), "x", "chunks of 134217728 bytes")


def test_h5_chunk_that_inflates_to_far_more_than_its_size(h5):
    def put(file):
        data = file.create_dataset("x", (8,), "f8", chunks=(8,), compression="gzip")
        data.id.write_direct_chunk((0,), zlib.compress(b"\0" * (1 << 24), 9))

    refused(edited(h5, put), "x", "is stored in")


def test_h5_large_chunk_that_inflates_to_more(h5):
    def put(file):
        data = file.create_dataset("x", (2**17,), "f8", chunks=(2**17,), compression="gzip")
        data.id.write_direct_chunk((0,), zlib.compress(b"\0" * (300 << 20), 6))

    refused(edited(h5, put), "x", "a chunk of 1048576 bytes holds more")


def test_h5_filter_without_its_parameter(h5):
    def put(file):
        made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        made.set_chunk((8,))
        made.set_filter(h5py.h5z.FILTER_DEFLATE, h5py.h5z.FLAG_OPTIONAL, ())
        space = h5py.h5s.create_simple((8,))
        h5py.h5d.create(file.id, b"x", h5py.h5t.NATIVE_DOUBLE, space, made)

    refused(edited(h5, put), "x: missing, or not part of the content")


def test_h5_of_many_zeros(h5):
    def put(file):
        data = file.create_dataset("x", (2**28,), "f8", chunks=(2**21,), compression="gzip")
        assert data.nbytes == 1 << 31

    refused(edited(h5, put), "x", "declares")


def test_h5_text_without_end(h5):
    def put(file):
        del file["tokens"]
        file.create_dataset("tokens", dtype="S1000000000", shape=())

    refused(edited(h5, put), "tokens")


@pytest.mark.parametrize("kind", ["groups", "attributes", "datasets"])
def test_h5_with_very_many_items(h5, kind, monkeypatch):
    monkeypatch.setattr("echoset.formats.hdf5.reader._MAX_NODES", 1000)

    def put(file):
        low = file.create_group("many")
        for k in range(1100):
            if kind == "groups":
                low.create_group(str(k))
            elif kind == "datasets":
                low[str(k)] = k
            else:
                low.attrs[str(k)] = k

    if kind == "attributes":
        with h5py.File(h5, "r+", libver="latest") as file:
            put(file)
    else:
        edited(h5, put)
    refused(h5, "many/")


def test_h5_cycle_of_hard_links(h5):
    def put(file):
        for k in range(6):
            file[f"streams/again{k}"] = file["/"]

    refused(edited(h5, put), "streams/again")


@pytest.mark.parametrize(
    "link", [h5py.SoftLink("/streams"), h5py.ExternalLink("/dev/zero", "/x")], ids=["soft", "ext"]
)
def test_h5_links_to_elsewhere(h5, link):
    refused(edited(h5, lambda file: file.__setitem__("x", link)), "x: soft and external links")


def test_h5_data_in_other_files(h5, tmp_path):
    def put(file):
        file.create_dataset("x", (4,), "f8", external=[("/etc/passwd", 0, 32)])

    refused(edited(h5, put), "x: an external dataset")

    def virtual(file):
        del file["x"]
        layout = h5py.VirtualLayout((4,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "none.h5"), "x", (4,))
        file.create_virtual_dataset("x", layout)

    refused(edited(h5, virtual), "x: a virtual dataset")


def test_h5_text_in_a_heap(h5):
    def put(file):
        file.attrs["name"] = "of any length"

    refused(edited(h5, put), "'name' is no number or text of fixed length")


def test_h5_deep_groups(h5):
    refused(edited(h5, lambda file: file.create_group("/".join("g" * 4000))), "nested too deeply")


def mcap(path, *chunks, header=b"{}"):
    """A file of a header and raw chunks: uncompressed size, compression and data."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start(library="x")
        if header is not None:
            writer.add_attachment(0, 0, HEADER, "application/json", header)
        for size, kind, data in chunks:
            body = struct.pack("<QQQII", 0, 0, size, 0, len(kind)) + kind
            body += struct.pack("<Q", len(data)) + data
            file.write(struct.pack("<BQ", 6, len(body)) + body)
        writer.finish()
    return path


ZEROS = b"\0" * (1 << 28)
NO_SIZE = zstandard.ZstdCompressor(write_content_size=False)


@pytest.mark.parametrize(
    ("size", "kind", "data"),
    [
        (1 << 62, b"zstd", zstandard.compress(b"x")),
        (1, b"zstd", zstandard.compress(ZEROS)),
        (1, b"zstd", NO_SIZE.compress(ZEROS)),
        (1 << 26, b"zstd", NO_SIZE.compress(ZEROS)),
        (1, b"lz4", lz4.frame.compress(ZEROS)),
        (1 << 62, b"", b"x"),
        (9, b"none", b"x"),
    ],
    ids=["declared", "frame", "no-size", "more", "lz4", "plain", "unknown"],
)
def test_mcap_chunk_that_is_a_bomb(tmp_path, size, kind, data):
    refused(mcap(tmp_path / "a.mcap", (size, kind, data), header=None), "byte ")


@pytest.mark.parametrize("op", [0, 3, 5, 99])
def test_mcap_chunk_of_very_many_records(tmp_path, op):
    body = b"\0" * 22 if op == 5 else b""
    data = (struct.pack("<BQ", op, len(body)) + body) * ((1 << 25) // (9 + len(body)))
    refused(mcap(tmp_path / "a.mcap", (len(data), b"zstd", zstandard.compress(data))))


def test_mcap_of_many_small_bombs(tmp_path):
    block = struct.pack("<BQ", 3, (1 << 26) - 9) + ZEROS[: (1 << 26) - 9]
    bomb = (1 << 26, b"zstd", zstandard.compress(block))
    refused(mcap(tmp_path / "a.mcap", *[bomb] * 20, header=None), "declares")


@pytest.mark.parametrize("size", [1 << 27, 1 << 62, (1 << 64) - 1])
def test_mcap_record_without_end(tmp_path, size):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 5, size) + b"x" * 100)
    refused(path, "byte 8: a record of")


def test_mcap_lengths_inside_records(tmp_path):
    path = tmp_path / "a.mcap"
    body = struct.pack("<QQI", 0, 0, 1) + b"x" + struct.pack("<I", 0) + struct.pack("<Q", 1 << 62)
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 9, len(body)) + body)
    refused(path)


@pytest.mark.parametrize(
    "header",
    [
        b"[" * 100_000,
        b"[" + b"[]," * (6 << 20) + b"[]]",
        json.dumps(
            {"estimator": "", "columns": {}, "leaves": {"x": {"dtype": "S999999999", "shape": [1]}}}
        ).encode(),
        json.dumps({"estimator": "", "columns": {"x": ["O", [2]]}, "leaves": {}}).encode(),
        json.dumps({"estimator": "", "columns": {"x": ["f8", [2**40] * 9]}, "leaves": {}}).encode(),
    ],
    ids=["deep", "long", "type", "objects", "shape"],
)
def test_mcap_header_that_asks_for_much(tmp_path, header):
    refused(mcap(tmp_path / "a.mcap", header=header), "byte ")


def test_mcap_with_many_channels(tmp_path):
    """Every channel and schema that the format can number, and nothing in them."""
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        for k in range(60_000):
            writer.register_channel(f"/{k}", "json", 0)
        writer.finish()
    refused(tmp_path / "a.mcap", "not a file of echoset")


def test_npz_member_that_is_a_bomb(tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": (2,)}
    )
    with zipfile.ZipFile(tmp_path / "w.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("fc_bias.npy", header.getvalue() + ZEROS)
    refused(tmp_path / "w.npz", read=weights.read)
    with (tmp_path / "w.npz").open("wb") as file:
        file.truncate(1 << 40)
    refused(tmp_path / "w.npz", "size", read=weights.read)


DEEP = "[" * 200_000


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (DEEP, "line 1"),
        ('{"provenance": ' + DEEP, "nested too deeply"),
        ('{"scores": [NaN], "provenance": {}}', "line 1"),
        ('{"scores": [], "scores": [], "provenance": {}}', "twice"),
        ('{"scores": [' + "9" * 5000 + '], "provenance": {}}', "line 1"),
    ],
)
def test_scores_of_deep_or_odd_json(tmp_path, text, word):
    (tmp_path / "a.json").write_text(text)
    refused(tmp_path / "a.json", word, read=scores.read)


def test_log_of_deep_json_and_endless_lines(tmp_path):
    path = tmp_path / "a.json"
    path.write_text(DEEP)
    params = autoferry.Params()
    refused(path, "nested", read=lambda p: autoferry.read([p], params))
    path.write_text("range2 " * (1 << 22))
    known = labyrinth.Params()
    refused(path, "line 1", "longer than", read=lambda p: labyrinth.read([p], known))


@pytest.mark.parametrize(
    "text",
    [
        DEEP,
        "a: &a [x, x]\nb: [*a, *a]",
        "{a: " * 20_000,
        "- " * 20_000,
        "a: !!python/object/apply:os.system [ls]",
        "{a: 1,!b: 2}",
        "!!int 1: a",
        "a: " + "9" * 5000,
        "a: \0",
    ],
    ids=["deep", "alias", "mappings", "lists", "object", "tag", "standard", "digits", "nul"],
)
def test_yaml_that_is_deep_or_more_than_data(tmp_path, text):
    (tmp_path / "a.yaml").write_text(text)
    refused(
        tmp_path / "a.yaml",
        "a.yaml",
        read=lambda path: plain_yaml.parse(path.read_text(), path.name),
        error=ParameterError,
    )


def test_no_mcap_is_written_that_could_not_be_read(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("echoset.formats.mcap.writer.MESSAGE", 1000)
    with pytest.raises(ParameterError, match="sensors and models"):
        formats.write(recording, tmp_path / "a.mcap", "mcap")
    axes = {"range_axis": np.arange(60.0), "azimuth_axis": np.linspace(-1, 1, 60)}
    maps = replace(
        recording.streams["maps"], model=axes, scan={"map": np.zeros((10, 60, 60), np.float32)}
    )
    monkeypatch.setattr("echoset.formats.mcap.writer.MESSAGE", 14_000)
    with pytest.raises(ParameterError, match="write HDF5"):
        large = replace(recording, streams={"maps": maps}, truth=None)
        formats.write(large, tmp_path / "a.mcap", "mcap")
