"""Sensor models from recordings with truth: what ``echoset calibrate`` does."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import floor, isfinite, log10
from pathlib import PurePath
from typing import Any

from .. import formats
from ..formats.provenance import versions
from ..metrics.calibration.quantities import Calibration, Quantity
from ..metrics.calibration.run import Params, calibrate
from ..models.errors import InputError, ParameterError
from ..models.parameters import as_dict, resolve
from ..models.records import Recording
from . import truth
from .files import inputs
from .files.outputs import DASH, refuse_collisions, say, single
from .layers import layers

UNKNOWN = "not told by these recordings"


def run(
    sources: Sequence[str],
    true: Sequence[str],
    streams: str | None,
    config: str | None,
    settings: Iterable[str],
    output: str,
    picture: str | None,
    overwrite: bool,
) -> None:
    """Calibrate the streams of recordings, write their parameters and say how sure they are.

    Raises
    ------
    ParameterError : an impossible parameter or output
    InputError : an input has no truth, or too little is seen of it
    OutputError : an output exists or cannot be written
    """
    from ..report import plots

    refuse_collisions([("-o", output), ("--plot", picture)], (*sources, *true))
    target = single(output, "yaml", overwrite)
    drawn = None
    if picture is not None:
        suffix = PurePath(picture).suffix
        if suffix not in plots.FORMATS:
            raise ParameterError(f"--plot {picture}: pictures are written as .png, .svg or .pdf")
        drawn = single(picture, plots.FORMATS[suffix], overwrite)
    params = resolve(Params, *layers(config, settings))
    recordings = [_read(source, true) for source in sources]
    names = tuple(name.strip() for name in streams.split(",")) if streams else ()
    found = calibrate(recordings, params, names)
    target.write_bytes(text(found, recordings).encode())
    if drawn is not None:
        about = {
            "calibration": [r.meta.name for r in recordings],
            "parameters": as_dict(params),
            "versions": versions(),
        }
        left = {one.stream: (one.residuals, one.nodes) for one in found}
        drawn.write_bytes(plots.save(plots.residuals(left), drawn.format, about))
    if output != DASH:
        for line in table(found):
            say(line)


def _read(source: str, true: Sequence[str]) -> Recording:
    """A recording with its truth, its own or that of the same among the files ``true``."""
    found = inputs.read_any(source)
    name = inputs.label(source)
    if not isinstance(found, Recording):
        raise InputError(f"{name}: is no recording")
    if true:
        path = truth.of_recording(found, name, true)
        other = formats.read(path, str(path))
        assert isinstance(other, Recording)
        found = replace(found, truth=other.truth)
    if found.truth is None:
        raise InputError(f"{name}: has no truth: name a recording that has it, by --truth")
    return found


def text(found: Sequence[Calibration], recordings: Sequence[Recording]) -> str:
    """The parameters as YAML that ``--config`` takes, with what stands behind them as comments."""
    lines = [f"# Sensors by echoset calibrate from {', '.join(r.meta.name for r in recordings)}."]
    radars = [one for one in found if one.kind != "uwb"]
    if radars:
        lines.append("sensors:")
    for one in found:
        indent = "    " if one.kind != "uwb" else ""
        if indent:
            lines.append(f"  {one.stream}:")
        for name, value in one.settings.items():
            told = [q for q in one.quantities if _tells(name, q)]
            lines.append(f"{indent}{name}: {_value(value, told)}  # {_said(told)}")
        lines += [
            f"{indent}# {q.name}: {_number(q)} {q.unit}, {_errors(q)}"
            for q in one.quantities
            if not any(_tells(name, q) for name in one.settings)
        ]
        nis = ", ".join(f"{x:.2f}" for x in one.nis)
        lines.append(f"{indent}# mean square of either half's residuals by the other: {nis} of 1")
    return "\n".join(lines) + "\n"


def _tells(name: str, q: Quantity) -> bool:
    """Whether a quantity is that of a parameter."""
    if name == "registration":
        return q.name.startswith("registration_")
    return q.name == name or (name == "range_bias" and q.name.startswith("offset "))


def _value(value: Any, told: Sequence[Quantity]) -> str:
    """A value with as many digits as it is known to."""
    values = value if isinstance(value, list) else [value]
    smallest = [q.stderr for q in told if isfinite(q.stderr)]
    error = min(smallest, default=abs(float(values[0])) / 100 or 1e-3)
    shown = [f"{float(v):.{_digits(error)}f}" for v in values]
    return f"[{', '.join(shown)}]" if isinstance(value, list) else shown[0]


def _digits(error: float) -> int:
    """Digits behind the point that an error leaves."""
    return min(max(1 - floor(log10(error)), 0), 9) if error > 0 else 6


def _number(q: Quantity) -> str:
    return f"{q.value:.{_digits(q.stderr)}f}" if isfinite(q.stderr) else f"{q.value:.3g}"


def _said(told: Sequence[Quantity]) -> str:
    return "; ".join(f"{_number(q)} {q.unit}, {_errors(q)}" for q in told)


def _errors(q: Quantity) -> str:
    """Standard error, and how far the halves are apart."""
    if not isfinite(q.stderr):
        return UNKNOWN
    split = f", halves differ by {q.split:+.1f} standard errors" if isfinite(q.split) else ""
    return f"standard error {q.stderr:.2g}{split}"


def table(found: Sequence[Calibration]) -> Iterator[str]:
    """What was found, line by line."""
    for one in found:
        yield f"{one.stream}  ({one.kind})"
        yield f"  {'':28s} {'value':>12s} {'stderr':>10s} {'halves':>8s}"
        for q in one.quantities:
            error = f"{q.stderr:10.2g}" if isfinite(q.stderr) else "   unknown"
            split = f"{q.split:+8.1f}" if isfinite(q.split) else f"{'-':>8s}"
            yield f"  {q.name:28s} {_number(q):>12s} {error} {split}  {q.unit}"
        yield f"  residuals of either half by the other: {one.nis[0]:.2f}, {one.nis[1]:.2f} of 1"
