"""Changes to inputs: of bytes, of lines and numbers, and inside HDF5, MCAP and ZIP files."""

from __future__ import annotations

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import zstandard

Rng = np.random.Generator
Change = Callable[[bytes, Rng], bytes]


def change(data: bytes, kind: str, rng: Rng) -> bytes:
    """``data`` changed in one to three ways; of a binary file one through its library, first."""
    changes = [*KINDS[kind], *BYTES]
    weights = np.array([2.0] * len(KINDS[kind]) + [1.0] * len(BYTES))
    number = int(rng.choice((1, 1, 1, 2, 3)))
    chosen = np.sort(rng.choice(len(changes), number, p=weights / weights.sum()))
    through = chosen < len(KINDS[kind])
    if kind != "text" and through.sum() > 1:
        chosen = np.concatenate((chosen[through][:1], chosen[~through]))
    for k in chosen:
        data = changes[k](data, rng)
    return data


def _place(data: bytes, rng: Rng) -> int:
    return int(rng.integers(0, max(len(data), 1)))


def flip_bits(data: bytes, rng: Rng) -> bytes:
    """One to eight bits are inverted."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 9)) if data else 0):
        changed[_place(data, rng)] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def set_bytes(data: bytes, rng: Rng) -> bytes:
    """A run of bytes, as long as a header field, becomes small, huge or random."""
    size, at = int(rng.choice((1, 2, 4, 8))), _place(data, rng)
    value = [b"\0" * size, b"\xff" * size, b"\x7f" * size, rng.bytes(size)][rng.integers(4)]
    return data[:at] + value + data[at + size :]


def truncate(data: bytes, rng: Rng) -> bytes:
    """The end is missing."""
    return data[: _place(data, rng)]


def append(data: bytes, rng: Rng) -> bytes:
    """Something stands behind the end."""
    return data + rng.bytes(int(rng.integers(1, 100)))


def _block(data: bytes, rng: Rng) -> tuple[int, int]:
    start = _place(data, rng)
    return start, start + int(rng.integers(1, 1 << rng.integers(1, 12)))


def erase(data: bytes, rng: Rng) -> bytes:
    """A block is missing."""
    start, stop = _block(data, rng)
    return data[:start] + data[stop:]


def repeat(data: bytes, rng: Rng) -> bytes:
    """A block stands there twice."""
    start, stop = _block(data, rng)
    return data[:stop] + data[start:stop] + data[stop:]


def splice(data: bytes, rng: Rng) -> bytes:
    """A block takes the place of another."""
    (start, stop), to = _block(data, rng), _place(data, rng)
    return data[:to] + data[start:stop] + data[to + (stop - start) :]


BYTES: list[Change] = [flip_bits, set_bytes, truncate, append, erase, repeat, splice]

_NUMBERS = re.compile(rb"-?\d+(\.\d+)?([eE][-+]?\d+)?")
_NASTY = (
    b"nan", b"NaN", b"inf", b"-Infinity", b"1e309", b"-1e309", b"", b"-", b"1_0", b"0x10", b"1,5",
    b"-1", b"0", b"1e308", b"9" * 25, b"null", b"true", b"'", b'"', b"[", b"{", b"}", b"\xd9\xa1",
    b"1e-400", b"9223372036854775808", b"- - -", b"&a", b"*a", b"!!python/object:x", b"1e999999999",
)  # fmt: skip


def nasty_number(data: bytes, rng: Rng) -> bytes:
    """A number becomes one that is none, or too large."""
    found = list(_NUMBERS.finditer(data))
    if not found:
        return data
    at = found[rng.integers(len(found))]
    return data[: at.start()] + _NASTY[rng.integers(len(_NASTY))] + data[at.end() :]


def other_number(data: bytes, rng: Rng) -> bytes:
    """A number becomes another of the file."""
    found = list(_NUMBERS.finditer(data))
    if not found:
        return data
    at, source = (found[i] for i in rng.integers(len(found), size=2))
    return data[: at.start()] + source[0] + data[at.end() :]


def lines(data: bytes, rng: Rng) -> bytes:
    """Lines go missing, stand there twice, or change places."""
    parts = data.split(b"\n")
    i, k = (int(x) for x in rng.integers(len(parts), size=2))
    if (way := rng.integers(4)) == 0:
        del parts[i]
    elif way == 1:
        parts.insert(k, parts[i])
    elif way == 2:
        parts[i], parts[k] = parts[k], parts[i]
    else:
        parts[i] = b""
    return b"\n".join(parts)


def separators(data: bytes, rng: Rng) -> bytes:
    """A separator goes missing, becomes another, or stands there twice."""
    found = list(re.finditer(rb"[ ,:;\[\]{}\n\"]", data))
    if not found:
        return data
    at = found[rng.integers(len(found))].start()
    value = (b"", b",", b" ", b"\n", b":", b"]", b"}", b'"', data[at : at + 1] * 2)
    return data[:at] + value[rng.integers(len(value))] + data[at + 1 :]


def nest(data: bytes, rng: Rng) -> bytes:
    """Brackets or braces open and are not closed soon."""
    depth, at = 1 << int(rng.integers(1, 13)), _place(data, rng)
    pair = ((b"[", b"]"), (b"{a: ", b"}"), (b'{"a":', b"}"), (b"- ", b""))[rng.integers(4)]
    return data[:at] + pair[0] * depth + b"1" + pair[1] * depth + data[at:]


def words(data: bytes, rng: Rng) -> bytes:
    """A word is changed, or becomes another of the file."""
    found = list(re.finditer(rb"[A-Za-z_]\w+", data))
    if not found:
        return data
    at, source = (found[i] for i in rng.integers(len(found), size=2))
    value = (source[0], at[0] + b"x", at[0][:-1], at[0].upper(), b"")[rng.integers(5)]
    return data[: at.start()] + value + data[at.end() :]


TEXT: list[Change] = [nasty_number, other_number, lines, separators, nest, words]


def h5_edit(data: bytes, rng: Rng) -> bytes:
    """A value, an attribute, a link or a dataset is changed through the library itself."""
    memory = io.BytesIO(data)
    try:
        with h5py.File(memory, "r+") as file:
            _H5_EDITS[rng.integers(len(_H5_EDITS))](file, rng)
    except Exception:
        return data
    return memory.getvalue()


def _items(file: h5py.File, kind: type) -> list[Any]:
    found: list[Any] = []
    file.visititems(lambda name, item: found.append(item) if isinstance(item, kind) else None)
    return found


def _any(found: list[Any], rng: Rng) -> Any:
    return found[rng.integers(len(found))]


def _h5_value(file: h5py.File, rng: Rng) -> None:
    data = _any([d for d in _items(file, h5py.Dataset) if d.size], rng)
    if data.ndim == 0:
        text = bytearray(bytes(data[()]))
        text[rng.integers(len(text))] ^= 1 << int(rng.integers(7))
        data[()] = np.bytes_(bytes(text))
        return
    index = tuple(int(rng.integers(n)) for n in data.shape)
    value = data[index]
    nasty = (np.nan, np.inf, -1, value + 1e-9 if data.dtype.kind == "f" else value + 1, 0)
    data[index] = b"x" if data.dtype.kind == "S" else nasty[rng.integers(len(nasty))]


def _h5_attribute(file: h5py.File, rng: Rng) -> None:
    items = [i for i in [file, *_items(file, h5py.Group), *_items(file, h5py.Dataset)] if i.attrs]
    attrs = _any(items, rng).attrs
    name = _any(list(attrs), rng)
    value = attrs[name]
    way = rng.integers(5)
    if way == 0:
        del attrs[name]
    elif way == 1:
        attrs[name] = np.zeros(int(rng.integers(1, 7000)))
    elif way == 2:
        attrs[name + "x"] = value
    elif isinstance(value, str):
        attrs[name] = value[:-1] + "x" if way == 3 else "km"
    else:
        attrs[name] = type(value)(value + 1) if way == 3 else str(value)


def _h5_links(file: h5py.File, rng: Rng) -> None:
    group = _any([file, *_items(file, h5py.Group)], rng)
    name = _any([*group, "odd"], rng)
    if name in group:
        del group[name]
    links = (h5py.SoftLink("/"), h5py.ExternalLink("/dev/zero", "/x"), file, group, None)
    link = links[rng.integers(len(links))]
    if link is not None:
        group[name] = link


def _h5_swap(file: h5py.File, rng: Rng) -> None:
    a, b = (_any(_items(file, h5py.Dataset), rng).name for _ in range(2))
    file.move(a, "swapped")
    if a != b:
        file.move(b, a)
    file.move("swapped", b)


def _h5_shape(file: h5py.File, rng: Rng) -> None:
    data = _any([d for d in _items(file, h5py.Dataset) if d.ndim and d.chunks], rng)
    data.resize(int(_any([0, 1, len(data) + 1, 10**6, 10**12, 2**62], rng)), axis=0)


def _h5_retype(file: h5py.File, rng: Rng) -> None:
    data = _any(_items(file, h5py.Dataset), rng)
    name, values, attrs = data.name, data[()], dict(data.attrs)
    del file[name]
    way = rng.integers(6)
    if way == 0:
        new = file.create_dataset(name, data=np.asarray(values).astype("f4"))
    elif way == 1:
        new = file.create_dataset(name, shape=(2**40,), dtype="f8", chunks=(1024,))
    elif way == 2:
        new = file.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())
    elif way == 3:
        new = file.create_dataset(name, data=np.zeros(3, [("a", "f8"), ("b", "i4")]))
    elif way == 4:
        size = 1 << int(rng.integers(18, 23))
        new = file.create_dataset(
            name, shape=(size,), dtype="f8", chunks=(size,), compression="gzip", fillvalue=0
        )
        new[0] = 1.0
    else:
        layout = h5py.VirtualLayout((4,), "f8")
        layout[:] = h5py.VirtualSource("/dev/zero", "x", (4,))
        new = file.create_virtual_dataset(name, layout)
    new.attrs.update(attrs)


def _h5_deep(file: h5py.File, rng: Rng) -> None:
    file.create_group("/".join("g" * int(rng.integers(1, 300))))


_H5_EDITS: list[Callable[[h5py.File, Rng], None]] = [
    _h5_value, _h5_value, _h5_value, _h5_attribute, _h5_attribute, _h5_links, _h5_swap, _h5_shape,
    _h5_retype, _h5_deep,
]  # fmt: skip

_Record = tuple[int, bytes]
_MAGIC = b"\x89MCAP0\r\n"
_MESSAGE, _CHUNK, _ATTACHMENT, _METADATA, _DATA_END = 5, 6, 9, 12, 15


def _split(data: bytes) -> list[_Record]:
    """The records of a run of bytes: operation code and content."""
    found, at = [], 0
    while at + 9 <= len(data):
        op, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > len(data):
            break
        found.append((op, data[at + 9 : at + 9 + size]))
        at += 9 + size
    return found


def _join(records: list[_Record]) -> bytes:
    return b"".join(struct.pack("<BQ", op, len(content)) + content for op, content in records)


def mcap_edit(data: bytes, rng: Rng) -> bytes:
    """Records, or those in a chunk, are changed, and all checksums and lengths are made to fit."""
    records = _split(data[len(_MAGIC) :])
    end = next((i for i, (op, _) in enumerate(records) if op == _DATA_END), None)
    if end is None or not end:
        return data
    k = int(rng.integers(end))
    op, content = records[k]
    try:
        if op == _CHUNK:
            records[k] = op, _chunk_edit(content, rng)
        elif op == _ATTACHMENT:
            body = _content_edit(content[:-4], rng)
            records[k] = op, body + struct.pack("<I", zlib.crc32(body))
        else:
            records[k] = op, _content_edit(content, rng)
        if rng.integers(8) == 0:
            records = _records_edit(records[:end], rng) + records[end:]
    except (struct.error, zstandard.ZstdError, ValueError, IndexError):
        return data
    end = next(i for i, (op, _) in enumerate(records) if op == _DATA_END)
    body = _MAGIC + _join(records[:end])
    records[end] = _DATA_END, struct.pack("<I", zlib.crc32(body))
    return body + _join(records[end:]) + _MAGIC


def _content_edit(content: bytes, rng: Rng) -> bytes:
    ways = (flip_bits, flip_bits, set_bytes, nasty_number, other_number)
    return ways[rng.integers(len(ways))](content, rng)


def _records_edit(records: list[_Record], rng: Rng) -> list[_Record]:
    changed = list(records)
    i, k = (int(x) for x in rng.integers(len(changed), size=2))
    way = rng.integers(3)
    if way == 0:
        del changed[i]
    elif way == 1:
        changed.insert(k, changed[i])
    else:
        changed[i], changed[k] = changed[k], changed[i]
    return changed


def _chunk_edit(content: bytes, rng: Rng) -> bytes:
    start, stop, _, _, name = struct.unpack_from("<QQQII", content)
    compression = content[32 : 32 + name]
    packed = content[40 + name :]
    inner = _split(zstandard.decompress(packed) if compression == b"zstd" else packed)
    if rng.integers(2):
        inner = _records_edit(inner, rng)
    else:
        k = int(rng.integers(len(inner)))
        inner[k] = inner[k][0], _content_edit(inner[k][1], rng)
    plain = _join(inner)
    size = len(plain)
    if rng.integers(20) == 0:
        plain = b"\0" * (1 << int(rng.integers(20, 27)))
        size = int(rng.choice((len(plain), size, 0, 2**62)))
    way = rng.integers(12)
    if way == 0:
        compression, packed = b"", plain
    elif way == 1:
        compression, packed = b"lz4", _lz4(plain)
    elif way == 2:
        writer = zstandard.ZstdCompressor(write_content_size=False)
        compression, packed = b"zstd", writer.compress(plain)
    else:
        compression, packed = b"zstd", zstandard.compress(plain)
    head = struct.pack("<QQQII", start, stop, size, zlib.crc32(plain), len(compression))
    return head + compression + struct.pack("<Q", len(packed)) + packed


def _lz4(data: bytes) -> bytes:
    import lz4.frame

    return bytes(lz4.frame.compress(data))


def zip_edit(data: bytes, rng: Rng) -> bytes:
    """A member is changed and its checksum made to fit, is a bomb, or another archive's."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
    except Exception:
        return data
    if not members:
        return data
    name = _any(list(members), rng)
    way = rng.integers(5)
    if way == 0:
        del members[name]
    elif way == 1:
        members[name] = b"\0" * (1 << int(rng.integers(16, 24)))
    elif way == 2:
        members[name] = members[name][:128] + b"\0" * (1 << int(rng.integers(16, 24)))
    else:
        members[name] = flip_bits(members[name][:128], rng) + members[name][128:]
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in members.items():
            archive.writestr(zipfile.ZipInfo(member), content)
    return out.getvalue()


KINDS: dict[str, list[Change]] = {
    "h5": [h5_edit] * 4,
    "mcap": [mcap_edit] * 4,
    "text": TEXT,
    "zip": [zip_edit] * 2,
}
