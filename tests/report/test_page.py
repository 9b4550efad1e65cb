"""The page of a report as a browser shows it: on a phone, without a network, nothing cut off."""

from __future__ import annotations

import html
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from echoset.cli.main import main

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or ""
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--hide-scrollbars", "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip
PHONE, DESK = (390, 844), (1280, 900)

MEASURE = """
<script>
addEventListener("load", () => {
  const box = e => { const r = e.getBoundingClientRect();
    return [r.left, r.top, r.right, r.bottom].map(Math.round); };
  const all = s => [...document.querySelectorAll(s)];
  const seen = all("svg text").map(e => ({
    text: e.textContent, box: box(e), inside: box(e.closest("svg")),
    size: parseFloat(getComputedStyle(e).fontSize) *
      Math.hypot(e.getScreenCTM().a, e.getScreenCTM().b) }));
  const found = {
    width: innerWidth, content: document.documentElement.scrollWidth,
    height: document.documentElement.scrollHeight,
    requests: performance.getEntriesByType("resource").map(e => e.name),
    plots: all("figure svg").map(box), texts: seen,
    frames: all(".scroll").map(e => [e.clientWidth, e.scrollWidth, e.clientHeight]),
    font: parseFloat(getComputedStyle(document.querySelector("td")).fontSize),
    titles: all("h2").map(e => e.textContent), cells: all("td").length,
    ids: all("[id]").map(e => e.id),
  };
  const out = document.createElement("pre");
  out.id = "measured"; out.textContent = JSON.stringify(found);
  document.body.append(out);
});
</script>
"""


@pytest.fixture(scope="module")
def page(files: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """A report of UWB and point targets: one was not scored by a metric, one has no truth."""
    folder = tmp_path_factory.mktemp("page")
    lines = (files / "uwb.csv").read_text().splitlines(keepends=True)
    kept = [line for line in lines if "0001,eopda-geo,cdf" not in line]
    at = next(i for i, line in enumerate(kept) if "0000,eopda-geo,rmse-left-out" in line)
    cells = kept[at].split(",")
    cells[5] = "3"
    kept[at] = ",".join(cells)
    (folder / "uwb.csv").write_text("".join(kept))
    words = [folder / "uwb.csv", files / "points.csv", "-o", folder / "report.html"]
    assert main(["report", *map(str, words)]) == 0
    return (folder / "report.html").read_text()


def shown(page: str, size: tuple[int, int], folder: Path) -> dict:
    """What a browser window of ``size`` measures of ``page``."""
    assert BROWSER, "this test needs Chromium: apt-get install chromium"
    target = folder / "page.html"
    # In a frame of that width, since a window has a least width of its own.
    inner = html.escape(page.replace("</body>", f"{MEASURE}</body>"))
    frame = (
        f'<body style="margin:0"><iframe id="f" style="border:0;width:{size[0]}px;'
        f'height:{size[1]}px" srcdoc="{inner}"></iframe><script>addEventListener("load",()=>'
        '{const d=document.getElementById("f").contentDocument;document.body.append('
        'Object.assign(document.createElement("pre"),{textContent:d.getElementById("measured")'
        ".textContent}))})</script>"
    )
    target.write_text(frame)
    words = [BROWSER, *FLAGS, f"--user-data-dir={folder / 'profile'}", "--dump-dom"]
    result = subprocess.run(
        [*words, f"--window-size={size[0] + 200},{size[1] + 200}", target.as_uri()],
        capture_output=True, timeout=60, check=True, env={**os.environ, "HOME": str(folder)},
    )  # fmt: skip
    (measured,) = re.findall(r"<pre>(\{.*?\})</pre>", result.stdout.decode(), re.DOTALL)
    return json.loads(html.unescape(measured))


@pytest.mark.browser
@pytest.mark.parametrize("size", [PHONE, DESK])
def test_nothing_is_cut_off_and_all_can_be_read(
    page: str, size: tuple[int, int], tmp_path: Path
) -> None:
    found = shown(page, size, tmp_path)
    assert found["width"] == size[0]
    assert found["content"] <= size[0], "the page itself must not scroll sideways"
    assert found["requests"] == []
    assert found["titles"] == [
        "Summary", "Plots", "Tables", "Over time", "Failures and gaps", "Parameters", "Provenance",
    ]  # fmt: skip
    assert found["font"] >= 14 and found["cells"] > 100
    assert len(found["ids"]) == len(set(found["ids"]))
    for left, top, right, bottom in found["plots"]:
        assert left >= 0 and right <= size[0] and right - left >= 300 and bottom - top >= 150
    assert len(found["plots"]) >= 5 and len(found["texts"]) > 100
    for text in found["texts"]:
        assert text["size"] >= 9, text
        (l, t, r, b), (x0, y0, x1, y1) = text["box"], text["inside"]
        assert l >= x0 - 2 and r <= x1 + 2 and t >= y0 - 2 and b <= y1 + 2, text
    assert any(inner > outer for outer, inner, _ in found["frames"]) == (size == PHONE)
    assert all(height <= 400 for *_, height in found["frames"][-1:])


@pytest.mark.browser
def test_letters_do_not_cover_each_other(page: str, tmp_path: Path) -> None:
    texts = shown(page, PHONE, tmp_path)["texts"]
    boxes = np.array([t["box"] for t in texts])
    for i, (l, t, r, b) in enumerate(boxes):
        x = np.minimum(boxes[:i, 2], r) - np.maximum(boxes[:i, 0], l)
        y = np.minimum(boxes[:i, 3], b) - np.maximum(boxes[:i, 1], t)
        covered = np.flatnonzero((x > 2) & (y > 4))
        assert not len(covered), (texts[i]["text"], texts[covered[0]]["text"])


@pytest.mark.browser
def test_the_screen_shows_the_plots(page: str, tmp_path: Path) -> None:
    assert BROWSER, "this test needs Chromium: apt-get install chromium"
    from PIL import Image

    (tmp_path / "page.html").write_text(page)
    words = [BROWSER, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", "--window-size=1280,6000"]
    words += [f"--screenshot={tmp_path / 'shot.png'}", (tmp_path / "page.html").as_uri()]
    subprocess.run(words, capture_output=True, timeout=60, check=True)
    pixels = np.asarray(Image.open(tmp_path / "shot.png").convert("RGB")).reshape(-1, 3)
    for colour in ((0xD5, 0x5E, 0x00), (0x00, 0x72, 0xB2)):
        near = (np.abs(pixels.astype(int) - colour) < 12).all(1).sum()
        assert near > 200, f"the colour {colour} of a line is not on the screen"


def test_the_page_needs_nothing_from_outside(page: str) -> None:
    assert "<script" not in page and "<link" not in page and "@import" not in page
    for value in re.findall(r"(?:src|href)=\"([^\"]*)\"", page):
        assert value.startswith(("#", "data:")), value
    for value in re.findall(r"url\(([^)]*)\)", page):
        assert value.startswith("#"), value
    assert '<meta name="viewport" content="width=device-width, initial-scale=1">' in page


def test_references_within_plots_are_met(page: str) -> None:
    ids = re.findall(r" id=\"([^\"]*)\"", page)
    used = re.findall(r"(?:href=\"|url\()#([^\")]*)", page)
    assert len(ids) == len(set(ids)) and set(used) <= set(ids)


def test_gaps_parameters_and_provenance_are_told(page: str) -> None:
    assert "not scored: uwb-olos-s1-0001" in page
    assert "3 steps without truth" in page
    assert '<td class="t">cutoff</td><td class="t">10.0</td>' in page
    assert "&quot;versions&quot;" in page


def test_without_matplotlib_a_line_says_how_to_get_plots(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    target = tmp_path / "report.html"
    assert main(["report", str(files / "points.csv"), "-o", str(target)]) == 0
    assert "pip install 'echoset[plot]'" in target.read_text()
    assert "<svg" not in target.read_text()
