"""Chunks that are packed here are what HDF5's own filters make and read."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from echoset.formats.hdf5.packed import PackedColumn, fletcher32

RNG = np.random.default_rng(2)


def dataset(file: h5py.File, name: str, rows: int = 64, **more: object) -> h5py.Dataset:
    return file.create_dataset(
        name, (0,), "f8", maxshape=(None,), chunks=(rows,), shuffle=True, fletcher32=True,
        compression="gzip", **more,
    )  # fmt: skip


@pytest.mark.parametrize("parts", [(), (0,), (1,), (64,), (63, 1, 1), (10, 200, 0, 90), (640, 3)])
def test_columns_come_back_through_the_library(tmp_path: Path, parts: tuple[int, ...]):
    values = [RNG.normal(0, 10, n) for n in parts]
    with h5py.File(tmp_path / "a.h5", "w") as file:
        column = PackedColumn(dataset(file, "x"))
        for part in values:
            column.add(part)
        column.close()
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(file["x"][:], np.concatenate([np.zeros(0), *values]))
        data = file["x"]
        assert data.compression == "gzip" and data.shuffle and data.fletcher32


@pytest.mark.parametrize("size", [0, 1, 2, 3, 719, 720, 721, 70_001])
@pytest.mark.parametrize("fill", ["random", "zeros", "ones"])
def test_the_checksum_is_that_of_the_library(tmp_path: Path, size: int, fill: str):
    """HDF5 writes it behind the bytes of a chunk that it does not compress."""
    value = {"zeros": 0, "ones": 255}
    data = (
        RNG.integers(0, 256, size, np.uint8)
        if fill == "random"
        else np.full(size, value[fill], np.uint8)
    )
    if size == 0:
        assert fletcher32(b"") == 0
        return
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("x", data=data, chunks=(size,), fletcher32=True)
        _, stored = file["x"].id.read_direct_chunk((0,))
    assert int.from_bytes(stored[-4:], "little") == fletcher32(data.tobytes())


def test_damage_of_a_chunk_shows(tmp_path: Path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        column = PackedColumn(dataset(file, "x"))
        column.add(RNG.normal(0, 1, 64))
        column.close()
        info = file["x"].id.get_chunk_info(0)
    whole = (tmp_path / "a.h5").read_bytes()
    for at in range(info.byte_offset, info.byte_offset + info.size, 7):
        broken = bytearray(whole)
        broken[at] ^= 0x10
        (tmp_path / "b.h5").write_bytes(broken)
        with h5py.File(tmp_path / "b.h5") as file, pytest.raises(OSError, match="filter"):
            file["x"][:]
