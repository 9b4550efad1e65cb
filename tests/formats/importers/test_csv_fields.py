"""What a mapping may say of a column: every quantity with every unit, scale and value."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import FormatError, ParameterError
from echoset.models.records import Recording

FACTORS: dict[str, dict[str, float]] = {
    "length": {
        "": 1, "m": 1, "cm": 0.01, "mm": 0.001, "km": 1000, "ft": 0.3048, "in": 0.0254, "nmi": 1852
    },
    "angle": {"": 1, "rad": 1, "deg": math.pi / 180},
    "duration": {"": 1, "s": 1, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "speed": {"": 1, "m/s": 1, "km/h": 1 / 3.6, "ft/s": 0.3048, "kn": 1852 / 3600},
    "ratio": {"": 1, "1": 1},
}  # fmt: skip
"""Units and what one of them is in SI, by the definitions of the units."""
RADAR = {"doppler": "speed", "power": "ratio", "amplitude": "ratio", "time_offset": "duration"}
QUANTITIES: dict[str, dict[str, str]] = {
    "uwb": {"time": "duration", "distance": "length", "std": "length", "amplitude": "ratio"},
    "position": {"time": "duration", "x": "length", "y": "length", "z": "length", **RADAR},
    "range_bearing": {
        "time": "duration", "range": "length", "azimuth": "angle", "elevation": "angle",
        "std_range": "length", "std_azimuth": "angle", **RADAR,
    },
}  # fmt: skip
NEEDED = {
    "uwb": {"time": "t", "anchor": "id", "distance": "q"},
    "position": {"time": "t", "x": "q", "y": "q"},
    "range_bearing": {"time": "t", "range": "q", "azimuth": "q"},
}
NAMES = {"uwb": ("anchor", "device"), "position": ("sensor", "scan"), "range_bearing": ("sensor",)}
CASES = [(kind, key) for kind, keys in QUANTITIES.items() for key in keys]


def mapping(kind: str, **columns: Any) -> dict[str, Any]:
    found: dict[str, Any] = {"kind": kind, "columns": {**NEEDED[kind], **columns}}
    return found | ({"anchors": {"A": [0, 0]}} if kind == "uwb" else {})


ONE = "t,id,q\n3,A,0.25\n"


def read(folder: Path, said: dict[str, Any], text: str = ONE) -> Recording:
    log = folder / "log.csv"
    if not log.exists() or log.read_text() != text:
        log.write_text(text)
    return csv.read([log], csv.Params(said))


def value(log: Recording, key: str) -> float:
    """The first value of a quantity, as the recording holds it."""
    (stream,) = log.streams.values()
    return stream.time_ns[0] * 1e-9 if key == "time" else float(stream.rows[key][0])


@pytest.mark.parametrize(("kind", "key"), CASES)
def test_a_column_or_a_value_in_each_unit(tmp_path: Path, kind: str, key: str):
    dimension = QUANTITIES[kind][key]
    for unit, scale in itertools.product(FACTORS[dimension], (None, 0.1, 2)):
        more: dict[str, Any] = {"unit": unit} if unit else {}
        more |= {} if scale is None else {"scale": scale}
        factor = FACTORS[dimension][unit] * (1 if scale is None else scale)
        said: list[tuple[dict[str, Any], float]] = [
            ({"column": "q", **more}, 0.25),
            ({"value": 0.5, **more}, 0.5),
        ]
        if unit:
            less = {k: v for k, v in more.items() if k != "unit"}
            said.append(({"value": f"0.5 {unit}", **less}, 0.5))
        for given, number in said:
            found = value(read(tmp_path, mapping(kind, **{key: given})), key)
            assert found == pytest.approx(number * factor, rel=1e-12, abs=1e-9), given


def test_decibels_as_column_and_as_value(tmp_path: Path):
    for given in ({"column": "q"}, {"value": 0.25}):
        for key, base in (("power", 10.0), ("amplitude", 20.0)):
            log = read(tmp_path, mapping("position", **{key: {**given, "unit": "dB"}}))
            assert value(log, key) == pytest.approx(10 ** (0.25 / base), rel=1e-12)


def test_scaled_times_are_exact(tmp_path: Path):
    # Frames of 0.1 s, counted: 1 to 3 are at 0.1, 0.2 and 0.3 s, without a rounding error.
    said = mapping("uwb", time={"column": "t", "scale": 0.1})
    log = read(tmp_path, said, "t,id,q\n1,A,1\n2,A,1\n3,A,1\n")
    assert log.streams["uwb"].time_ns.tolist() == [100_000_000, 200_000_000, 300_000_000]


@pytest.mark.parametrize(
    ("kind", "key"), [(kind, key) for kind, keys in NAMES.items() for key in keys]
)
@pytest.mark.parametrize("more", [{"unit": "m"}, {"scale": 2}])
def test_names_have_neither_unit_nor_scale(tmp_path: Path, kind: str, key: str, more):
    with pytest.raises(ParameterError, match=rf"columns\.{key}.* is a name"):
        read(tmp_path, mapping(kind, **{key: {"column": "id", **more}}))


ODD: list[Any] = [["t"], {"t": 1}, True, 1.5, None, [], {}, ""]


@pytest.mark.parametrize("odd", ODD, ids=repr)
@pytest.mark.parametrize("kind", NEEDED)
def test_a_column_is_a_name_or_a_number(tmp_path: Path, kind: str, odd: Any):
    for key in (*QUANTITIES[kind], *NAMES[kind]):
        for given in (odd, {"column": odd}):
            with pytest.raises(ParameterError, match=rf"columns\.{key}"):
                read(tmp_path, mapping(kind, **{key: given}))
        if odd not in (1.5,):
            with pytest.raises(ParameterError, match=rf"columns\.{key}"):
                read(tmp_path, mapping(kind, **{key: {"value": odd}}))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"value": "10 cm", "unit": "cm"}, "has a unit of its own"),
        ({"value": "ten cm"}, "number"),
        ({"value": "1 kg"}, "unit 'kg' is not one of m cm"),
        ({"value": -1}, "negative"),
        ({"value": 1e308, "unit": "km"}, "finite"),
        ({"column": "q", "unit": 3}, "must be a str"),
        ({"column": "q", "scale": "two"}, "must be a float"),
        ({"column": "q", "scale": 0}, "scale must be other than 0"),
        ({"column": "q", "value": 1}, "either a column or a value"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, given, message: str):
    with pytest.raises(ParameterError, match=rf"columns\.std.*{message}"):
        read(tmp_path, mapping("uwb", std=given))


def test_bearings_of_a_level_sensor_whose_z_points_down(tmp_path: Path):
    # Ahead is east, so that what is 10 m to the right stands 10 m to the south.
    columns = {"range": {"value": 10}, "azimuth": {"value": "90 deg"}}
    said = mapping("range_bearing", **columns) | {"sensor_frame": ["forward", "right", "down"]}
    for frame, ahead in (
        (["east", "north", "up"], 0.0),
        (["north", "east", "down"], math.pi / 2),
        (["north", "east"], math.pi / 2),
    ):
        for yaw in (0.0, 30.0):
            pose = {"radar": {"position": [0, 0], "yaw": f"{yaw} deg"}}
            log = read(tmp_path, said | {"frame": frame, "sensors": pose})
            rows, sensor = log.streams["radar"].rows, log.sensors["radar"]
            x, y, z, w = sensor.quaternion[0]
            assert (x, y) == pytest.approx((0, 0), abs=1e-12), "the sensor is level"
            map_azimuth = rows["azimuth"][0] + 2 * math.atan2(z, w)
            turned = math.radians(yaw) * (1 if frame[0] == "east" else -1)
            right = ahead + turned - math.pi / 2
            wrapped = (map_azimuth - right + math.pi) % (2 * math.pi) - math.pi
            assert wrapped == pytest.approx(0, abs=1e-12), (frame, yaw)


def test_marks_in_ids_become_legal(tmp_path: Path):
    said = mapping("uwb", device="d") | {"anchors": {"12:AF": [0, 0], "#2": [3, 0]}}
    text = "t,id,d,q\n0,12:AF,00:1B/7,1\n1,#2,00:1B/7,2\n"
    log = read(tmp_path, said, text)
    assert log.streams["uwb"].nodes == ("00_1B_7", "12_AF", "_2")
    assert log.streams["uwb"].scan["rx"].tolist() == [1, 2]
    with pytest.raises(ParameterError, match="'1_2' and '1:2' are both called '1_2'"):
        anchors = {"1_2": [0, 0], "1:2": [1, 0]}
        read(
            tmp_path, said | {"anchors": anchors}, text.replace("12:AF", "1:2").replace("#2", "1_2")
        )


def truth(folder: Path, table: str, **more: Any) -> Recording:
    (folder / "g.csv").write_text(table)
    columns = {"time": "t", "x": "x", "y": "y", "label": "who"}
    spec = {"file": "g.csv", "columns": columns, **more}
    return read(folder, mapping("uwb") | {"truth": spec})


def test_text_labels_of_truth(tmp_path: Path):
    table = "t,who,x,y\n0,bus,1,2\n0,car,3,4\n1,car,5,6\n"
    found = truth(tmp_path, table, labels={"bus": 7, "car": 2}).truth
    assert found is not None
    assert found.objects.label.tolist() == [2, 7, 2]
    assert found.objects.state.tolist() == [[3, 4], [1, 2], [5, 6]]
    with pytest.raises(FormatError, match=r"g\.csv: line 2, column 'who': 'bus' .*labels"):
        truth(tmp_path, table)
    with pytest.raises(FormatError, match=r"g\.csv: line 3, column 'who': 'car' .*labels"):
        truth(tmp_path, table, labels={"bus": 7})
    for wrong in ({"bus": 7, "car": 7}, {"bus": 1.5, "car": 2}, ["bus"], {"bus": "x", "car": 2}):
        with pytest.raises(ParameterError, match="labels"):
            truth(tmp_path, table, labels=wrong)


def test_times_known_to_be_empty(tmp_path: Path):
    found = truth(tmp_path, "t,who,x,y\n0,1,1,2\n1,,,\n2,1,,\n3,1,5,6\n").truth
    assert found is not None
    assert (found.objects.time_ns * 1e-9).tolist() == [0, 1, 2, 3]
    assert found.objects.row_offset.tolist() == [0, 1, 1, 1, 2]
    with pytest.raises(FormatError, match=r"g\.csv: line 2, column 'y': .*one is empty"):
        truth(tmp_path, "t,who,x,y\n0,1,1,\n")


def test_doubled_times_name_the_reference(tmp_path: Path):
    table = "t,who,x,y\n0,1,1,2\n1,1,3,4\n1,1,5,6\n"
    with pytest.raises(FormatError, match=r"g\.csv: line 4, column 't': '1' .*repeats: first"):
        truth(tmp_path, table)
    for which, position in (("first", [3, 4]), ("last", [5, 6])):
        found = truth(tmp_path, table, repeats=which).truth
        assert found is not None
        assert found.objects.state.tolist() == [[1, 2], position]


def test_commas_as_decimal_sign_beside_semicolons(tmp_path: Path):
    text = "t;id;q\n0,5;A;1,25\n"
    with pytest.raises(FormatError, match=r"log\.csv: line 1: has one column: .* ';'"):
        read(tmp_path, mapping("uwb"), text)
    said = mapping("uwb") | {"delimiter": ";"}
    with pytest.raises(FormatError, match=r"line 2, column 'q': '1,25' .*decimal: ','"):
        read(tmp_path, said, text)
    log = read(tmp_path, said | {"decimal": ","}, text)
    assert log.streams["uwb"].time_ns.tolist() == [500_000_000]
    assert log.streams["uwb"].rows["distance"].tolist() == [1.25]
    with pytest.raises(FormatError, match=r"column 'q': '1\.25' has a point"):
        read(tmp_path, said | {"decimal": ","}, "t;id;q\n0,5;A;1.25\n")


def test_a_misspelt_name_in_the_model_is_warned_of(tmp_path: Path, caplog):
    read(tmp_path, mapping("uwb") | {"model": {"sigma": 0.1, "mean_cluter": 0.5}})
    (record,) = caplog.records
    assert record.levelname == "WARNING"
    assert "takes 'mean_cluter' (did you mean 'mean_clutter'?)" in record.getMessage()
