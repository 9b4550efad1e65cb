"""Numbers without bounds are refused in a line, by whatever they would have broken."""

from __future__ import annotations

import dataclasses
import signal
from collections import Counter

import pytest

from echoset.cli.main import main
from echoset.models import registry

FEW = {"uwb-olos": "steps=5", "uwb-los": "steps=5", "jsc-6bs": "scans=2", "many": "steps=5"}
FEW |= {
    "crowd": "steps=5",
    "rendezvous": "steps=5",
    "crossing": "steps=5",
    "meeting": "steps=5",
    "surveillance": "steps=3",
}
SCENES = {"eopda": "uwb-los", "phd": "crossing", "mbm": "crossing", "ap-pda": "uwb-los"}
SCENES |= {"position": "uwb-los", "range-ls": "uwb-los", "pmb": "crossing", "tbd": "jsc-6bs"}
VALUES = (
    *("0", "-1", "1", "2", "0.5", "3.7", "-0.0", "1e-300", "1e-5", "1e9", "1e18", "1e30", "1e200"),
    *("1e308", "-1e308", "9223372036854775808", "1" * 400, ".inf", "-.inf", ".nan", "", "x"),
    *("[]", "[0]", "[1, 2]", "[1e308, 1e308, 1e308, 1e308]", "[[1, 2], [3, 4]]", "{}", "{a: 1}"),
    *("true", "null"),
)


class Slow(BaseException):
    """It would take long, which is no fault."""


def refused(result):
    assert result.code in (2, 4, 7, 75) and result.err.count("\n") == 1, result
    assert "internal error" not in result.err


@pytest.mark.parametrize(
    ("scenario", "setting"),
    [
        ("uwb-los", "steps=1e30"),
        ("uwb-los", "steps=9223372036854775808"),
        ("uwb-los", "mean_clutter=1e30"),
        ("uwb-los", "snr_db=1e9"),
        ("uwb-los", f"amplitude_threshold={'1' * 400}"),
        ("crossing", "dt=1e200"),
        ("meeting", "last=[1e308]"),
        ("surveillance", "filter=0"),
        ("surveillance", "filter=[1, 2]"),
    ],
)
def test_scenarios(run, tmp_path, scenario, setting):
    words = [w for s in (FEW[scenario], setting) for w in ("--set", s)]
    refused(run("simulate", scenario, *words, "-o", tmp_path / "x.h5"))
    assert not (tmp_path / "x.h5").exists()


@pytest.mark.parametrize(
    ("name", "setting"),
    [
        ("phd", "std_position=1e200"),
        ("phd", "std_acceleration=1e200"),
        ("phd", "clutter_cell=1e200"),
        ("phd", "max_components=1e308"),
    ],
)
def test_estimators(run, tmp_path, name, setting):
    rec = tmp_path / "rec.h5"
    assert run("simulate", "crossing", "--set", "steps=5", "-o", rec).code == 0
    refused(run("estimate", "-e", name, rec, "--set", setting, "-o", tmp_path / "x.h5"))


EVERY = [(g, n) for g in ("scenarios", "estimators") for n in registry.names(f"echoset.{g}")]


@pytest.mark.verification
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(("group", "name"), EVERY)
def test_every_parameter(capfd, tmp_path, group, name):
    """Each parameter of each scenario and estimator by itself: no internal error."""

    late: list[int] = []

    def stop(*_):
        late.append(1)
        raise Slow

    def call(*words: object) -> object:
        late.clear()
        signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, 3)
        try:
            code = main([*map(str, words), "--overwrite", "--memory", "3G", "-q"])
        except Slow:
            code = None
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
        return None if late else code

    out, faults, codes = tmp_path / "x.h5", [], Counter[object]()
    if group == "scenarios":
        words: list[object] = ["simulate", name]
        few = [FEW[name]] if name in FEW else []
    else:
        scene = next((s for key, s in SCENES.items() if key in name), "radar-extended")
        steps = ["--set", FEW[scene]] if scene in FEW else []
        made = main(["simulate", scene, *steps, "-o", str(tmp_path / "rec.h5")])
        assert made == 0
        capfd.readouterr()
        words = ["estimate", "-e", name, tmp_path / "rec.h5"]
        few = ["particles=100"] if "pda" in name else []
    fields = dataclasses.fields(registry.load(f"echoset.{group}", name).Params)
    for key, value in ((f.name, v) for f in fields for v in VALUES):
        settings = [*(s for s in few if s.split("=")[0] != key), f"{key}={value}"]
        code = call(*words, *(w for s in settings for w in ("--set", s)), "-o", out)
        error = capfd.readouterr().err
        codes[code] += 1
        if code not in (None, 0, 2, 4, 7, 75) or (
            code is not None and error.count("\n") != (code != 0)
        ):
            faults.append((key, value[:20], code, error[-300:]))
    assert not faults
    assert codes[0] + codes[None] > len(fields) and codes[2] > len(fields)


GROUPS = ("scenarios", "estimators", "metrics", "policies", "importers")
ALL = [(g, n) for g in GROUPS for n in registry.names(f"echoset.{g}")]


@pytest.mark.parametrize(("group", "name"), ALL)
def test_what_stands_in_for_an_inherited_parameter_keeps_its_range(group, name):
    params = getattr(registry.load(f"echoset.{group}", name), "Params", None)
    own = dataclasses.fields(params) if params else ()
    for field in own:
        for base in filter(dataclasses.is_dataclass, params.__mro__[1:]):
            inherited = {f.name: f.metadata.get("within") for f in dataclasses.fields(base)}
            assert field.metadata.get("within") or not inherited.get(field.name), field.name
