"""The pages of the documentation and their blocks of code."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
MADE = ("_build", "reference", "results")
"""Folders of ``docs`` whose pages are made by commands."""


@dataclass(frozen=True)
class Block:
    """A block of code: its tag, its text, and the line of its page at which it stands."""

    tag: str
    text: str
    line: int


def pages() -> list[Path]:
    """All pages that were written by hand."""
    written = [p for p in DOCS.rglob("*.md") if p.relative_to(DOCS).parts[0] not in MADE]
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(written)]


def blocks(page: Path) -> list[Block]:
    """The blocks of a page in order; one that is only indented has an empty tag."""
    tokens = MarkdownIt().parse(page.read_text())
    return [
        Block(t.info.strip(), t.content, t.map[0] + 1)
        for t in tokens
        if t.type in ("fence", "code_block")
    ]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Tests that take a ``page`` run once for each."""
    if "page" in metafunc.fixturenames:
        metafunc.parametrize("page", pages(), ids=lambda p: str(p.relative_to(ROOT)))


@pytest.fixture
def page_blocks(page: Path) -> list[Block]:
    """The blocks of the page."""
    return blocks(page)


@pytest.fixture(scope="session")
def written() -> str:
    """The text of all pages that were written by hand."""
    return "\n".join(page.read_text() for page in pages())


@pytest.fixture(scope="session")
def reference() -> dict[str, str]:
    """The pages that are made from the commands and plugins, by name."""
    sys.path.insert(0, str(DOCS))
    try:
        import reference
    finally:
        sys.path.remove(str(DOCS))
    return reference.pages()
