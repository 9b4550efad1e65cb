"""Times as pictures show them: from 0 on, with the date beside where they have one."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import numpy as np

from ...models.records import Meta
from .protocol import Inputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LATE = 3_600.0
"""Seconds from which on a first time is that of a clock, of the day or another."""
_DATED = 1e8
"""Seconds after 1970 above which a time is that of a clock that knows the date."""


def time_axis(axes: Axes, inputs: Inputs) -> None:
    """Label an axis of time, which starts at 0: where times are those of a day, that is said."""
    start, since = origin(float(axes.dataLim.x0), inputs)
    axes.set_xlabel(f"time{since} [s]")
    if start:
        from matplotlib.ticker import FuncFormatter, MaxNLocator

        class Shifted(MaxNLocator):
            """Ticks at round times after the start."""

            def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
                ticks = super().tick_values(vmin - start, vmax - start)
                return [tick + start for tick in ticks]

        axes.xaxis.set_major_locator(Shifted("auto", steps=[1, 2, 2.5, 5, 10]))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda t, _: f"{round(t - start, 6):g}"))


def origin(first: float, inputs: Inputs) -> tuple[float, str]:
    """The time [s] from which a picture counts that shows what begins at ``first``, and its words.

    Times from an hour on, as those of a day are, count from their first second.
    """
    metas = [r.meta for r in inputs.recordings] + [e.meta for e in inputs.estimates]
    epoch = metas[0].epoch if metas else Meta("").epoch
    if not np.isfinite(first) or abs(first) < _LATE:
        return 0.0, ""
    start = float(np.floor(first))
    if epoch == Meta("").epoch and start < _DATED:
        return start, f" after {start:.0f} s"
    try:
        date = datetime.fromisoformat(epoch).astimezone(UTC) + timedelta(seconds=start)
    except (ValueError, OverflowError):
        return start, f" after {start:.0f} s"
    return start, f" since {date:%Y-%m-%d %H:%M:%S} UTC"


def moment(time: float, inputs: Inputs) -> str:
    """A time [s] as words."""
    start, since = origin(time, inputs)
    return f"{time - start:g} s{since}"
