"""The examples of plugins: installed as a stranger would, and used by the commands."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import echoset
from echoset import formats
from echoset.cli.main import main
from echoset.formats import scores as tables
from echoset.models import registry
from echoset.models.errors import InputError
from echoset.models.records import Estimates, Meta, Recording, Sensor, Stream

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples" / "plugins"
NAMES = ("beacons", "bias", "lateration", "npz", "roundabout")
Run = Callable[..., str]


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which all examples were installed, from copies, since a build leaves traces."""
    folder = tmp_path_factory.mktemp("plugins")
    copies = [shutil.copytree(EXAMPLES / name, folder / "source" / name) for name in NAMES]
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    options = ["--no-deps", "--no-build-isolation", "--target", folder / "site"]
    subprocess.run([*pip, *options, *copies], check=True)
    return folder / "site"


@pytest.fixture(autouse=True)
def installed(site: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.syspath_prepend(str(site))
    registry._points.cache_clear()
    yield
    registry._points.cache_clear()


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Run a command in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def call(line: str, code: int = 0) -> str:
        found = main(line.split())
        out, err = capfd.readouterr()
        assert found == code, err
        return err if code else out

    return call


def aggregate(path: str, metric: str, part: str) -> float:
    """The value of a metric over the whole recording."""
    s = tables.read(Path(path))
    rows = zip(s.metric, s.part, s.time, s.value, strict=True)
    (value,) = (v for m, p, t, v in rows if m == metric and p == part and np.isnan(t))
    return float(value)


def test_every_example_is_tried(run: Run) -> None:
    assert sorted(p.name for p in EXAMPLES.iterdir() if p.is_dir()) == sorted(NAMES)
    listed = [line.split()[0] for line in run("list").splitlines()]
    assert set(NAMES) <= set(listed)
    assert "window: 1.0" in run("describe lateration")


def test_scenario_format_and_metric_of_strangers_work_together(run: Run) -> None:
    run("simulate roundabout --set steps=50 --seed 3 -o r.npz")
    assert "radar" in run("info r.npz")
    run("estimate -e phd r.npz -o e.npz")
    run("score e.npz --truth r.npz -m gospa -o s.csv")
    assert aggregate("s.csv", "gospa", "") < 5.0
    run(f"convert --from csv {ROOT}/examples/ranges/ranges.csv "
        f"--mapping {ROOT}/examples/ranges/mapping.yaml -o ranges.npz")  # fmt: skip
    run("estimate -e lateration --preset walking ranges.npz -o l.h5")
    run("score l.h5 --truth ranges.npz -m rmse,bias -o l.csv")
    assert aggregate("l.csv", "rmse", "device") < 0.3
    assert abs(aggregate("l.csv", "bias", "device-x")) < aggregate("l.csv", "rmse", "device")


def test_an_importer_of_strangers(run: Run, tmp_path: Path) -> None:
    beacons = {"B1": [0, 0], "B2": [5, 0], "B3": [0, 4]}
    place = np.array([2.0, 1.0])
    cm = {name: round(100 * float(np.hypot(*(place - p)))) for name, p in beacons.items()}
    lines = [{"beacons": beacons}, *({"ms": 100 * k, "ranges": cm} for k in range(5))]
    lines[3] = {"ms": 200, "ranges": {"B2": cm["B2"]}}
    Path("a.jsonl").write_text("\n".join(map(json.dumps, lines)) + "\n")
    assert "try echoset convert --from beacons a.jsonl" in run("info a.jsonl", code=4)
    run("convert --from beacons a.jsonl -o a.h5")
    run("validate --strict a.h5")
    stream = echoset.read("a.h5").streams["uwb"]
    assert len(stream) == 13 and stream.time_ns[-1] == 400_000_000
    run("estimate -e lateration a.h5 -o e.h5")
    found = echoset.read("e.h5").objects.columns("device_x", "device_y")
    np.testing.assert_allclose(found[-1], place, atol=0.02)
    Path("a.jsonl").write_text(json.dumps(lines[0]) + '\n{"ms": 1, "ranges": {"B9": 3}}\n')
    assert "a.jsonl: line 2: 'B9' is no beacon" in run("convert --from beacons a.jsonl -o b.h5", 4)


def test_vehicles_stay_on_their_circle(run: Run) -> None:
    run("simulate roundabout --set steps=20 --set speed_std=0 --set radius=15 -o r.h5")
    o = echoset.read("r.h5").truth.objects
    np.testing.assert_allclose(np.hypot(*o.columns("x", "y").T), 15.0)
    np.testing.assert_allclose(np.hypot(*o.columns("vx", "vy").T), 8.0)
    x = o.columns("x", "y").reshape(20, 4, 2)
    chord = np.linalg.norm(x[1:] - x[:-1], axis=2)
    np.testing.assert_allclose(chord, 2 * 15 * np.sin(8.0 * 0.2 / 15 / 2))


def network(anchors: np.ndarray, places: np.ndarray) -> Recording:
    """Exact ranges from anchors (J, 2) to a device at ``places`` (n, 2), one a second."""
    n, count = len(places), len(anchors)
    sensors = {f"A{j}": Sensor.static("anchor", a) for j, a in enumerate(anchors)}
    sensors["D"] = Sensor.device()
    stream = Stream(
        "uwb",
        tuple(sensors),
        {},
        np.repeat(np.arange(n) * 10**9, count),
        np.arange(n * count + 1),
        {
            "mode": np.zeros(n * count, "u1"),
            "tx": np.full(n * count, count, "i4"),
            "rx": np.tile(np.arange(count, dtype="i4"), n),
        },
        {"distance": np.linalg.norm(places[:, None] - anchors, axis=2).ravel()},
    )
    return Recording(Meta("exact"), sensors, {"uwb": stream})


def test_exact_ranges_give_the_exact_place() -> None:
    anchors = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 4.0]])
    places = np.array([[1.0, 1.0], [2.0, 3.0], [4.0, 0.5]])
    found = echoset.estimate(network(anchors, places), "lateration", window=0.5)
    np.testing.assert_allclose(found.objects.columns("device_x", "device_y"), places, atol=1e-5)
    line = places[:1] + np.arange(3)[:, None] * (0.5, 0.2)
    found = echoset.estimate(network(anchors, line), "lateration", window=5.0, speed_std=1e6)
    np.testing.assert_allclose(found.objects.state[-1], [*line[-1], 0.5, 0.2], atol=1e-5)
    with pytest.raises(InputError, match="2 anchors"):
        echoset.estimate(network(anchors[:2], places), "lateration")


@pytest.mark.parametrize("kind", ["recording", "estimates"])
def test_archives_hold_the_same(
    recording: Recording, estimates: Estimates, run: Run, kind: str
) -> None:
    record: Recording | Estimates = recording if kind == "recording" else estimates
    formats.write(record, Path("a.h5"), "h5")
    run("convert a.h5 -o b.npz")
    run("convert b.npz -o c.h5")
    assert Path("a.h5").read_bytes() == Path("c.h5").read_bytes()
    data = bytearray(Path("b.npz").read_bytes())
    data[len(data) // 2] ^= 1
    Path("d.npz").write_bytes(data)
    message = run("validate d.npz", 4)
    assert "d.npz" in message and len(message.splitlines()) == 1


def test_a_shift_is_the_bias(recording: Recording) -> None:
    truth = recording.truth.objects
    device = ("device_x", "device_y")
    moved = replace(
        truth, state=truth.columns(*device) + np.array([0.25, -0.5]), state_names=device,
        state_units=("m", "m"), covariance=None, extent_kind="", semi_axes=None, rotation=None,
    )  # fmt: skip
    meta = Meta(recording.meta.name, provenance={"estimator": "shift"})
    found = echoset.score(Estimates(meta, moved, {}), recording, "bias")
    whole = {p: v for p, t, v in zip(found.part, found.time, found.value, strict=True) if t != t}
    assert whole == pytest.approx({"device-x": 0.25, "device-y": -0.5}, abs=1e-12)
