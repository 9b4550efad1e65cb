"""What can be read off a picture: times from 0 on, names apart, no entries of nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from support.builders import SECOND, objects, radar, recording

from echoset.metrics.kit.table import rows
from echoset.models.records import Estimates, Meta, Recording, Scores, Sensor
from echoset.report import plots
from echoset.report.plots import Inputs, clock

UNIX = 1_732_340_000
"""2024-11-23T05:33:20Z, as `date -u -d @1732340000` says."""


def walk(start: int = 0, **meta: str) -> Recording:
    """An object that goes along x for 20 s from ``start`` [s] and 0.3 s on."""
    made = recording({}, objects([[(float(k), 0.0)] for k in range(20)]))
    truth = made.truth.objects
    moved = replace(truth, time_ns=truth.time_ns + start * SECOND + 300_000_000)
    truth = replace(made.truth, objects=moved)
    return replace(made, truth=truth, meta=Meta("walk", **meta))


def over_time(made: plots.Inputs, kind: str = "scene"):
    """The axes of time, drawn."""
    figure = plots.figure(kind, made)
    FigureCanvasAgg(figure).draw()
    return next(a for a in figure.axes if a.get_xlabel().startswith("time"))


@pytest.mark.parametrize(
    ("start", "epoch", "label"),
    [
        (0, "", "time [s]"),
        (UNIX, "", "time since 2024-11-23 05:33:20 UTC [s]"),
        (345_600, "", "time after 345600 s [s]"),
        (90_000, "2024-11-22T00:00:00Z", "time since 2024-11-23 01:00:00 UTC [s]"),
        (90_000, "2024-11-22T02:00:00+02:00", "time since 2024-11-23 01:00:00 UTC [s]"),
    ],
)
def test_time_starts_at_zero_with_its_date_beside(start, epoch, label):
    axes = over_time(Inputs(recordings=(walk(start, **({"epoch": epoch} if epoch else {})),)))
    assert axes.get_xlabel() == label
    ticks = [t for t in axes.get_xticks() if axes.get_xlim()[0] <= t <= axes.get_xlim()[1]]
    shown = [t.get_text().replace("\N{MINUS SIGN}", "-") for t in axes.get_xticklabels()]
    assert "0" in shown and set(shown) <= {f"{x:g}" for x in np.arange(-5, 30, 0.5)}
    assert min(ticks) - start == pytest.approx(0.0, abs=1e-6)


def test_scores_over_time_start_at_zero():
    table = rows(("s-*", "e", "rmse", "device"), UNIX + np.arange(1.0, 30.0), 1.0, 9, 0.1)
    axes = over_time(Inputs(scores=table, pooled=table), "rmse")
    assert axes.get_xlabel() == "time since 2024-11-23 05:33:21 UTC [s]"


def test_moments_are_words():
    assert clock.moment(2.5, Inputs()) == "2.5 s"
    assert clock.moment(UNIX + 0.25, Inputs()) == "0.25 s since 2024-11-23 05:33:20 UTC"


def test_no_entry_of_nothing():
    """Estimates without an object, and a bound that is valid nowhere."""
    made = walk()
    nothing = replace(objects([[] for _ in range(20)]), state=np.zeros((0, 2)))
    empty = Estimates(Meta("walk", provenance={"estimator": "blind"}), nothing, {})
    figure = plots.figure("scene", Inputs(recordings=(made,), estimates=(empty,)))
    (legend,) = figure.legends
    assert [t.get_text() for t in legend.get_texts()] == ["truth"]
    time = np.arange(5.0)
    table = Scores.join(
        [
            rows(("s-*", "e", "rmse", "device"), time, 1.0, 9, 0.1),
            rows(("s-*", "", "pcrlb", "device"), time, 0.1, 9),
            rows(("s-*", "", "pcrlb-valid", "device"), time, 0.0, 9),
        ]
    )
    (legend,) = plots.figure("rmse", Inputs(scores=table, pooled=table)).legends
    assert [t.get_text() for t in legend.get_texts()] == ["e", "pcrlb, not valid"]


def test_names_cover_neither_each_other_nor_places():
    """Forty anchors, most of them in one corner: those whose name has room have one."""
    rng = np.random.default_rng(3)
    near, far = rng.uniform(0, 2, (30, 2)), rng.uniform(0, 19, (10, 2))
    at = np.concatenate((near, far))
    sensors = {f"anchor-{i}": Sensor.static("anchor", p) for i, p in enumerate(at)}
    figure = plots.figure("scene", Inputs(recordings=(replace(walk(), sensors=sensors),)))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (above,) = (a for a in figure.axes if a.get_xlabel() == "x [m]")
    boxes = [t.get_window_extent(canvas.get_renderer()) for t in above.texts]
    assert len(boxes) >= 10
    assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
    inside = above.get_window_extent()
    for box, text in zip(boxes, above.texts, strict=True):
        assert inside.contains(box.x0, box.y0) and inside.contains(box.x1, box.y1)
        marks = above.transData.transform(at)
        assert not any(box.contains(*mark) for mark in marks), text.get_text()


def test_truth_is_drawn_over_dots():
    streams = {"r": radar([[(float(k), 0.0)] for k in range(20)])}
    made = replace(walk(), streams=streams, sensors=recording(streams).sensors)
    figure = plots.figure("scene", Inputs(recordings=(made,)))
    for axes in figure.axes:
        truth = [line for line in axes.lines if line.get_label() == "truth"]
        dots = [d.get_zorder() for d in axes.collections]
        assert truth and min(line.get_zorder() for line in truth) > max(dots, default=0)


@pytest.mark.parametrize(
    ("column", "values", "label", "shown"),
    [
        ("doppler", [-3.0, 0.0, 2.0], "Doppler [m/s]", [-3.0, 0.0, 2.0]),
        ("power", [100.0, 10.0, 1.0], "power over the noise [dB]", [20.0, 10.0, 0.0]),
        ("amplitude", [10.0, 1.0, 0.0], "amplitude [dB]", [20.0, 0.0]),
        ("rcs", [10.0, 0.1, 1.0], "radar cross-section [dBsm]", [10.0, -10.0, 0.0]),
    ],
)
def test_detections_have_the_colour_of_what_is_known_of_them(column, values, label, shown):
    """Decibels by hand; a detection without power at all stays grey."""
    seen = radar([[(1, 0), (2, 0)], [], [(3, 0)]])
    seen = replace(seen, rows={**seen.rows, column: np.array(values)})
    figure = plots.figure("scene", Inputs(recordings=(recording({"R": seen}),)))
    FigureCanvasAgg(figure).draw()
    bar = next(a for a in figure.axes if a.get_ylabel() == label)
    for axes in (a for a in figure.axes if a is not bar):
        coloured = [c for c in axes.collections if c.get_array() is not None]
        np.testing.assert_allclose(coloured[0].get_array(), shown, atol=1e-9)
        if column == "doppler":
            low, high = coloured[0].get_clim()
            assert low == -high


def test_doppler_of_one_radar_beside_another_without(tmp_path):
    both = {"A": radar([[(1, 0)], [(2, 0)]], "A"), "B": radar([[(5, 0)]], "B")}
    doppler = {**both["A"].rows, "doppler": np.array([1.0, 2.0])}
    made = recording(both | {"A": replace(both["A"], rows=doppler)})
    figure = plots.figure("scene", Inputs(recordings=(made,)))
    above = next(a for a in figure.axes if a.get_xlabel() == "x [m]")
    grey, coloured = (c for c in above.collections if len(c.get_offsets()))
    np.testing.assert_array_equal(grey.get_offsets()[:, 0], [5.0])
    np.testing.assert_array_equal(coloured.get_offsets()[:, 0], [1.0, 2.0])
