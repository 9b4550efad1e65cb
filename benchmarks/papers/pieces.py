"""Pieces of results, each kept in a file of its own until what makes it changes."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from tqdm import tqdm

import echoset
from echoset.formats.atomic import atomic
from echoset.formats.provenance import versions

PACKAGE = Path(echoset.__file__).parent
SOURCES = ("api.py", "control", "estimators", "formats", "metrics", "models", "simulate")
"""What of the package decides numbers; the papers do, but not what all pages have in common."""
FORM = ("__init__", "__main__", "page", "pieces")


@dataclass(frozen=True, slots=True)
class Piece:
    """What ``make``, a function of the package or a script, returns for plain ``arguments``."""

    make: Callable[..., Any]
    arguments: tuple[Any, ...]

    @property
    def facts(self) -> dict[str, Any]:
        """All that the result depends on."""
        name = f"{self.make.__module__}.{self.make.__name__}"
        made = {"function": name, "arguments": repr(self.arguments)}
        return {**made, "versions": versions(), "sources": sources()}

    def path(self, folder: Path) -> Path:
        """The file in which the result is kept."""
        digest = hashlib.sha256(repr(self.facts).encode()).hexdigest()[:16]
        return folder / f"{self.make.__module__}-{digest}.pickle"

    def result(self, folder: Path) -> Any:
        """The result that is kept."""
        return pickle.loads(self.path(folder).read_bytes())["result"]

    def keep(self, folder: Path) -> None:
        """Make the result and keep it."""
        data = pickle.dumps({**self.facts, "result": self.make(*self.arguments)})
        with atomic(self.path(folder), overwrite=True) as temporary:
            temporary.write_bytes(data)


class Paper(Protocol):
    """A module that makes one page."""

    NAME: str

    def pieces(self, share: float) -> list[Piece]:
        """The pieces of the page, with a ``share`` of the runs."""

    def write(self, results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
        """Write ``NAME.md`` and its pictures into ``folder``."""


@cache
def sources() -> str:
    """Digest of the code and data that decide numbers."""
    digest = hashlib.sha256()
    scripts = Path(__file__).parents[1]
    found = [PACKAGE / name for name in SOURCES]
    files = [p for path in found for p in (path.rglob("*.*") if path.is_dir() else [path])]
    files += [p for p in scripts.glob("papers/*.py") if p.stem not in FORM]
    files.append(scripts / "scene.py")
    for path in sorted(p for p in files if p.suffix in (".py", ".yaml", ".npz")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def complete(pieces: Iterable[Piece], folder: Path, jobs: int, title: str) -> None:
    """Make the pieces that ``folder`` lacks, ``jobs`` at a time."""
    tqdm.monitor_interval = 0  # its thread must not be there when processes fork
    missing = [piece for piece in pieces if not piece.path(folder).exists()]
    with ProcessPoolExecutor(jobs) as pool:
        work = [pool.submit(piece.keep, folder) for piece in missing]
        try:
            for done in tqdm(as_completed(work), title, len(work), disable=None):
                done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def chunks(runs: int, size: int) -> list[range]:
    """``range(runs)`` in parts of at most ``size``."""
    return [range(first, min(first + size, runs)) for first in range(0, runs, size)]


def share_of(runs: int, share: float) -> int:
    """A share of ``runs``, at least two: fewer have no standard error."""
    return max(2, round(runs * share))
