"""Progress bars count what was read, against all that there is."""

from __future__ import annotations

import io
import re
import sys
import time
from contextlib import closing

import pytest

from echoset import formats
from echoset.campaign import log, progress
from echoset.campaign.estimate import Task
from echoset.campaign.files.outputs import Target
from echoset.estimators.run import Estimation


class Terminal(io.StringIO):
    """A terminal that remembers."""

    def isatty(self) -> bool:
        return True


class Reading:
    """A source of four parts."""

    unit = "scan"

    def __init__(self, total: int) -> None:
        self.done, self.total = 0, total

    @property
    def progress(self) -> tuple[int, int]:
        return self.done, self.total

    def __iter__(self):
        for k in range(4):
            self.done += 1
            time.sleep(0.11)
            yield k


def seen(monkeypatch: pytest.MonkeyPatch, *sources: Reading) -> str:
    """What a terminal shows while the first source is read."""
    log.configure()
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert list(progress.share(sources[0], *sources)) == [0, 1, 2, 3]
    return str(sys.stderr.getvalue())


def test_one_source_in_its_unit(monkeypatch):
    text = seen(monkeypatch, Reading(8))
    assert "4.00/8.00" in text and "50%" in text


def test_several_sources_by_their_share(monkeypatch):
    other = Reading(4)
    other.done = 4
    assert "750/1.00k" in seen(monkeypatch, Reading(8), other)


def test_unknown_total_has_no_share(monkeypatch):
    text = seen(monkeypatch, Reading(0))
    assert "4.00scan" in text and "%" not in text


def test_silent_off_a_terminal(monkeypatch):
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    source = Reading(8)
    assert len(list(progress.share(source, source))) == 4 and not sys.stderr.getvalue()


def test_a_pass_backwards_has_a_bar_of_its_own(monkeypatch, rec, tmp_path):
    """The first counts the scans read, though no estimate comes before the second is over."""
    log.configure()
    monkeypatch.setattr(sys, "stderr", Terminal())
    layers = (("here", {"smooth": "whole", "particles": 100}),)
    target = Target(tmp_path / "out.h5", "h5")
    Task(str(rec), target, Estimation("eopda-geo", layers), show=True).run()
    units = re.findall(r"(scan|step)/s", sys.stderr.getvalue())
    assert list(dict.fromkeys(units)) == ["scan", "step"], sys.stderr.getvalue()


@pytest.mark.parametrize(("form", "unit"), [("h5", "scan"), ("mcap", "B")])
def test_sources_end_at_their_total(rec, tmp_path, form, unit):
    path = tmp_path / f"a.{form}"
    formats.write(formats.read(rec), path, form)
    with closing(formats.open_source(path)) as source:
        before = source.progress
        for _ in source.scans():
            assert before <= source.progress
            before = source.progress
        assert source.unit == unit and source.progress[0] == source.progress[1] > 200
