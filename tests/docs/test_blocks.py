"""Every block of code on every page, run in the order of the page in a folder of its own.

Tags say what becomes of a block. ``console``: commands after ``$``, continued after ``>``, run and
must end well; what stands below one is its output as on a terminal, in which ``...`` is anything
and numbers with a point may differ a little, as they do between processors. ``bash``: commands as
they are typed, which run and must end well. ``python``: run.
``yaml`` and ``toml``: read. ``sh``: not run; the first line is a comment that says why, and
commands and targets named in it exist. ``text``: no code.
"""

from __future__ import annotations

import glob
import logging
import os
import re
import shlex
import subprocess
import sys
import tomllib
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import click
import pytest
import yaml

from echoset.cli.main import commands, main

ROOT = Path(__file__).parents[2]
STAMP = re.compile(r"^\d{4}-\d\d-\d\dT[\d:.]+Z ", re.M)
"""The time with which lines on stderr may begin where it is no terminal."""
NUMBER = re.compile(r"-?\d+\.\d+(?:e[+-]?\d+)?")
PLAIN = re.compile(
    r"echoset (?P<words>[^|<>;&$`]*?)"
    r"( > (?P<file>[\w.]+)|(?P<fails> \|\| echo \"exit code \$\?\"))?"
)
"""A command that needs no shell: alone, into a file, or followed by its exit code."""
Run = Callable[[str], str]


def test_every_block_says_what_it_is(page: Path, page_blocks) -> None:
    for block in page_blocks:
        where = f"{page.name}:{block.line}"
        known = ("console", "bash", "python", "yaml", "toml", "sh", "text")
        assert block.tag in known or block.tag.startswith("{"), f"{where}: tag {block.tag!r}"
        if block.tag == "text":
            assert not re.search(r"^\$? ?(echoset|make) ", block.text, re.M), f"{where}: not text"
        if block.tag == "sh":
            assert block.text.startswith("# "), f"{where}: does not say why it is not run"


def test_blocks_that_are_not_run_name_what_exists(page: Path, page_blocks) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    for block in page_blocks:
        if block.tag != "sh":
            continue
        for line in block.text.replace("\\\n", " ").splitlines():
            for part in re.split(r"\||&&|;|\bdo\b", line.partition(" #")[0]):
                words = shlex.split(part, comments=True)
                if words[:1] == ["echoset"]:
                    parse(words[1:], f"{page.name}:{block.line}: {part}")
                elif words[:1] == ["make"] and "-C" not in words:
                    asked = {w for w in words[1:] if w[0] not in "-0123456789" and "=" not in w}
                    assert asked <= targets, f"{page.name}:{block.line}: {part}"


def parse(words: list[str], where: str) -> None:
    """Parse a command without running it; a list of inputs, ``@FILE``, need not be there."""
    words = [word.removeprefix("@") for word in words]
    try:
        with click.Context(commands, info_name="echoset") as context:
            name, command, rest = commands.resolve_command(context, words)
            assert command is not None
            command.make_context(name, rest, parent=context)
    except click.exceptions.Exit:
        pass
    except click.ClickException as error:
        pytest.fail(f"{where}: {error.format_message()}")


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Iterator[Run]:
    """Run a command line in the page's folder: a plain one in this process, else in a shell."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    scripts = Path(sys.executable).parent
    monkeypatch.setenv("PATH", f"{scripts}{os.pathsep}{os.environ['PATH']}")
    show = warnings.showwarning

    def call(line: str) -> str:
        plain = PLAIN.fullmatch(line.replace("\\\n", " "))
        if plain is None:
            done = subprocess.run(
                ["bash", "-euo", "pipefail", "-c", line],
                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, f"$ {line}\n{done.stdout}"
            return STAMP.sub("", done.stdout)
        words = shlex.split(plain["words"])
        code = main([w for word in words for w in (sorted(glob.glob(word)) or [word])])
        out, err = capfd.readouterr()
        if plain["fails"]:
            return f"{STAMP.sub('', err)}exit code {code}\n"
        assert code == 0, f"$ {line}\n{err}"
        if plain["file"]:
            Path(plain["file"]).write_text(out)
            return ""
        return out

    yield call
    logging.captureWarnings(False)
    warnings.showwarning = show


def test_blocks_run(page: Path, page_blocks, run: Run) -> None:
    names: dict[str, object] = {"__name__": "__main__"}
    for block in page_blocks:
        where = f"{page.name}:{block.line}"
        if block.tag == "console":
            for line, expected in console(block.text):
                found = run(line)
                assert not expected or agrees(expected, found), f"{where}: $ {line}\n{found}"
        elif block.tag == "bash":
            for line in typed(block.text):
                run(line)
        elif block.tag == "python":
            exec(compile(block.text, where, "exec"), names)
        elif block.tag == "yaml":
            assert yaml.safe_load(block.text) is not None, where
        elif block.tag == "toml":
            assert tomllib.loads(block.text), where


def console(text: str) -> Iterator[tuple[str, str]]:
    """Commands and the output below each."""
    command: list[str] = []
    output: list[str] = []
    for line in text.splitlines():
        if line.startswith("$ "):
            if command:
                yield "\n".join(command), "\n".join(output)
            command, output = [line[2:]], []
        elif line.startswith("> ") and not output:
            command.append(line[2:])
        else:
            output.append(line)
    assert command, "a console block without a command"
    yield "\n".join(command), "\n".join(output)


def typed(text: str) -> Iterator[str]:
    """Commands as they are typed, with what follows ``<<'END'`` or a last ``\\`` or ``|``."""
    command: list[str] = []
    for line in text.splitlines():
        command.append(line)
        begun = re.search(r"<<'(\w+)'", command[0])
        if line == begun[1] if begun else not line.endswith(("\\", "|")):
            yield "\n".join(command)
            command = []
    assert not command, "a command without an end"


def agrees(expected: str, found: str) -> bool:
    """Whether ``found`` is the output that a page shows."""
    pattern = ""
    for line in expected.strip().splitlines():
        if line.strip() == "...":
            pattern += r"(?:.*\n)*?"
            continue
        parts = (re.escape(" ".join(p.split(" "))) for p in NUMBER.sub("\0", line).split("..."))
        line_pattern = ".*?".join(parts).replace(re.escape("\0"), rf"({NUMBER.pattern})")
        pattern += re.sub(r"(?:\\ )+", r" +", line_pattern) + r" *\n"
    match = re.fullmatch(pattern, found.strip("\n") + "\n")
    if match is None:
        return False
    shown = (float(x) for line in expected.splitlines() for x in NUMBER.findall(line))
    return all(
        abs(a - float(b)) <= 0.02 + 0.25 * abs(a)
        for a, b in zip(shown, match.groups(), strict=True)
    )


@pytest.mark.parametrize(
    ("expected", "found", "same"),
    [
        ("a 0.115 m", "a 0.12 m", True),
        ("a 0.115 m", "a 0.3 m", False),
        ("a\n...\nz", "a\nb\nc\nz\n", True),
        ("a\n...", "b\nc\n", False),
        ("n 3, ... end", "n 4, x end", False),
        ("n 3, ... end", "n 3, x end", True),
        ("one", "one\ntwo", False),
    ],
)
def test_output_is_compared(expected: str, found: str, same: bool) -> None:
    assert agrees(expected, found) is same


def test_commands_are_told_from_output() -> None:
    text = "$ cat > a <<'E'\n> b: 1\n> E\n$ echoset list\nestimators:\n"
    assert list(console(text)) == [("cat > a <<'E'\nb: 1\nE", ""), ("echoset list", "estimators:")]


def test_commands_as_they_are_typed() -> None:
    text = "cat > a <<'E'\nb: 1\nE\necho a \\\n  b |\n  cat\nls\n"
    assert list(typed(text)) == ["cat > a <<'E'\nb: 1\nE", "echo a \\\n  b |\n  cat", "ls"]


def test_what_can_be_typed_is_without_prompts(page: Path, page_blocks) -> None:
    for block in page_blocks:
        assert not re.search(r"^> ", block.text, re.M), f"{page.name}:{block.line}"


def test_links_have_words_and_lead_somewhere(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    for words, target in re.findall(r"(?<!!)\[([^\]\n]*)\]\(([^)\s]+)\)", text):
        assert words, f"{page.name}: a link to {target} without words"
        if target.startswith(("http", "mailto:")):
            continue
        path, _, anchor = target.partition("#")
        other = page.parent / path if path else page
        assert other.exists() and "reference/" not in path, f"{page.name}: {target}"
        if anchor:
            heads = re.findall(r"^#+ (.+)$", other.read_text(), re.M)
            slugs = [re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in heads]
            assert anchor in slugs, f"{page.name}: {target}"


def test_what_does_not_exist_is_found() -> None:
    parse(["score", "a.h5", "-o", "-"], "here")
    for words in (["scroe", "a.h5"], ["score", "a.h5", "--pol"]):
        with pytest.raises(pytest.fail.Exception, match="here"):
            parse(words, "here")
