"""Tables hold the right numbers in the right cells, and every format can be read back."""

from __future__ import annotations

import csv
import html.parser
import io
import json
from typing import Any

import numpy as np
import pytest

from echoset import report
from echoset.models.errors import InputError, ParameterError
from echoset.models.records import Scores
from echoset.report import Number, Table
from echoset.report.table import figures

NAN = np.nan


def scores(*rows: tuple[str, str, str, str, float, float, int, float]) -> Scores:
    recording, estimator, metric, part, *numbers = zip(*rows, strict=True)
    time, value, n, stderr = map(np.array, numbers)
    return Scores(recording, estimator, metric, part, time, value, n, stderr)


POOLED = scores(
    ("s-*", "", "pcrlb", "device", 1.0, 0.01, 9, 0.0),
    ("s-*", "", "pcrlb", "device", NAN, 0.02, 9, 0.0),
    ("s-*", "", "pcrlb-mean", "device", NAN, 0.03, 9, 0.0),
    ("s-*", "", "pcrlb-valid", "device", 1.0, 0.0, 9, NAN),
    ("s-*", "", "pcrlb-valid", "device", NAN, 1.0, 9, NAN),
    ("s-*", "geo", "rmse", "device", 2.0, 0.2, 9, 0.01),
    ("s-*", "geo", "rmse", "device", 1.0, 0.1, 9, 0.01),
    ("s-*", "geo", "rmse", "device", NAN, 0.15, 9, 0.02),
    ("s-*", "geo", "rmse", "device@1:2", NAN, 0.16, 9, 0.02),
    ("s-*", "geo", "rmse-mean", "device", NAN, 0.13, 9, 0.03),
    ("s-*", "geo", "time-per-step", "", NAN, 0.008, 9, NAN),
    ("s-*", "geo", "cdf", "device<=0.5", NAN, 0.9, 9, NAN),
    ("s-*", "geo", "cdf", "device<=0.02", NAN, 0.4, 9, NAN),
    ("s-*", "geo", "nees", "device", NAN, 2.1, 9, 0.1),
)


def test_default_layout() -> None:
    average, series, distribution, others = report.tables(POOLED)
    assert average.columns[3:] == ("avg. RMSE [m]", "RMSE [m]", "1:2 s", "time per step [s]")
    geo = (Number(0.13, 0.03), Number(0.15, 0.02), Number(0.16, 0.02), 0.008)
    assert average.rows[0][:6] == ("s", "geo", 9, *geo[:3])
    assert average.rows[0][6].value == 0.008
    assert average.rows[1][:5] == ("s", "pcrlb", 9, Number(0.03, 0.0), Number(0.02, 0.0))
    assert series.columns == ("time", "geo", "pcrlb")
    assert series.rows[0] == (1.0, Number(0.1, 0.01), Number(0.01, 0.0, valid=False))
    assert series.rows[1] == (2.0, Number(0.2, 0.01), None)
    assert [r[0] for r in distribution.rows] == ["0.02", "0.5"]
    assert [r[1].value for r in distribution.rows] == [0.4, 0.9]
    assert [r[:3] for r in others.rows] == [("s", "nees", "device")]


def test_grouping() -> None:
    (table,) = report.tables(POOLED, ["metric", "estimator"])
    assert table.columns[:2] == ("metric", "estimator")
    lines = {r[:2]: dict(zip(table.columns, r, strict=True)) for r in table.rows}
    assert lines["rmse", "geo"]["device@1:2"].value == 0.16
    assert lines["rmse", "pcrlb"]["device"].value == 0.02
    (table,) = report.tables(POOLED, ["time"])
    assert [r[0] for r in table.rows] == [1.0, 2.0]
    with pytest.raises(ParameterError, match="by"):
        report.tables(POOLED, ["colour"])


def test_several_recordings_in_one_cell() -> None:
    rows = [(f"s-s1-000{i}", "geo", "rmse", "device", NAN, 0.1 * i, 5, NAN) for i in (1, 2)]
    with pytest.raises(InputError, match="pool"):
        report.tables(scores(*rows), ["estimator"])
    (table,) = report.tables(scores(*rows), ["recording"])
    assert [(r[0], r[1].value) for r in table.rows] == [("s-s1-0001", 0.1), ("s-s1-0002", 0.2)]
    bound = ("s-s1-0001", "", "pcrlb", "device", NAN, 0.01, 5, NAN)
    (table,) = report.tables(scores(bound, *rows, bound), ["recording", "estimator"])
    assert len(table.rows) == 3
    (average,) = report.tables(scores(*rows))
    assert [(r[2], r[3].value) for r in average.rows] == [(1, 0.1), (1, 0.2)]


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (Number(0.13456, 0.0021), "0.135 ± 0.002"),
        (Number(0.13456, 0.0012), "0.1346 ± 0.0012"),
        (Number(0.13456, 0.0096), "0.135 ± 0.010"),
        (Number(0.13456), "0.135"),
        (Number(0.13456, 0.0), "0.135"),
        (Number(123.456, 20.0), "123 ± 20"),
        (Number(0.0), "0.00"),
        (Number(12345.6), "12346"),
        (Number(1e-20), "1e-20"),
        (Number(-0.7438, NAN, valid=False), "(-0.744)"),
    ],
)
def test_figures(number: Number, text: str) -> None:
    assert figures(number) == text


EVIL = Table(
    "a <b> & |c| 50%_{x}",
    ("na|me", "val#ue", "n"),
    (("<script>--> \\", Number(1 / 3, 0.01), 5), ("ü~^$", Number(2.0, NAN, False), None)),
)


class Cells(html.parser.HTMLParser):
    """Texts of the cells of a page, and its tags."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.texts: list[str] = []

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.append(tag)

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_html_is_escaped_and_complete() -> None:
    page = report.render([EVIL], "html", {"a": "--><script>"})
    cells = Cells()
    cells.feed(page)
    assert "script" not in cells.tags and "link" not in cells.tags and "img" not in cells.tags
    assert {"<script>--> \\", "0.333 ± 0.010", EVIL.title} <= set(cells.texts)
    assert cells.tags.count("td") == 6 and cells.tags.count("th") == 3


def test_json_and_csv_hold_all_digits() -> None:
    tree = json.loads(report.render([EVIL], "json", {"a": 1}))
    assert tree["provenance"] == {"a": 1}
    (table,) = tree["tables"]
    assert table["columns"] == list(EVIL.columns)
    assert table["rows"][0][1] == {"value": 1 / 3, "stderr": 0.01, "valid": True}
    assert table["rows"][1][1:] == [{"value": 2.0, "stderr": None, "valid": False}, None]
    lines = report.render([EVIL, EVIL], "csv", {"a": 1}).splitlines()
    assert lines[0] == '# provenance: {"a": 1}' and lines[1] == f"# {EVIL.title}"
    rows = list(csv.reader(io.StringIO("\n".join(lines[2:5]))))
    assert rows[0] == ["na|me", "val#ue", "val#ue stderr", "val#ue valid", "n"]
    assert [float(x) for x in rows[1][1:]] == [1 / 3, 0.01, 1, 5]
    assert rows[2][1:] == ["2.0", "", "0", ""]
    assert lines[5] == "" and lines[6] == lines[1]


def test_markdown_and_latex_are_escaped() -> None:
    text = report.render([EVIL], "md", {"a": "-->"})
    assert text.count("-->") == 1
    assert r"| \<script\>--\> \\ | 0.333 ± 0.010 | 5 |" in text
    assert r"| na\|me |" in text and "|---|---:|---:|" in text
    text = report.render([EVIL], "latex")
    assert r"\textless{}script\textgreater{}--\textgreater{} \textbackslash{} &" in text
    assert r"0.333 $\pm$ 0.010 & 5 \\" in text
    assert r"\"u" not in text and r"ü\textasciitilde{}\textasciicircum{}\$ & (2.00) &  \\" in text
    assert r"50\%\_\{x\}" in text and r"val\#ue" in text and "{lrr}" in text


def test_empty_tables_and_unknown_format() -> None:
    for format in report.FORMATS:
        assert isinstance(report.render([], format), str)
        assert "a" in report.render([Table("", ("a",), ())], format)
    with pytest.raises(ParameterError, match="latex"):
        report.render([], "latx")
    assert report.tables(Scores((), (), (), (), *(np.zeros(0),) * 4)) == []


HOSTILE = scores(
    ("s-*", "=1+1", "a\x1b[31m", "b\x07\u202ec", NAN, 0.5, 9, NAN),
    ("s-*", "@x", "a\x1b[31m", "b\x07\u202ec", NAN, 0.25, 9, NAN),
)


@pytest.mark.parametrize("form", ["md", "csv", "latex", "html"])
def test_names_are_shown_escaped(form: str) -> None:
    made = report.tables(HOSTILE, ("estimator", "metric", "part"))
    text = report.render(made, form, {})
    assert all(c.isprintable() or c == "\n" for c in text)
    for shown in ("x1b[31m", "x07", "u202ec"):
        assert shown in text
    if form == "csv":
        cells = [row[0] for row in csv.reader(io.StringIO(text)) if row]
        assert "'=1+1" in cells and "@x" in cells


def test_json_holds_names_as_they_are() -> None:
    made = report.tables(HOSTILE, ("estimator", "metric", "part"))
    (table,) = json.loads(report.render(made, "json", {}))["tables"]
    assert table["rows"][0][:3] == ["=1+1", "a\x1b[31m", "b\x07\u202ec"]
