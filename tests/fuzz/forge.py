"""Forges records: sound containers with right digests, any field of which is replaced by any value.

Every file is given to all commands that read one. None may end in an internal error, and all say
the same of the same bytes: what one refuses as damaged, each does. File ``i`` depends on (seed, i)
only.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from fuzz import Tally, watched
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter

from echoset import formats
from echoset.cli.main import main as echoset
from echoset.formats import leaves
from echoset.formats.mcap import writer as mcap_writer
from echoset.models import registry
from echoset.models.errors import FormatError
from echoset.models.records import Estimates, Recording

Rng = np.random.Generator
Leaves = dict[str, Any]

TEXTS = (
    "", "x", "=1+1", "a/b", "..", "a b", "\x1b[31m", "a\nb", "\u202e", "\ud800", "é", "x" * 5000,
    "uwb", "radar", "ellipse", "estimates", "recording", "NaN",
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 2**31, 2**63 - 1, 2**63, -(2**63), 10**40, True, 0.0, -1.0, 5e-324, 1e308, -1e308,
    float("nan"), float("inf"), 1e-12, 1e12,
)  # fmt: skip
PROVENANCE = (
    "", "{", "null", "3", "[]", '"x"', "NaN", '{"a": NaN}', '{"a": 1e999}', "{}", "é", "\x00",
    '{"estimator": 3}',
    '{"estimator": "="}', '{"estimator": "a\\nb"}', '{"a": ' + "9" * 6000 + "}", '{"a": "\\ud800"}',
    '{"a":' * 200 + "1" + "}" * 200, '{"a":' * 5000 + "1" + "}" * 5000, "[" * 100_000,
    '{"estimator": "x", "input": []}', '{"estimator": "x", "input": {"digest": 3, "name": []}}',
    '{"estimator": "x", "parameters": 3, "seed": [], "versions": "x"}', '{"a": 1, "a": 2}',
    '{"estimator": "x", "scenario": {}, "parameters": null}',
)  # fmt: skip
TYPES = ("<f8", "<f4", "<f2", "<i8", "<i4", "<u1", "<u8", ">f8", "?")


@cache
def seeds() -> tuple[tuple[Recording, Estimates], ...]:
    """Recordings of a few scans and what an estimator makes of them."""
    made = []
    for scenario, settings, estimator, parameters in (
        ("uwb-los", {"steps": 3}, "ap-pda", {"particles": 100}),
        ("meeting", {"steps": 4}, "phd", {}),
        ("moving-platform", {"steps": 4}, "mbm", {}),
    ):
        from echoset import api

        module = registry.load("echoset.scenarios", scenario)
        rng = np.random.default_rng(1)
        recording = module.simulate(module.Params(**settings), rng, f"{scenario}-s1-0000")
        made.append((recording, api.estimate(recording, estimator, **parameters)))
    return tuple(made)


def _value(old: Any, rng: Rng) -> Any:
    """Any value in place of ``old``, of its kind more often than not."""
    kind = int(rng.integers(10))
    if kind == 0:
        return TEXTS[rng.integers(len(TEXTS))]
    if kind == 1:
        return NUMBERS[rng.integers(len(NUMBERS))]
    if kind == 2:
        return tuple(TEXTS[i] for i in rng.integers(len(TEXTS), size=rng.integers(4)))
    if kind == 3:
        shape = tuple(rng.integers(0, 4, size=rng.integers(0, 5)).tolist())
        return rng.normal(size=shape).astype(TYPES[rng.integers(len(TYPES))])
    if isinstance(old, np.ndarray):
        return _array(old, rng)
    if isinstance(old, tuple):
        words = list(old) or [""]
        words[rng.integers(len(words))] = TEXTS[rng.integers(len(TEXTS))]
        return tuple(words[: rng.integers(len(words) + 1)] if kind == 4 else words)
    choices: tuple[Any, ...] = TEXTS if isinstance(old, str) else NUMBERS
    return choices[rng.integers(len(choices))]


def _array(old: Any, rng: Rng) -> Any:
    """An array like ``old``, a value, its type, order, length or shape changed."""
    new, way = old.copy(), int(rng.integers(8))
    if way <= 2 and new.size:
        value = NUMBERS[rng.integers(len(NUMBERS))]
        with np.errstate(all="ignore"):
            try:
                new.flat[rng.integers(new.size)] = value
            except (OverflowError, ValueError):
                new.flat[rng.integers(new.size)] = 0
        return new
    if way == 3:
        with np.errstate(all="ignore"):
            return new.astype(TYPES[rng.integers(len(TYPES))])
    if way == 4:
        return new[::-1].copy() if new.ndim else new
    if way == 5:
        return new[: rng.integers(len(new) + 1)] if new.ndim else new
    if way == 6:
        return new.reshape(-1) if rng.integers(2) else new[..., None]
    return new * np.array(rng.choice((-1, 0, 2, 1e6))).astype(new.dtype)


def forged(whole: Leaves, rng: Rng) -> Leaves:
    """The leaves with one to three changed, moved, missing or added."""
    found = dict(whole)
    for _ in range(int(rng.choice((1, 1, 1, 2, 3)))):
        path = list(found)[rng.integers(len(found))]
        group, _, name = path.rpartition("/")
        way = int(rng.integers(12))
        if name == "provenance" and way < 10:
            found[path] = PROVENANCE[rng.integers(len(PROVENANCE))]
        elif way < 8:
            found[path] = _value(found[path], rng)
        elif way == 8:
            del found[path]
        elif way == 9:
            value = found.pop(path)
            parts = path.split("/")
            parts[rng.integers(len(parts))] = TEXTS[rng.integers(len(TEXTS))].replace("\x00", "")[
                :99
            ]
            found["/".join(p or "_" for p in parts)] = value
        elif way == 10:
            found[f"{group}/extra".lstrip("/")] = _value(found[path], rng)
        else:
            found[f"{path}/inside"] = found.pop(path)
        if not found:
            break
    return found


@contextmanager
def _unchecked(found: Leaves) -> Iterator[None]:
    """Have writers write these leaves, whatever record they are given."""
    top = {p: v for p, v in found.items() if not p.startswith("recording/")}
    text = found.get("provenance")
    beside = {p[10:]: v for p, v in found.items() if p.startswith("recording/")}

    def of(record: Any) -> Leaves:
        return beside if isinstance(record, Recording) and beside else top

    with (
        patch.object(leaves, "of", of),
        patch.object(leaves, "json_of", lambda _: text if isinstance(text, str) else "{}"),
    ):
        yield


def _h5(found: Leaves, path: Path) -> None:
    from echoset.formats.hdf5.writer import LeafWriter

    out = LeafWriter(path)
    try:
        for name, leaf in found.items():
            out.put(name, leaf)
        out.close()
    finally:
        out.abort()


def _mcap(found: Leaves, record: Any, path: Path, rng: Rng) -> None:
    """Written with or without chunks, checksums, indices and summary, all of which is legal."""
    options: dict[str, Any] = {}
    if rng.integers(2):
        options = {
            "use_chunking": bool(rng.integers(2)),
            "compression": [CompressionType.NONE, CompressionType.ZSTD][rng.integers(2)],
            "index_types": [IndexType.ALL, IndexType.NONE][rng.integers(2)],
            "repeat_channels": bool(rng.integers(2)),
            "repeat_schemas": bool(rng.integers(2)),
            "use_statistics": bool(rng.integers(2)),
            "use_summary_offsets": bool(rng.integers(2)),
            "enable_crcs": bool(rng.integers(2)),
        }
    make = McapWriter.__init__

    def init(self: Any, output: Any, **kwargs: Any) -> None:
        make(self, output, **{**kwargs, **options})

    with _unchecked(found), patch.object(McapWriter, "__init__", init):
        out = mcap_writer.Writer(path)
        try:
            out.append(record)
            beside = record.recording if isinstance(record, Estimates) else None
            out.close(record.meta, beside)
        finally:
            out.abort()


def make(seed: int, index: int, folder: Path) -> tuple[Path, str, list[str]]:
    """The file ``index``, the estimator of its kind, and what scores it."""
    rng = np.random.default_rng([seed, index])
    recording, estimates = seeds()[rng.integers(len(seeds()))]
    record: Any = (recording, estimates, replace(estimates, recording=recording))[rng.integers(3)]
    whole = dict(leaves.of(record))
    found = whole if rng.integers(20) == 0 else forged(whole, rng)
    form = ("h5", "mcap")[rng.integers(2)]
    path = folder / f"forged.{form}"
    try:
        if form == "mcap":
            _mcap(found, record, path, rng)
    except Exception:
        form = "h5"
    if form == "h5":
        path = folder / "forged.h5"
        try:
            _h5(found, path)
        except Exception:
            formats.write(record, path, "h5")
    if isinstance(record, Recording):
        with suppress(FormatError):
            origin = {"name": "x", "digest": formats.observed_digest(path)}
            provenance = {**estimates.meta.provenance, "input": origin}
            estimates = replace(estimates, meta=replace(estimates.meta, provenance=provenance))
        formats.write(estimates, folder / "beside.h5", "h5")
        return path, estimates.estimator, [f"{folder}/beside.h5", "--truth", str(path)]
    formats.write(recording, folder / "beside.h5", "h5")
    return path, estimates.estimator, [str(path), "--truth", f"{folder}/beside.h5"]


COMMANDS = ("info", "validate", "convert", "recover", "estimate", "score", "plot")


def words(command: str, path: Path, estimator: str, scored: list[str], folder: Path) -> list[str]:
    """The command's arguments."""
    few = ["--set", "particles=100"] if estimator == "ap-pda" else []
    return {
        "info": ["info", str(path)],
        "validate": ["validate", str(path)],
        "convert": ["convert", str(path), "-o", f"{folder}/out/c.h5"],
        "recover": ["convert", "--recover", str(path), "-o", f"{folder}/out/r.h5"],
        "estimate": ["estimate", "-e", estimator, *few, str(path), "-o", f"{folder}/out/e.h5"],
        "score": ["score", *scored, "-o", f"{folder}/out/s.csv"],
        "plot": ["plot", "scene", str(path), "-o", f"{folder}/out/p.svg"],
    }[command]


def verdicts(path: Path, estimator: str, scored: list[str], folder: Path) -> tuple[str, str]:
    """What becomes of the file: refused or accepted by all alike, or what went wrong.

    A command that ends for another reason, as it lacks something, says nothing of the file.
    """
    ends: dict[str, str] = {}
    for command in COMMANDS:
        shutil.rmtree(folder / "out", ignore_errors=True)
        (folder / "out").mkdir()
        code, text, damaged = _run(words(command, path, estimator, scored, folder))
        made = [p.name for p in (folder / "out").iterdir()]
        if code in (1, None) or "internal error" in text or "Traceback" in text:
            return "internal", f"{command}: {text[-300:]}"
        if made and code not in (0, 3):
            return "left", f"{command}: exit code {code} leaves {made}"
        if code == 0:
            ends[command] = "sound"
        elif damaged or code == 3:
            ends[command] = f"damaged: {text[27:200]}"
    if len({end.partition(":")[0] for end in ends.values()}) > 1:
        return "unequal", json.dumps(ends)
    return ("accepted" if ends.get("validate") == "sound" else "refused"), ""


def _run(arguments: list[str]) -> tuple[int | None, str, bool]:
    """Exit code and stderr of a command, and whether it ended by refusing the file's format."""
    raised: list[FormatError] = []
    init = FormatError.__init__

    def noted(self: FormatError, path: object, where: str, reason: str) -> None:
        init(self, path, where, reason)
        raised.append(self)

    with open(os.devnull, "wb") as null, open("stderr", "w+b") as err:
        kept = os.dup(1), os.dup(2)
        os.dup2(null.fileno(), 1)
        os.dup2(err.fileno(), 2)
        code: int | None = None
        try:
            with patch.object(FormatError, "__init__", noted):
                code = echoset(arguments)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os.dup2(kept[0], 1)
            os.dup2(kept[1], 2)
            os.close(kept[0])
            os.close(kept[1])
        err.seek(0)
        text = err.read().decode("utf-8", "replace")
    own = [e for e in raised if "forged." in e.path and "holds no recording" not in e.reason]
    known = [str(e) for e in own]
    damaged = code == 4 and any(line.split(": ", 1)[-1][:60] in text for line in known)
    return code, text, damaged


@contextmanager
def _hurried() -> Iterator[None]:
    """Without what takes time and finds nothing here: syncing, and room for texts in pictures."""
    from matplotlib.figure import Figure

    init = Figure.__init__

    def plain(self: Any, *args: Any, **kwargs: Any) -> None:
        init(self, *args, **{**kwargs, "layout": None})

    with patch.object(Figure, "__init__", plain), patch.object(os, "fsync", lambda _: None):
        yield


def _loop(seed: int, indices: range, folder: Path, tell: Any) -> None:
    with _hurried():
        _forge(seed, indices, folder, tell)


def _forge(seed: int, indices: range, folder: Path, tell: Any) -> None:
    os.chdir(folder)
    for index in indices:
        start = time.monotonic()
        for old in folder.iterdir():
            shutil.rmtree(old) if old.is_dir() else old.unlink()
        outcome, detail = verdicts(*make(seed, index, folder), folder)
        if time.monotonic() - start > 60:
            outcome, detail = "hung", f"{time.monotonic() - start:.0f} s"
        tell(outcome, detail)


def run(count: int, seed: int = 1, first: int = 0) -> Tally:
    """Forge ``count`` files and give each to all commands."""
    seeds()
    return watched(lambda *args: _loop(seed, *args), first, first + count)


def main() -> int:
    """Run from the command line: what became of the files, 1 if anything was bad."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="write file --first there")
    options = parser.parse_args()
    if options.save:
        print(make(options.seed, options.first, options.save))
        return 0
    tally = run(options.count, options.seed, options.first)
    print(f"forged         {tally}", flush=True)
    for end, details in tally.all.items():
        print(f"    {end}:")
        for detail, number in Counter(d.split(": ", 1)[-1] for d in details).most_common(20):
            example = next(d for d in details if d.endswith(detail))
            print(f"      {number} x {example}", flush=True)
    return int(bool(tally.bad()))


if __name__ == "__main__":
    sys.exit(main())
