"""The checks of a record that passes in windows: each window, and that none goes back in time."""

from __future__ import annotations

from ..models.checks import check_objects, check_steps, check_stream, check_truth
from ..models.place import Place
from ..models.records import Array, Estimates, Recording


class Watch:
    """Checks the windows of one record, called ``path`` in errors."""

    def __init__(self, path: object) -> None:
        self._path = path
        self._last: dict[str, int] = {}

    def check(self, window: Recording | Estimates) -> None:
        """Raise :class:`FormatError` where the window breaks its contract."""
        if isinstance(window, Estimates):
            check_objects(window.objects, "objects", self._path)
            check_steps(window.steps, len(window.objects.time_ns), self._path)
            self._follow("objects", window.objects.time_ns, strictly=False)
            return
        for name, stream in window.streams.items():
            place = f"streams/{name}"
            check_stream(stream, window.sensors, name, self._path, self._last.get(place))
            self._follow(place, stream.time_ns, strictly=False)
        if window.truth is not None:
            truth = window.truth
            check_truth(truth, window, self._path)
            self._follow("truth/objects", truth.objects.time_ns, strictly=True)
            self._follow("truth/blocked", truth.blocked_time_ns, strictly=False)

    def _follow(self, place: str, time_ns: Array, strictly: bool) -> None:
        if not len(time_ns):
            return
        before = self._last.get(place)
        if before is not None and time_ns[0] < before + strictly:
            at = Place(self._path, f"{place}/time_ns")
            at.fail(f"{time_ns[0]} is out of order after {before}", 0)
        self._last[place] = int(time_ns[-1])
