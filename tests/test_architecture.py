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


SYSTEMS = ("eopda", "points", "maps", "gsncp")


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


def modules(path: Path) -> Iterator[tuple[str, ...]]:
    """Modules of echoset that the file imports, also inside functions, as parts of their names."""
    here = path.relative_to(ROOT).parts[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = here[: len(here) - node.level + 1]
            base += tuple(node.module.split(".")) if node.module else ()
            for alias in node.names:
                whole = (*base, alias.name)
                yield whole if place(whole) else base


def place(name: tuple[str, ...]) -> Path | None:
    """The file of a module, or None if it is none."""
    found = ROOT.joinpath(*name)
    files = (found / "__init__.py", found.with_suffix(".py")) if name else (ROOT / "__init__.py",)
    return next((file for file in files if file.is_file()), None)


def test_systems_of_estimators_do_not_know_each_other():
    for system in SYSTEMS:
        for path in sources(f"estimators/{system}"):
            for name in modules(path):
                where = f"{path.relative_to(ROOT)} imports {'.'.join(name)}"
                if name[0] == "estimators":
                    assert name[1] in (system, "kernels", "presets", "protocol", "streams"), where


def test_imports_go_in_no_circle():
    """What a module imports as it is loaded; a package is loaded before what is in it."""
    graph = {}
    for package in ALLOWED:
        for path in sources(package):
            graph[path] = {f for name in modules(path) if (f := place(name)) and f != path}
    done: set[Path] = set()

    def visit(path: Path, above: tuple[Path, ...]) -> None:
        circle = [str(p.relative_to(ROOT)) for p in (*above, path)]
        assert path not in above, f"imports in a circle: {' -> '.join(circle)}"
        if path not in done:
            for below in sorted(graph.get(path, ())):
                visit(below, (*above, path))
            done.add(path)

    for path in sorted(graph):
        visit(path, ())


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
