"""The tree is the architecture: packages listed, imports one way, files opened in one place."""

from __future__ import annotations

import ast
import configparser
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PARTS = ("simulate", "estimators", "metrics", "report", "formats")
ALLOWED = {
    "models": set(),
    **{part: {"models"} for part in PARTS},
    "control": {"models", "simulate", "estimators"},
    "campaign": {"models", "control", *PARTS},
    "cli": {"models", "control", "campaign", *PARTS},
}


def sources(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """Top packages of echoset, or foreign modules, that the file imports, with their line."""
    depth = len(path.relative_to(ROOT).parts) - 1
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name.split(".")[0], node.lineno
        elif isinstance(node, ast.ImportFrom):
            if node.level == 0:
                yield (node.module or "").split(".")[0], node.lineno
            elif node.level == depth + 1:
                if node.module is None:
                    for alias in node.names:
                        yield f".{alias.name}", node.lineno
                else:
                    yield f".{node.module.split('.')[0]}", node.lineno


@pytest.mark.parametrize("package", sorted(ALLOWED))
def test_imports_point_one_way(package):
    for path in sources(package):
        for name, line in imports(path):
            where = f"{path.relative_to(ROOT)}:{line}"
            assert name not in ALLOWED, f"{where} imports {name} by an absolute name"
            assert name != "echoset", f"{where}: imports inside the package are relative"
            if name.startswith(".") and name[1:] in ALLOWED:
                assert name[1:] == package or name[1:] in ALLOWED[package], f"{where}: {name}"


def test_what_commands_share_knows_no_command_line():
    for path in sources("campaign"):
        assert "click" not in {name for name, _ in imports(path)}, path.relative_to(ROOT)


def test_commands_are_thin():
    lines = {path.name: path.read_text().count("\n") for path in sources("cli")}
    assert sum(lines.values()) < 1300, lines
    for path in sources("cli"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                length = node.end_lineno - node.lineno + 1
                assert length < 60, f"{path.relative_to(ROOT)}:{node.lineno} has {length} lines"


def test_no_folder_has_more_modules_than_one_can_look_over():
    for package in (*ALLOWED, "benchmarks", "tests"):
        folders = {path.parent for path in sources(package)}
        for folder in folders:
            modules = {path.name for path in folder.glob("*.py")} - {"__init__.py"}
            assert len(modules) <= 20, f"{folder.relative_to(ROOT)} has {len(modules)} modules"


def test_every_package_is_listed():
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    listed = set(config["options"]["packages"].split())
    found = {
        ".".join(("echoset", *path.parent.relative_to(ROOT).parts))
        for package in ALLOWED
        for path in (ROOT / package).rglob("__init__.py")
    }
    assert listed == {"echoset", *found}


def test_only_formats_opens_files_and_only_cli_prints():
    for package in ALLOWED:
        for path in sources(package):
            for node in ast.walk(ast.parse(path.read_text())):
                if not isinstance(node, ast.Call):
                    continue
                name = getattr(node.func, "id", getattr(node.func, "attr", ""))
                where = f"{path.relative_to(ROOT)}:{node.lineno}"
                if path == ROOT / "estimators" / "presets.py":
                    continue  # reads package data
                if name in ("open", "read_text", "read_bytes", "write_text", "write_bytes"):
                    assert package in ("formats", "campaign", "cli", "simulate"), (
                        f"{where} opens a file"
                    )
                assert name != "print" or package in ("campaign", "cli"), f"{where} prints"


def test_nothing_is_random_or_timed_by_stealth():
    for package in (*PARTS, "models", "control"):
        for path in sources(package):
            text = path.read_text()
            for word in ("np.random.seed", "np.random.normal", "time.time(", "datetime.now"):
                assert word not in text, f"{path.relative_to(ROOT)} uses {word}"
