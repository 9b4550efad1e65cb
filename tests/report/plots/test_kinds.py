"""Every kind of plot: the same bytes twice, units on its axes, and errors that name what lacks."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from echoset.campaign.pictures import describe, gather
from echoset.models import registry
from echoset.models.errors import InputError, ParameterError
from echoset.report import plots
from echoset.report.plots import Inputs, Selection, style

UWB, GEO = "uwb/uwb-olos-s1-0000.h5", "geo/uwb-olos-s1-0000.eopda-geo.h5"
CASES: dict[str, tuple[str, ...]] = {
    "scene": (UWB, GEO),
    "map": ("maps.h5",),
    "fused": ("maps.h5",),
    "bound": (UWB,),
    "rmse": ("uwb.csv", UWB),
    "cdf": ("uwb.csv",),
    "sets": ("points.csv",),
    "cardinality": ("points.h5", "mbm.h5", "phd.h5"),
    "box": ("uwb.csv",),
    "trace": ("chain.h5",),
}


def inputs(files: Path, *names: str) -> Inputs:
    return gather([str(files / name) for name in names])


def figure(files: Path, kind: str, *names: str, **options: object) -> Figure:
    return plots.figure(kind, inputs(files, *(names or CASES[kind])), **options)


def texts(made: Figure) -> set[str]:
    return {t.get_text() for a in [*made.axes, *made.legends] for t in a.findobj(match_text)}


def match_text(artist: object) -> bool:
    return type(artist).__name__ in ("Text", "Annotation")


def test_every_kind_has_a_case() -> None:
    assert set(CASES) == set(registry.names(plots.GROUP))


@pytest.mark.parametrize("kind", CASES)
def test_bytes_are_equal_and_say_where_they_come_from(
    files: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(style._STYLE, "savefig.dpi", 50)
    found = inputs(files, *CASES[kind])
    known = describe(kind, found)
    magic = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    pair = [plots.figure(kind, found) for _ in range(2)]
    for form, start in magic.items():
        one, two = (plots.save(made, form, known) for made in pair)
        assert one == two and one.startswith(start)
        assert b"Matplotlib v" not in one and b"CreationDate" not in one and b"<dc:date" not in one
        assert f'"plot": "{kind}"'.encode() in one.replace(b"&quot;", b'"')
        assert str(files).encode() not in one


@pytest.mark.parametrize("kind", CASES)
def test_axes_carry_units_and_letters_can_be_read(files: Path, kind: str) -> None:
    made = figure(files, kind)
    labels = [label for a in made.axes for label in (a.get_xlabel(), a.get_ylabel()) if label]
    assert len(labels) >= 2
    for label in labels:
        assert re.search(r"\[(m|s|1|dB|°)\]$", label), label
    for a in made.axes:
        for text in a.findobj(match_text):
            assert not text.get_text() or text.get_fontsize() >= 7


@pytest.mark.parametrize("kind", CASES)
def test_no_text_lies_outside_or_on_another_axis_label(files: Path, kind: str) -> None:
    made = figure(files, kind)
    canvas = FigureCanvasAgg(made)
    canvas.draw()
    renderer = canvas.get_renderer()
    width, height = made.bbox.size
    boxes = []
    for a in made.axes:
        for text in (a.xaxis.label, a.yaxis.label, a.title):
            if text.get_text() and text.get_visible():
                box = text.get_window_extent(renderer)
                assert box.x0 >= -1 and box.y0 >= -1
                assert box.x1 <= width + 1 and box.y1 <= height + 1, text.get_text()
                boxes.append(box)
    for i, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[:i])


def test_what_a_scene_shows(files: Path) -> None:
    shown = texts(figure(files, "scene"))
    assert {"A1", "A2", "A3", "anchor", "truth", "truth, device", "eopda-geo"} <= shown
    assert {"1 link blocked", "2 links blocked"} <= shown
    made = figure(files, "scene", "views.h5")
    assert {"field of view", "regions", "region 1", "detections", "radar"} <= texts(made)
    assert made.get_suptitle() == "surveillance-s1-0000"
    assert "path of a sensor" in texts(figure(files, "scene", "extended.h5", "chain.h5"))


def test_an_ellipse_is_drawn_where_the_object_is(files: Path) -> None:
    truth = inputs(files, UWB).recording.truth.objects
    (lines,) = [a.lines for a in figure(files, "scene", UWB).axes if a.get_xlabel() == "x [m]"]
    outline = next(line for line in lines if len(line.get_xdata()) == 61)
    x, y = outline.get_xdata(), outline.get_ydata()
    centre, axes = truth.columns("x", "y")[0], truth.semi_axes[0]
    assert np.allclose((x.max() + x.min()) / 2, centre[0])
    assert np.allclose((np.ptp(x) / 2, np.ptp(y) / 2), axes, rtol=1e-3)


def test_time_estimators_and_size(files: Path) -> None:
    made = figure(files, "rmse", selection=Selection(0.5, 0.9), size=(8.8, 6.0))
    low, high = made.axes[0].get_xlim()
    assert (low, high) == (0.5, 0.9)
    assert np.allclose(made.get_size_inches() * 2.54, (8.8, 6.0))
    shown = texts(figure(files, "sets", estimators=["phd"]))
    assert "phd" in shown and "mbm" not in shown
    with pytest.raises(InputError, match=r"'pdh' \(did you mean 'phd'\?\)"):
        figure(files, "sets", estimators=["pdh"])
    first = figure(files, "map", selection=Selection(stop=1.5))
    assert {a.get_title() for a in first.axes} >= {f"BS{i}, 1 s" for i in (1, 2, 3, 4)}


def test_scores_of_several_metrics_and_estimators_have_a_panel_each(files: Path) -> None:
    made = figure(files, "sets")
    assert [a.get_title() for a in made.axes] == ["mbm", "phd"] * 2
    assert [a.get_ylabel() for a in made.axes] == ["OSPA [m]"] * 2 + ["GOSPA [m]"] * 2


@pytest.mark.parametrize(
    ("kind", "names", "reason"),
    [
        ("scene", ("uwb.csv",), "needs recordings"),
        ("scene", (UWB, "uwb.csv"), "draws no scores"),
        ("scene", (UWB, "uwb/uwb-olos-s1-0001.h5"), "one recording"),
        ("rmse", (UWB,), "needs scores"),
        ("rmse", ("points.csv",), "no rmse over time"),
        ("cdf", ("points.csv",), "no distribution"),
        ("sets", ("uwb.csv",), "no ospa"),
        ("box", (UWB,), "needs scores"),
        ("cardinality", (UWB,), "needs estimates or scores"),
        ("cardinality", ("uwb.csv",), "score with -m cardinality"),
        ("trace", ("mbm.h5",), "mbm left no trace"),
        ("trace", ("mbm.h5", "phd.h5"), "one file"),
        ("map", (UWB,), "no range_angle_map"),
        ("fused", ("points.h5",), "no range_angle_map"),
        ("bound", ("points.h5",), "two anchors"),
    ],
)
def test_errors_name_what_lacks(
    files: Path, kind: str, names: tuple[str, ...], reason: str
) -> None:
    with pytest.raises(InputError, match=reason) as error:
        figure(files, kind, *names)
    assert error.value.exit_code == 4


def test_errors_of_use(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ParameterError, match="did you mean 'scene'"):
        figure(files, "sceen", UWB)
    with pytest.raises(InputError, match=r"mbm.h5: was made from another recording"):
        inputs(files, UWB, "mbm.h5")
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(ParameterError, match=r"echoset\[plot\]"):
        figure(files, "scene", UWB)
