"""What is built holds what it should, and runs where nothing else is installed."""

from __future__ import annotations

import configparser
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
import yaml

import echoset

ROOT = Path(__file__).parent.parent
IGNORED = (".git", ".venv", "build", "dist", "*.egg-info", "__pycache__", ".*_cache", "_build")
BUILD = "from setuptools import build_meta as b; print(b.build_{kind}({folder!r}))"
VERSIONS = ("3.11", "3.12", "3.13")


def build(kind: str, source: Path, folder: Path) -> Path:
    """Build ``wheel`` or ``sdist`` of the tree at ``source`` into ``folder``."""
    code = BUILD.format(kind=kind, folder=str(folder))
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=source, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.split()[-1]


@pytest.fixture(scope="session")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tree, since a build leaves traces."""
    ignore = shutil.ignore_patterns(*IGNORED)
    target = tmp_path_factory.mktemp("build") / "tree"
    return shutil.copytree(ROOT, target, symlinks=True, ignore=ignore)


@pytest.fixture(scope="session")
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("wheel", source, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def sdist(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("sdist", source, tmp_path_factory.mktemp("sdist"))


def listed(path: Path) -> set[str]:
    """The files of the package in a wheel."""
    names = zipfile.ZipFile(path).namelist()
    return {name for name in names if not name.split("/")[0].endswith(".dist-info")}


def test_the_wheel_holds_the_packages_and_nothing_else(wheel: Path) -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    expected = set()
    for package in config["options"]["packages"].split():
        folder = ROOT.joinpath(*package.split(".")[1:])
        files = [*folder.glob("*.py")]
        for pattern in config["options.package_data"].get(package, "").split():
            assert list(folder.glob(pattern)) or pattern.startswith("weights/"), pattern
            files += folder.glob(pattern)
        expected |= {"/".join(("echoset", *f.relative_to(ROOT).parts)) for f in files}
    assert listed(wheel) == expected
    assert "echoset/py.typed" in expected


def test_the_sdist_holds_what_a_packager_needs(sdist: Path) -> None:
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    needed = {"Makefile", "LICENSE", "CHANGELOG.md", "CITATION.cff", "docs/index.md", ".ci/run"}
    needed |= {"tests/test_packaging.py", "examples/ranges/mapping.yaml", "docs/conf.py"}
    needed |= {"examples/plugins/bias/pyproject.toml", "benchmarks/calibration.py"}
    assert needed <= names
    assert not [n for n in names if re.search(r"__pycache__|\.venv|_build|docs/reference/", n)]


def test_version_and_citation_agree() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["cff-version"] == "1.2.0" and citation["type"] == "software"
    for key in ("message", "title", "abstract", "license"):
        assert isinstance(citation[key], str) and citation[key]
    assert citation["authors"] and all(r["authors"] and r["title"] for r in citation["references"])
    assert citation["version"] == echoset.__version__
    newest = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.M)
    assert newest and newest[1] == echoset.__version__


def interpreter(version: str) -> Path | None:
    """An interpreter of ``version`` on the path or among those of pyenv."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    candidates = [*pyenv.glob(f"{version}.*/bin/python3")]
    if found := shutil.which(f"python{version}"):
        candidates.append(Path(found))
    for path in candidates:
        done = subprocess.run([path, "--version"], capture_output=True, text=True, check=False)
        if done.stdout.startswith(f"Python {version}."):
            return path
    return None


@pytest.mark.packaging
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_a_clean_environment_is_enough(
    kind: str, version: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    python = interpreter(version)
    if python is None:
        pytest.skip(f"there is no Python {version}")
    built: Path = request.getfixturevalue(kind)
    clean = {"PATH": os.defpath, "HOME": str(tmp_path), "LANG": "C.UTF-8"}
    clean |= {k: v for k, v in os.environ.items() if k.startswith(("PIP_", "SSL_", "XDG_"))}

    def call(*words: object) -> str:
        line = [str(word) for word in words]
        done = subprocess.run(
            line, cwd=tmp_path, env=clean, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, f"{line}: {done.stdout}{done.stderr}"
        return done.stdout

    call(python, "-m", "venv", "env")
    scripts = tmp_path / "env" / "bin"
    call(scripts / "python", "-m", "pip", "install", "--quiet", built)
    assert echoset.__version__ in call(scripts / "echoset", "--version")
    few = "--set particles=300"
    pipe = (
        f"{scripts}/echoset simulate uwb-los --set steps=10 -o - "
        f"| {scripts}/echoset estimate -e eopda-geo {few} - -o - "
        f"| {scripts}/echoset score - -m rmse -o scores.csv"
    )
    call("bash", "-euo", "pipefail", "-c", pipe)
    assert "rmse,device" in (tmp_path / "scores.csv").read_text()
    typed = (
        "from importlib.resources import files; print((files('echoset') / 'py.typed').is_file())"
    )
    assert call(scripts / "python", "-c", typed).strip() == "True"
