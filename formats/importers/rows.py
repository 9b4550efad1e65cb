"""The rows of a log, in any order, as the scans or link events of a stream."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...models.records import Array, Stream


def to_stream(
    kind: str,
    nodes: tuple[str, ...],
    model: Mapping[str, object],
    time_ns: Array,
    keys: Mapping[str, Array],
    rows: Mapping[str, Array],
    detected: Array | None = None,
) -> Stream:
    """Sort rows stably by (time, keys) and make one scan of those that agree in all of them.

    ``time_ns``, ``keys`` and ``rows`` are columns (m,); the keys, most significant first, become
    scan columns. Rows that are not ``detected`` (m,) open their scan, but are left out of it.
    """
    m = len(time_ns)
    order = np.lexsort((*reversed(list(keys.values())), time_ns))
    kept = np.ones(m, bool) if detected is None else detected[order]
    sort = {name: values[order] for name, values in keys.items()}
    time = time_ns[order]
    first = np.ones(m, bool)
    first[1:] = np.logical_or.reduce([v[1:] != v[:-1] for v in (time, *sort.values())])
    count = np.concatenate([[0], np.cumsum(kept)])
    offset = np.append(count[np.flatnonzero(first)], count[-1]).astype(np.int64)
    return Stream(
        kind,
        nodes,
        model,
        time[first],
        offset,
        {name: values[first] for name, values in sort.items()},
        {name: values[order][kept] for name, values in rows.items()},
    )


def pad(columns: Mapping[str, Array], detected: Array, more: int) -> tuple[dict[str, Array], Array]:
    """Columns and ``detected`` with ``more`` rows behind that are no detections."""
    tail = np.full(more, np.nan)
    padded = {key: np.concatenate([values, tail]) for key, values in columns.items()}
    return padded, np.concatenate([detected, np.zeros(more, bool)])


def restart(time: Array, group: Array) -> int | None:
    """The row at which the clock of a ``group`` (m,) begins anew, or None.

    A row that is late falls behind those before it; where the time *rises* behind them, a second
    pass has begun.
    """
    for g in np.unique(group).tolist():
        rows = np.flatnonzero(group == g)
        t = time[rows]
        behind = t < np.maximum.accumulate(t)
        rises = behind[1:] & behind[:-1] & (np.diff(t) > 0)
        if rises.any():
            last = int(rises.argmax())
            return int(rows[last - int(behind[last::-1].argmin()) + 1])
    return None
