"""A report as one page of HTML: what it says first, plots, tables, gaps, parameters, provenance.

It needs no script, no font and no file but itself, and it fits a phone: wide tables scroll in a
frame of their own, long ones are folded, plots are drawn at the width of a phone and arranged in
columns.
"""

from __future__ import annotations

import html
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..models.names import printable
from .summary import Headline
from .table import Cell, Table, as_shown, plain

LONG = 12
"""Lines above which a table is folded."""
_LEADS = {"rmse": "rmse"}
"""The kind of plot that shows a metric best; ``sets`` for all others."""
_STYLE = """
:root{color-scheme:light}
*{box-sizing:border-box}
body{font:16px/1.45 system-ui,sans-serif;color:#111;background:#fff;max-width:76rem;
margin:0 auto;padding:1rem}
h1{font-size:1.5rem;margin:.2rem 0}
h2{font-size:1.15rem;margin:2rem 0 .5rem;border-bottom:2px solid #0072b2}
h3{font-size:1rem;margin:1.2rem 0 .3rem}
p{margin:.4rem 0}
nav a{margin-right:1rem}
a{color:#005a8e}
.scroll{overflow:auto;margin:.3rem 0 1.2rem;width:fit-content;max-width:100%}
table{border-collapse:separate;border-spacing:0;font-variant-numeric:tabular-nums;font-size:.92rem}
th,td{padding:.25rem .7rem;border-bottom:1px solid #ddd;text-align:right;white-space:nowrap}
th{background:#e6eff5;position:sticky;top:0;z-index:1}
th:first-child,td:first-child{position:sticky;left:0}
td:first-child{background:#fff}
th:first-child{z-index:2}
th.t,td.t{text-align:left}
td.w{white-space:normal;min-width:14rem}
.plots{columns:20rem;column-gap:1.5rem}
figure{margin:0 0 1.4rem;break-inside:avoid}
figure svg{display:block;width:100%;max-width:34rem;height:auto}
figcaption{font-weight:600;padding:.2rem 0}
pre{overflow:auto;background:#f4f4f4;padding:.6rem;font-size:.8rem;max-height:24rem}
.lead{max-width:34rem}
summary{font-weight:600;padding:.2rem 0;cursor:pointer}
@media print{nav{display:none}}
"""


@dataclass(frozen=True, slots=True)
class Picture:
    """A plot of a ``kind`` that shows a scenario: its title and its ``<svg>`` element."""

    scenario: str
    kind: str
    title: str
    svg: str


def page(
    tables: Sequence[Table],
    provenance: Mapping[str, Any],
    plots: Sequence[Picture] | None = None,
    gaps: Table | None = None,
    headlines: Sequence[Headline] = (),
) -> str:
    """The page; without ``plots`` a line says how to get them, without ``gaps`` nothing of them."""
    tables = [as_shown(t) for t in tables]
    leads = [_lead(h, plots or ()) for h in headlines]
    others = None if plots is None else [p for p in plots if p not in leads]
    sections = {
        "Summary": "".join(map(_headline, headlines, leads)),
        "Plots": _plots(others) if others or not any(leads) else "",
        "Tables": "".join(_table(t) for t in tables if not _timed(t)),
        "Over time": "".join(_table(t) for t in tables if _timed(t)),
        "Failures and gaps": "" if gaps is None else _gaps(as_shown(gaps)),
        "Parameters": "".join(map(_table, _parameters(provenance))),
        "Provenance": _provenance(provenance),
    }
    kept = {title: body for title, body in sections.items() if body}
    links = "".join(f'<a href="#{_anchor(t)}">{t}</a>\n' for t in kept)
    body = "".join(
        f'<section id="{_anchor(title)}">\n<h2>{title}</h2>\n{body}</section>\n'
        for title, body in kept.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>echoset report</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f"<h1>echoset report</h1>\n<nav>\n{links}</nav>\n{body}</body>\n</html>\n"
    )


def _lead(headline: Headline, plots: Sequence[Picture]) -> Picture | None:
    """The plot that shows what the headline says."""
    mine = [p for p in plots if p.scenario == headline.scenario]
    kind = _LEADS.get(headline.metric, "sets")
    return next((p for p in mine if p.kind == kind), mine[0] if mine else None)


def _headline(headline: Headline, lead: Picture | None) -> str:
    title, text = (html.escape(printable(t)) for t in (headline.scenario, headline.text))
    figure = "" if lead is None else f'<div class="lead">\n{_figure(lead)}</div>\n'
    return f"<h3>{title}</h3>\n<p>{text}</p>\n{figure}"


def _timed(table: Table) -> bool:
    """Whether a table has a line for each time: it comes after the plots, which show the same."""
    return table.columns[:1] == ("time",)


def _anchor(title: str) -> str:
    return title.lower().replace(" ", "-")


def _table(table: Table) -> str:
    """A table in its frame, folded if long: columns of text to the left, long texts wrapped."""
    kind = ["t" if isinstance(c, str) else "" for c in first(table)]

    def line(cells: Sequence[str], tag: str) -> str:
        inside = ""
        for text, k in zip(cells, kind, strict=True):
            names = k + (" w" if tag == "td" and len(text) > 40 else "")
            attribute = f' class="{names}"' if names else ""
            inside += f"<{tag}{attribute}>{html.escape(text)}</{tag}>"
        return f"<tr>{inside}</tr>\n"

    title = html.escape(table.title)
    head = f"<h3>{title}</h3>\n" if title else ""
    text = f'<div class="scroll" role="region" aria-label="{title or "table"}" tabindex="0">\n'
    text += f"<table>\n<thead>\n{line(table.columns, 'th')}</thead>\n<tbody>\n"
    text += "".join(line([plain(c) for c in row], "td") for row in table.rows)
    text += "</tbody>\n</table>\n</div>\n"
    if len(table.rows) <= LONG:
        return head + text
    count = f"{title}{', ' if title else ''}{len(table.rows)} lines"
    return f"<details>\n<summary>{count}</summary>\n{text}</details>\n"


def first(table: Table) -> list[Cell]:
    """A cell of each column that tells its alignment."""
    columns = zip(*table.rows, strict=True) if table.rows else [()] * len(table.columns)
    return [next((c for c in column if c is not None), "") for column in columns]


def _plots(plots: Sequence[Picture] | None) -> str:
    if plots is None:
        return "<p>Plots need Matplotlib: <code>pip install 'echoset[plot]'</code>.</p>\n"
    if not plots:
        return "<p>Nothing among the scores that a plot shows.</p>\n"
    return f'<div class="plots">\n{"".join(map(_figure, plots))}</div>\n'


def _figure(plot: Picture) -> str:
    title = html.escape(printable(plot.title))
    return f"<figure>\n<figcaption>{title}</figcaption>\n{plot.svg}\n</figure>\n"


def _gaps(table: Table) -> str:
    if not table.rows:
        return "<p>None: every recording was scored by all metrics, at every step.</p>\n"
    return _table(Table("", table.columns, table.rows))


def _origins(provenance: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    yield from provenance.get("inputs") or ([provenance] if provenance else [])


def _parameters(provenance: Mapping[str, Any]) -> Iterator[Table]:
    """One table of the parameters of each metric, one column for each way it was scored."""
    ways: dict[str, list[Mapping[str, Any]]] = {}
    for origin in _origins(provenance):
        for metric, parameters in origin.get("metrics", {}).items():
            known = ways.setdefault(metric, [])
            if parameters not in known:
                known.append(parameters)
    for metric, known in ways.items():
        names = list(dict.fromkeys(name for parameters in known for name in parameters))
        rows = tuple(
            (name, *(json.dumps(parameters.get(name)) for parameters in known)) for name in names
        )
        values = (
            ("value",) if len(known) == 1 else tuple(f"value {i + 1}" for i in range(len(known)))
        )
        yield as_shown(Table(metric, ("parameter", *values), rows))


def _provenance(provenance: Mapping[str, Any]) -> str:
    if not provenance:
        return ""
    text = html.escape(json.dumps(provenance, sort_keys=True, indent=1, allow_nan=False))
    versions = {json.dumps(o.get("versions", {}), sort_keys=True) for o in _origins(provenance)}
    said = "".join(
        f"<p>{html.escape(', '.join(f'{k} {v}' for k, v in json.loads(known).items()))}</p>\n"
        for known in sorted(versions)
        if known != "{}"
    )
    return f"{said}<details>\n<summary>All of it</summary>\n<pre>{text}</pre>\n</details>\n"
