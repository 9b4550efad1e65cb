"""Files appear whole or not at all, and HDF5 survives a system that refuses to write."""

from __future__ import annotations

import errno
import io
import os

import h5py
import numpy as np
import pytest

from echoset.formats.atomic import atomic
from echoset.formats.hdf5.fallback import SpilledFile
from echoset.models.errors import OutputError


def test_appears_at_the_end(tmp_path):
    path = tmp_path / "folder/x"
    with atomic(path) as temporary:
        temporary.write_text("whole")
        assert not path.exists() and temporary.parent == path.parent
    assert path.read_text() == "whole" and os.listdir(path.parent) == ["x"]


@pytest.mark.parametrize(
    "error", [ValueError, KeyboardInterrupt, RuntimeError("other"), SystemExit]
)
def test_any_exception_leaves_nothing(tmp_path, error):
    with (
        pytest.raises(error if isinstance(error, type) else type(error)),
        atomic(tmp_path / "x") as t,
    ):
        t.write_text("half")
        raise error
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "error", [OSError(errno.ENOSPC, "full"), RuntimeError("HDF5: errno = 28, error message = ...")]
)
def test_errors_of_the_system_are_output_errors(tmp_path, error):
    with pytest.raises(OutputError, match=r"x: cannot be written"), atomic(tmp_path / "x"):
        raise error


def test_existing_file_needs_overwrite(tmp_path):
    (tmp_path / "x").write_text("old")
    with pytest.raises(OutputError, match="exists already"), atomic(tmp_path / "x"):
        raise AssertionError
    with atomic(tmp_path / "x", overwrite=True) as temporary:
        temporary.write_text("new")
    assert (tmp_path / "x").read_text() == "new"


def test_folder_is_not_replaced(tmp_path):
    with pytest.raises(OutputError, match="not a regular file"), atomic(tmp_path, overwrite=True):
        raise AssertionError


class Full(io.FileIO):
    """A file on a disk with room for 5000 bytes."""

    def write(self, data):
        room = 5000 - self.tell()
        if room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return super().write(memoryview(data)[:room])


def test_hdf5_ends_in_peace_on_a_full_disk(tmp_path):
    values = np.random.default_rng(1).normal(size=10_000)
    steady = SpilledFile(tmp_path / "x.h5")
    steady._file.close()
    steady._file = Full(tmp_path / "x.h5", "w+")
    with h5py.File(steady, "w") as file:
        file["values"] = values
        assert np.array_equal(file["values"][:], values)
    with pytest.raises(OSError, match="No space"):
        steady.check()
    with pytest.raises(OSError, match="No space"):
        steady.close()
    steady.close()


def test_steady_file_holds_what_was_written(tmp_path):
    values = np.arange(10_000.0)
    steady = SpilledFile(tmp_path / "x.h5")
    with h5py.File(steady, "w") as file:
        file["values"] = values
    steady.close()
    with h5py.File(tmp_path / "x.h5") as file:
        assert np.array_equal(file["values"][:], values)


def test_a_file_that_cannot_be_opened_is_closed_in_silence(tmp_path):
    steady = SpilledFile.__new__(SpilledFile)
    with pytest.raises(FileNotFoundError):
        steady.__init__(tmp_path / "none" / "x.h5")
    steady.close()
