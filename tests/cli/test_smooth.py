"""``estimate --smooth``: how it is said, what the outputs are called, and equal bytes."""

from __future__ import annotations

import pytest

from echoset import formats


@pytest.fixture
def scene(run, tmp_path):
    path = tmp_path / "scene.h5"
    settings = ("--set", "steps=12", "--set", "clutter_rate=3")
    assert run("simulate", "crossing", *settings, "-o", path).code == 0
    return path


@pytest.mark.parametrize(
    ("before", "after", "smooth", "name"),
    [
        ((), (), "none", "scene.pmb.h5"),
        (("--smooth",), (), "whole", "scene.pmb-smooth.h5"),
        ((), ("--smooth",), "whole", "scene.pmb-smooth.h5"),
        (("--smooth", "5s"), (), "5s", "scene.pmb-smooth.h5"),
        (("--smooth=whole",), (), "whole", "scene.pmb-smooth.h5"),
        (("--set", "smooth=2.5s"), (), "2.5s", "scene.pmb-smooth.h5"),
        (("--smooth",), ("--set", "smooth=none"), "none", "scene.pmb.h5"),
    ],
)
def test_ways_to_ask(run, scene, tmp_path, before, after, smooth, name):
    result = run("estimate", "-e", "pmb", *before, scene, "-o", f"{tmp_path}/out/", *after)
    assert result.code == 0, result.err
    assert [p.name for p in (tmp_path / "out").iterdir()] == [name]
    made = formats.read(tmp_path / "out" / name)
    assert made.meta.provenance["parameters"]["smooth"] == smooth
    assert made.estimator == name.split(".")[1]


def test_both_stand_beside_each_other_in_scores(run, scene, tmp_path):
    for words in ((), ("--smooth",)):
        run("estimate", "-e", "pmb", *words, scene, "-o", f"{tmp_path}/out/")
    files = sorted((tmp_path / "out").iterdir())
    result = run("score", *files, "--truth", scene, "-m", "gospa", "-o", "-")
    assert result.code == 0, result.err
    assert {line.split(",")[1] for line in result.out.splitlines()[2:]} == {"pmb", "pmb-smooth"}


@pytest.mark.parametrize("words", [("--smooth",), ("--smooth", "3s")])
def test_bytes_are_equal_for_all_formats(run, scene, tmp_path, words):
    run("convert", scene, "-o", tmp_path / "scene.mcap")
    for source in ("scene.h5", "scene.mcap"):
        out = tmp_path / f"{source}.out.h5"
        assert run("estimate", "-e", "pmb", *words, tmp_path / source, "-o", out).code == 0
    one, other = ((tmp_path / f"scene.{f}.out.h5").read_bytes() for f in ("h5", "mcap"))
    assert one == other


def test_a_search_has_equal_bytes_in_any_format_and_process(run, scene, tmp_path):
    run("convert", scene, "-o", tmp_path / "scene.mcap")
    (tmp_path / "copy.h5").write_bytes(scene.read_bytes())
    words = ("-e", "mbm", "--smooth=search", "-o", f"{tmp_path}/out/")
    assert run("estimate", *words, scene, tmp_path / "copy.h5", "-j", 2).code == 0
    assert run("estimate", *words[:-1], f"{tmp_path}/m/", tmp_path / "scene.mcap").code == 0
    one, other = ((tmp_path / "out" / f"{n}.mbm-smooth.h5").read_bytes() for n in ("scene", "copy"))
    assert one == other == (tmp_path / "m" / "scene.mbm-smooth.h5").read_bytes()


@pytest.mark.parametrize("words", [("--smooth",), ("--smooth", "0.6s")])
@pytest.mark.parametrize("name", ["eopda-geo", "a-eopda-ideal", "ap-pda", "position"])
def test_filters_of_a_device(run, tmp_path, name, words):
    """Equal bytes from both formats and any number of workers; contents that a reader takes."""
    settings = ("--set", "steps=14", "--set", "blocked=[[5, 8, 1], [5, 8, 2], [5, 8, 3]]")
    assert run("simulate", "uwb-los", *settings, "-o", tmp_path / "one.h5").code == 0
    run("convert", tmp_path / "one.h5", "-o", tmp_path / "two.mcap")
    few = ("--set", "particles=150", "--set", "learn=[]")
    files = tmp_path / "one.h5", tmp_path / "two.mcap"
    made = []
    for jobs in ("1", "2"):
        out = f"{tmp_path}/{jobs}/"
        assert run("estimate", "-e", name, *words, *few, *files, "-o", out, "-j", jobs).code == 0
        made += [(tmp_path / jobs / f"{s}.{name}-smooth.h5").read_bytes() for s in ("one", "two")]
    assert len(set(made)) == 1
    found = formats.read(tmp_path / "1" / f"one.{name}-smooth.h5")
    assert found.estimator == f"{name}-smooth" and len(found.objects.time_ns) == 14
    assert run("validate", "--strict", tmp_path / "1" / f"one.{name}-smooth.h5").code == 0


def test_made_anew_only_if_asked_otherwise(run, scene, tmp_path):
    out = tmp_path / "out.h5"
    words = ("estimate", "-e", "pmb", scene, "-o", out, "--skip-existing")
    first = run(*words, "--smooth")
    assert first.code == 0
    made = out.stat().st_mtime_ns
    assert run(*words, "--smooth").code == 0 and out.stat().st_mtime_ns == made
    assert run(*words, "--smooth", "3s").code == 0 and out.stat().st_mtime_ns > made


def test_what_is_no_lag(run, scene, tmp_path):
    result = run("estimate", "-e", "pmb", "--set", "smooth=soon", scene, "-o", tmp_path / "x.h5")
    assert result.code == 2 and "smooth must be none, whole or a time such as 5s" in result.err
