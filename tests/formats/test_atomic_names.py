"""Outputs that others make meanwhile, names that are long, and links."""

from __future__ import annotations

import errno
import os

import pytest

from echoset.formats import atomic as module
from echoset.formats.atomic import atomic, refuse_existing, sweep
from echoset.models.errors import OutputError


def test_an_output_that_appears_meanwhile_stays(tmp_path):
    path = tmp_path / "x"
    with pytest.raises(OutputError, match="exists already"), atomic(path) as temporary:
        temporary.write_text("ours")
        path.write_text("theirs")
    assert path.read_text() == "theirs" and os.listdir(tmp_path) == ["x"]
    with atomic(path, overwrite=True) as temporary:
        temporary.write_text("ours")
    assert path.read_text() == "ours"


@pytest.mark.parametrize("meanwhile", [False, True])
def test_file_systems_without_links(tmp_path, monkeypatch, meanwhile):
    def refuse(*args):
        raise OSError(errno.EPERM, "no links here")

    monkeypatch.setattr(module.os, "link", refuse)
    path = tmp_path / "x"
    if meanwhile:
        with pytest.raises(OutputError, match="exists already"), atomic(path):
            path.write_text("theirs")
    else:
        with atomic(path) as temporary:
            temporary.write_text("ours")
    assert path.read_text() == ("theirs" if meanwhile else "ours")
    assert os.listdir(tmp_path) == ["x"]


@pytest.mark.parametrize("length", [237, 238, 255])
def test_long_names(tmp_path, length):
    path = tmp_path / ("x" * (length - 3) + ".h5")
    with pytest.raises(ValueError), atomic(path) as temporary:
        left = temporary
        raise ValueError
    left.write_text("left behind")
    sweep([path])
    assert os.listdir(tmp_path) == []
    with atomic(path) as temporary:
        temporary.write_text("whole")
    assert os.listdir(tmp_path) == [path.name] and path.read_text() == "whole"


@pytest.mark.parametrize("name", ["x" * 256, "none/" + "x" * 256, "/".join(["x" * 200] * 21)])
def test_names_that_are_too_long_are_refused_before_the_work(tmp_path, name):
    with pytest.raises(OutputError, match="cannot be written: File name too long"):
        refuse_existing(tmp_path / name)


def test_a_link_is_followed(tmp_path):
    (tmp_path / "there").mkdir()
    link, target = tmp_path / "link", tmp_path / "there/target"
    link.symlink_to("there/target")
    with atomic(link) as temporary:
        assert temporary.parent == target.parent
        temporary.write_text("one")
    assert link.is_symlink() and target.read_text() == "one"
    with pytest.raises(OutputError, match=f"{link}: exists already"), atomic(link):
        raise AssertionError
    with atomic(link, overwrite=True) as temporary:
        temporary.write_text("two")
    assert link.is_symlink() and target.read_text() == "two"
    assert os.listdir(tmp_path / "there") == ["target"]
    (tmp_path / "there/.target.0123456789ab.tmp").write_text("left behind")
    sweep([link])
    assert os.listdir(tmp_path / "there") == ["target"]
    (tmp_path / "ring").symlink_to("ring")
    with pytest.raises(OutputError, match="Too many levels"), atomic(tmp_path / "ring"):
        raise AssertionError
