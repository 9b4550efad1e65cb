"""What limits cut off: said once, by the expected number of targets that went with it."""

from __future__ import annotations

import logging
from collections.abc import Mapping

Cut = Mapping[str, float]
"""Expected targets (for ``max_detections``: detections) that each limit cut off at a time."""
WORTH_SAYING = 0.05
"""Expected targets whose loss is worth a word; what is not kept in a file always is."""
WHAT = {
    "max_detections": "of them",
    "pairs": "pairs with targets",
    "max_hypotheses": "groups of targets, whose associations are told by their marginals",
}
"""What a limit cuts off that is no expected target."""
_log = logging.getLogger(__name__)


class Told:
    """The limits that have been told of in a recording."""

    def __init__(self) -> None:
        self._names: set[str] = set()

    def warn(self, cut: Cut, time_ns: int, detections: int) -> None:
        """Warn of each limit the first time that it cuts more than next to nothing."""
        for name, mass in cut.items():
            least = 1e-3 if name == "keep_components" else WORTH_SAYING
            if mass > least and name not in self._names:
                self._names.add(name)
                what = WHAT.get(name, "expected targets")
                text = "scans at %d ns: of %d detections, %s cuts off %.4g %s; said once"
                _log.warning(text, time_ns, detections, name, mass, what)
