"""What a report says first: the numbers of its sentences are those of the scores, by hand."""

from __future__ import annotations

import re

import numpy as np
import pytest

from echoset.cli.main import main
from echoset.formats import scores as archive
from echoset.metrics.kit.table import rows
from echoset.models.records import Scores
from echoset.report import headlines
from echoset.report.summary import few, steps

NAN = np.nan


def one(estimator: str, metric: str, part: str, value: float, stderr: float = NAN, n: int = 4):
    return rows(("s-*", estimator, metric, part), NAN, value, n, stderr)


def left(run: int, estimator: str, metric: str, out: int, of: int) -> Scores:
    return rows((f"s-s1-{run:04d}", estimator, f"{metric}-left-out", ""), NAN, float(out), of)


def text(*pooled: Scores, scores: tuple[Scores, ...] = ()) -> str:
    (found,) = headlines(Scores.join(scores), Scores.join(pooled))
    assert found.scenario == "s"
    return found.text


def test_the_best_and_by_how_much():
    said = text(
        one("slow", "rmse-mean", "device", 0.3, 0.01),
        one("fast", "rmse-mean", "device", 0.2, 0.01),
        one("", "pcrlb-mean", "device", 0.1),
        one("slow", "rmse-mean", "centre", 0.1),
        scores=(left(0, "slow", "rmse", 3, 10), left(1, "fast", "rmse", 0, 10)),
    )
    assert said == (
        "slow and fast on 4 recordings. The RMSE of the device, averaged over time, is smallest "
        "with fast: 0.200 ± 0.010 m; slow has 0.300 ± 0.010 m, 1.5 times as much; the bound pcrlb "
        "is 0.100 m. Scored were 17 of 20 steps."
    )


@pytest.mark.parametrize(("gap", "told"), [(0.05, True), (0.04, False)])
def test_what_the_errors_do_not_tell_apart(gap, told):
    """The difference has the error 0.0224: two of them are 0.0447."""
    said = text(one("a", "gospa", "", 1.0, 0.01), one("b", "gospa", "", 1.0 + gap, 0.02))
    assert ("the standard errors do not tell them apart" in said) != told


def test_a_bound_that_is_not_valid_is_not_told():
    bound = one("", "pcrlb-mean", "device", 0.1), one("", "pcrlb-valid", "device", 0.9)
    assert "pcrlb" not in text(one("a", "rmse-mean", "device", 0.2), *bound)


def test_one_alone_and_none_to_compare_by():
    assert text(one("a", "ospa", "", 1.5, n=1)) == "a on 1 recording. OSPA is 1.50 m."
    assert text(one("a", "nees", "device", 2.0)) == "a on 4 recordings."
    assert headlines(Scores.join([]), one("", "pcrlb-mean", "device", 0.1)) == []


def test_steps_are_counted_and_few_are_told():
    scores = Scores.join([left(0, "a", "rmse", 6, 10), left(1, "a", "rmse", 5, 10)])
    assert steps(scores) == {("s", "rmse"): (9, 20)}
    (line,) = few(scores)
    assert "s: rmse is of 9 of 20 steps" in line and "rmse.max_gap" in line
    assert not list(few(left(0, "a", "rmse", 5, 10)))
    said = text(one("a", "rmse-mean", "device", 0.2), scores=(scores,))
    assert "Scored were only 9 of 20 steps." in said


def test_report_warns_of_few_steps_and_begins_with_the_headline(tmp_path, capsys):
    key = "s-s1-0000", "a", "rmse", "device"
    time = np.arange(4.0)
    table = [rows(key, time, 0.2), rows(key, NAN, 0.2, 4), left(0, "a", "rmse", 6, 10)]
    archive.write(Scores.join(table), tmp_path / "s.csv", "csv")
    assert main(["report", str(tmp_path / "s.csv"), "-o", str(tmp_path / "r.html")]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "rmse is of 4 of 10 steps" in line
    page = (tmp_path / "r.html").read_text()
    first, second = re.findall(r"<h2>(.*?)</h2>", page)[:2]
    assert (first, second) == ("Summary", "Plots")
    assert page.index("only 4 of 10 steps") < page.index("<svg") < page.index("<table")
