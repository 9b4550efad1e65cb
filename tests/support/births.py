"""Births at the first scan alone, so that what is enumerated or solved at once has few targets."""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import pytest


def at_the_first_scan_alone(monkeypatch: pytest.MonkeyPatch, filter_: ModuleType) -> None:
    """Let the ``predict`` of a filter forget its components of births after the first time."""
    whole = filter_.predict

    def predict(state, params, time_ns):
        births = params.birth_components if state.time_ns is None else ()
        return whole(state, replace(params, birth_components=births), time_ns)

    monkeypatch.setattr(filter_, "predict", predict)
