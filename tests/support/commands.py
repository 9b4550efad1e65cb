"""A distribution of plugins on the path, and ways to run commands."""

from __future__ import annotations

import logging
import os
import re
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from echoset.cli.main import main
from echoset.models import registry
from support.forks import Forked

__all__ = [
    "campaign",
    "command",
    "empty",
    "environment",
    "files",
    "fork",
    "plugins",
    "rec",
    "run",
    "start",
]

TIME = re.compile(r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ echoset: ", re.MULTILINE)

PLUGIN = """
import time
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from echoset.models.errors import InputError
from echoset.models.parameters import REQUIRED, parameter, require
from echoset.models.records import Estimates, Meta, Objects

SUMMARY = "mean of the measured distances"
STREAMS = ("uwb",)
PRESETS = {"slow": {"delay": 0.05}}


@dataclass(frozen=True, slots=True)
class Params:
    max_range: float = parameter(REQUIRED, "m", "longest range")
    offset: float = parameter(0.0, "m", "added to the mean")
    noise: float = parameter(0.1, "m", "standard deviation of what is added")
    delay: float = parameter(0.0, "s", "time that a step takes")
    fail_at: int = parameter(0, "1", "step whose estimate is not finite, 0 for none")
    label: str = parameter("1e3", "", "a text that reads like a number")
    pair: tuple[float, float] = parameter((1e-10, 2.0), "m", "two numbers")
    limit: float | None = parameter(None, "m", "may be nothing")

    def __post_init__(self):
        require(self.noise >= 0, "noise", "at least 0", self.noise)


def estimate(setup, scans, params, rng):
    if not setup.streams["uwb"].rows.keys() >= {"distance"}:
        raise InputError("no distances")
    for k, (time_ns, events) in enumerate(groupby(scans, key=lambda scan: scan.time_ns), 1):
        time.sleep(params.delay)
        distance = np.concatenate([scan.rows["distance"] for scan in events])
        x = np.full((1, 4), params.offset + params.noise * rng.standard_normal())
        x += distance.mean()
        if k == params.fail_at:
            x[:] = np.nan
        objects = Objects(
            np.array([time_ns]), np.array([0, 1]), np.zeros(1, np.int64),
            ("x", "y", "device_x", "device_y"), ("m",) * 4, x,
        )
        yield Estimates(Meta(""), objects, {"events": np.ones(1)})
"""
RADAR = """
from plugin_mean import Params, PRESETS, SUMMARY, estimate

STREAMS = ("range_bearing", "position")
"""
DEADLY = """
import os
import signal
from dataclasses import dataclass
from pathlib import Path

import plugin_mean
from echoset.models.parameters import parameter
from plugin_mean import PRESETS, STREAMS, SUMMARY


@dataclass(frozen=True, slots=True)
class Params(plugin_mean.Params):
    victim: str = parameter("", "", "name of the recording that kills its worker")
    mark: str = parameter("", "", "file that says that it has done so; empty to do it always")


def estimate(setup, scans, params, rng):
    mark = Path(params.mark)
    if setup.meta.name == params.victim and not (params.mark and mark.exists()):
        if params.mark:
            mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    yield from plugin_mean.estimate(setup, scans, params, rng)
"""
ENTRY_POINTS = """[echoset.estimators]
mean = plugin_mean
radar = plugin_radar
deadly = plugin_deadly
"""


class Result(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


def untimed(err: bytes) -> str:
    """Lines of the log without the time that they begin with."""
    return TIME.sub("echoset: ", err.decode())


@pytest.fixture(scope="session")
def plugins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an installed distribution of estimators."""
    folder = tmp_path_factory.mktemp("plugins")
    (folder / "plugin_mean.py").write_text(PLUGIN)
    (folder / "plugin_radar.py").write_text(RADAR)
    (folder / "plugin_deadly.py").write_text(DEADLY)
    info = folder / "plugin-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugin\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    return folder


@pytest.fixture(autouse=True)
def environment(plugins: Path, monkeypatch: pytest.MonkeyPatch):
    """Plugins on the path here and in processes, and logging as it was afterwards."""
    monkeypatch.syspath_prepend(str(plugins))
    monkeypatch.setenv("PYTHONPATH", str(plugins), prepend=os.pathsep)
    monkeypatch.delenv("PYTHONUNBUFFERED", raising=False)
    registry._points.cache_clear()
    show = warnings.showwarning
    yield
    registry._points.cache_clear()
    logging.captureWarnings(False)
    warnings.showwarning = show


@pytest.fixture
def run(capfdbinary: pytest.CaptureFixture[bytes]) -> Callable[..., Result]:
    """Run a command in this process."""

    def call(*args: object) -> Result:
        code = main([str(a) for a in args])
        out, err = capfdbinary.readouterr()
        return Result(code, out.decode("latin-1"), untimed(err))

    return call


@pytest.fixture(scope="session")
def command() -> list[str]:
    """The command as a process."""
    return [sys.executable, "-c", "import sys; from echoset.cli.main import main; sys.exit(main())"]


@pytest.fixture
def start(command: list[str]) -> Callable[..., subprocess.Popen[bytes]]:
    """Start a command as a process."""

    def popen(*args: object, **kwargs: object) -> subprocess.Popen[bytes]:
        words = [*command, *map(str, args)]
        return subprocess.Popen(words, stderr=subprocess.PIPE, env=os.environ, **kwargs)

    return popen


@pytest.fixture
def fork() -> Callable[..., subprocess.Popen[bytes]]:
    """As ``start``, sooner: a process that is forked off the tests."""

    def popen(*args: object, **kwargs: object) -> subprocess.Popen[bytes]:
        words = [str(a) for a in args]
        return Forked(words, stderr=subprocess.PIPE, env=os.environ, **kwargs)

    return popen


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short recordings."""
    folder = tmp_path_factory.mktemp("campaign")
    words = ("simulate", "uwb-los", "--runs", "3", "--set", "steps=20", "-o", f"{folder}/")
    assert main(list(words)) == 0
    return folder


@pytest.fixture
def files(campaign: Path) -> list[Path]:
    """All of them, in order."""
    return sorted(campaign.iterdir())


@pytest.fixture
def rec(campaign: Path) -> Path:
    """One of them."""
    return campaign / "uwb-los-s1-0000.h5"


@pytest.fixture
def empty(tmp_path: Path) -> Callable[[], bool]:
    """Whether the folder for outputs holds nothing, no temporary file either."""
    folder = tmp_path / "out"
    return lambda: not folder.exists() or not list(folder.iterdir())
