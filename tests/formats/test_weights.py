"""Weights of the classifier: as written so read, and nothing else is taken for them."""

import io
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from echoset.formats import weights
from echoset.models.classifier import SHAPES, Weights
from echoset.models.errors import FormatError, OutputError


def arrays(**changes):
    rng = np.random.default_rng(0)
    a = {name: rng.random(shape).astype(np.float32) for name, shape in SHAPES.items()}
    return {name: value for name, value in {**a, **changes}.items() if value is not None}


def saved(path, **changes):
    np.savez(path, **arrays(**changes))
    return path


def test_round_trip_and_equal_bytes(tmp_path):
    w = Weights.of(arrays())
    for name in ("a.npz", "b.npz"):
        weights.write(tmp_path / name, w)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    found = weights.read(tmp_path / "a.npz")
    for name, value in w.arrays().items():
        np.testing.assert_array_equal(found.arrays()[name], value)
    with pytest.raises(OutputError, match="exists already"):
        weights.write(tmp_path / "a.npz", w)


def test_the_scale_of_the_input_may_be_absent(tmp_path):
    found = weights.read(saved(tmp_path / "w.npz", mean=None, std=None))
    assert (found.mean, found.std) == (0.0, 1.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"conv_bias": None}, "conv_bias: is missing"),
        ({"conv_bias": np.zeros(19, np.float32)}, r"conv_bias: has shape \(19,\), needs \(20,\)"),
        ({"fc_bias": np.zeros(2)}, "fc_bias: has type float64, needs float32"),
        ({"fc_bias": np.array([0, np.nan], np.float32)}, "fc_bias: is not finite"),
        ({"std": np.float32(0)}, "std: 0.0 is not positive"),
        ({"fc_weight": np.asfortranarray(np.ones(SHAPES["fc_weight"], np.float32))}, "of Fortran"),
        ({"fc_bias": np.array([None, 1], object)}, "fc_bias: has type object"),
    ],
)
def test_wrong_arrays(tmp_path, changes, message):
    path = saved(tmp_path / "w.npz", **changes)
    with pytest.raises(FormatError, match=rf"w.npz: .*{message}"):
        weights.read(path)


def test_missing_and_other_files(tmp_path):
    with pytest.raises(FormatError, match=r"none.npz: no weights: No such file"):
        weights.read(tmp_path / "none.npz")
    with pytest.raises(FormatError, match="no weights: Is a directory"):
        weights.read(tmp_path)
    (tmp_path / "text.npz").write_text("these are no weights")
    with pytest.raises(FormatError, match="not a sound NumPy archive"):
        weights.read(tmp_path / "text.npz")


def test_damage_is_found_wherever_it_is(tmp_path):
    data = saved(tmp_path / "w.npz").read_bytes()
    rng = np.random.default_rng(1)
    for k in (0, *rng.integers(0, len(data), 60).tolist(), len(data) - 1):
        (tmp_path / "cut.npz").write_bytes(data[:k])
        with pytest.raises(FormatError):
            weights.read(tmp_path / "cut.npz")
    inside = data.index(b"fc_weight.npy") + 500
    broken = bytearray(data)
    broken[inside] ^= 0xFF
    (tmp_path / "flip.npz").write_bytes(broken)
    with pytest.raises(FormatError, match=r"flip.npz: "):
        weights.read(tmp_path / "flip.npz")


def test_a_huge_shape_takes_no_memory(tmp_path):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": (1 << 40,)}
    )
    with zipfile.ZipFile(tmp_path / "w.npz", "w") as archive:
        archive.writestr("conv_weight.npy", header.getvalue())
    with pytest.raises(FormatError, match=r"conv_weight: has shape \(1099511627776,\)"):
        weights.read(tmp_path / "w.npz")


def test_they_say_how_they_were_made(tmp_path):
    """What was written is read; equal bytes; the arrays, and files without it, are as before."""
    plain = weights.read(saved(tmp_path / "w.npz"))
    made = {"seed": 7, "settings": {"scenes": 3}, "eirp": [20.0, 50.0]}
    for name in ("a.npz", "b.npz"):
        weights.write(tmp_path / name, replace(plain, made=made))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    found = weights.read(tmp_path / "a.npz")
    assert found.made == made and plain.made == {}
    for a, b in zip(found.arrays().values(), plain.arrays().values(), strict=True):
        np.testing.assert_array_equal(a, b)
    assert np.load(tmp_path / "a.npz")["fc_bias"].shape == (2,)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"{", "made.json|JSON"),
        (b"[1]", "is not an object"),
        (b"\xff", "not UTF-8"),
        (b" " * 70000, "longer than"),
    ],
)
def test_how_they_were_made_must_be_json(tmp_path, text, message):
    path = saved(tmp_path / "w.npz")
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("made.json", text)
    with pytest.raises(FormatError, match=message):
        weights.read(path)
