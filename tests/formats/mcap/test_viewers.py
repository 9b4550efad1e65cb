"""MCAP files as viewers see them: sound to a checker that is not ours, with objects to be seen."""

from __future__ import annotations

import subprocess
import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf.SceneEntityDeletion_pb2 import SceneEntityDeletion
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from echoset import formats
from echoset.models.records import Estimates, Objects, Recording

RGB = {"truth": (0, 115, 178), "estimates": (230, 158, 0)}


def topics(path: Path) -> dict[str, list[Any]]:
    """Messages by topic, those in protobuf decoded by the schemas that the file itself holds."""
    found = defaultdict(list)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for schema, channel, message in reader.iter_messages():
            known = schema is not None and schema.encoding == "protobuf"
            decode = DecoderFactory().decoder_for(channel.message_encoding, schema)
            found[channel.topic].append(decode(message.data) if known else message.data)
    return found


def points(cloud: Any) -> np.ndarray:
    kinds = {1: "u1", 7: "<f4", 8: "<f8", 6: "<i4"}
    layout = np.dtype(
        {
            "names": [f.name for f in cloud.fields],
            "formats": [kinds[f.type] for f in cloud.fields],
            "offsets": [f.offset for f in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    return np.frombuffer(cloud.data, layout)


@pytest.fixture(params=["recording", "estimates", "both"])
def path(
    request: pytest.FixtureRequest, recording: Recording, estimates: Estimates, tmp_path: Path
) -> Path:
    records = {
        "recording": recording,
        "estimates": estimates,
        "both": replace(estimates, recording=recording),
    }
    formats.write(records[request.param], tmp_path / "x.mcap", "mcap")
    return tmp_path / "x.mcap"


def test_the_doctor_finds_nothing(path: Path) -> None:
    doctor = Path(sys.executable).with_name("pymcap-cli")
    result = subprocess.run([doctor, "doctor", path], capture_output=True, text=True, check=False)
    said = " ".join((result.stdout + result.stderr).split())
    assert result.returncode == 0 and "passed MCAP doctor checks" in said, said


def test_objects_are_shapes_that_last_until_the_next_step(
    recording: Recording, tmp_path: Path
) -> None:
    path = tmp_path / "x.mcap"
    formats.write(recording, path, "mcap")
    scenes, truth = topics(path)["/truth/scene"], recording.truth.objects
    assert len(scenes) == len(truth.time_ns)
    for k, update in enumerate(scenes):
        assert [d.type for d in update.deletions] == [SceneEntityDeletion.ALL]
        (entity,) = update.entities
        assert entity.id == "truth-0" and not entity.HasField("lifetime")
        body, device = entity.spheres
        x, y = truth.columns("x", "y")[k]
        assert (body.pose.position.x, body.pose.position.y) == (x, y)
        assert np.allclose((body.size.x, body.size.y), 2 * truth.semi_axes[k])
        assert (device.pose.position.x, device.pose.position.y) == tuple(
            truth.columns("device_x", "device_y")[k]
        )
        assert entity.texts[0].text == "0" and entity.texts[0].scale_invariant


@pytest.mark.parametrize("kind", ["truth", "estimates"])
def test_outlines_lie_on_the_extents(
    recording: Recording, estimates: Estimates, tmp_path: Path, kind: str
) -> None:
    path = tmp_path / "x.mcap"
    record: Any = recording if kind == "truth" else estimates
    formats.write(record, path, "mcap")
    objects: Objects = recording.truth.objects if kind == "truth" else estimates.objects
    topic = "/truth/outlines" if kind == "truth" else "/estimates/example/outlines"
    clouds = topics(path)[topic]
    assert len(clouds) == len(objects.time_ns)
    for k in range(0, len(clouds), 7):
        found = points(clouds[k])
        centre = objects.columns("x", "y")[k]
        assert np.allclose((found["x"][0], found["y"][0]), centre, rtol=1e-6)
        away = np.stack((found["x"], found["y"]), 1)[2:] - centre
        assert np.allclose(((away / objects.semi_axes[k]) ** 2).sum(1), 1.0, atol=1e-3)
        assert (found["red"][0], found["green"][0], found["blue"][0]) == RGB[kind]


def test_outlines_of_solids_rectangles_and_nothing(recording: Recording, tmp_path: Path) -> None:
    half = np.sqrt(0.5)
    solid = Objects(
        np.arange(3) * 10**9, np.array([0, 1, 2, 2]), np.zeros(2, np.int64), ("x", "y", "z"),
        ("m",) * 3, np.array([[1.0, 2, 3], [0, 0, 0]]), extent_kind="ellipsoid",
        semi_axes=np.array([[3.0, 2, 1]] * 2), rotation=np.array([[0, 0, half, half]] * 2),
    )  # fmt: skip
    flat = replace(
        solid, extent_kind="rectangle", semi_axes=np.array([[3.0, 2.0]] * 2),
        rotation=np.array([0.0, np.pi / 2]),
    )  # fmt: skip
    for name, objects, size in (("solid", solid, (4, 6, 2)), ("flat", flat, (4, 6, 0))):
        truth = replace(recording.truth, objects=objects)
        formats.write(replace(recording, truth=truth), tmp_path / name, "mcap")
        first, second, third = map(points, topics(tmp_path / name)["/truth/outlines"])
        found = np.stack([second[c] for c in "xyz"])
        assert np.allclose(np.ptp(found, axis=1), size, atol=1e-5)
        assert (first["x"][0], first["y"][0], first["z"][0]) == (1, 2, 3) and len(third) == 0


def test_sensors_are_named_where_they_are(recording: Recording, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    formats.write(recording, path, "mcap")
    found = topics(path)
    (update,) = found["/sensors/scene"]
    assert {e.frame_id for e in update.entities} == {"A1", "A2", "R"}
    assert all(e.frame_locked and e.texts[0].text == e.frame_id for e in update.entities)
    assert {t.child_frame_id for t in found["/tf"]} == {"A1", "A2", "R"}
