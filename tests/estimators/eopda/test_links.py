"""Grouping link events by time and finding the noise of their ranges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.eopda.links import link_steps, network
from echoset.models.errors import InputError
from echoset.models.records import Meta, Recording, Sensor, Stream


def recording(rows: dict, nodes=("A1", "D", "A2"), events=((0, 1, 0), (1, 0, 2), (0, 1, 2))):
    """Two times, the ``events`` (mode, tx, rx) at each with one range a link."""
    n = 2 * len(events)
    mode, tx, rx = np.tile(np.array(events).T, 2)
    stream = Stream(
        "uwb",
        nodes,
        {},
        np.repeat([100, 250], n // 2),
        np.arange(n + 1),
        {"mode": mode.astype("u1"), "tx": tx.astype("i4"), "rx": rx.astype("i4")},
        {"distance": np.arange(1.0, n + 1), **{k: np.full(n, v) for k, v in rows.items()}},
    )
    sensors = {
        name: Sensor.static("anchor", np.array([k, 1.0])) if name[0] == "A" else Sensor.device()
        for k, name in enumerate(nodes)
    }
    return Recording(Meta("example"), sensors, {"uwb": stream})


def steps(record, device=None, rms_bandwidth=None, threshold=1.0, sigma=None):
    net = network(record, device, rms_bandwidth, threshold, sigma)
    return [(time, heard[:2]) for time, heard in link_steps(net, record.scans())]


def test_events_are_grouped_by_time_and_mode():
    (first, (active, passive)), (second, _) = steps(recording({"std": 0.1}))
    assert (first, second) == (100, 250)
    # anchors A1, A2 are 0, 1 and the device 2
    assert active.tx.tolist() == [2, 2] and active.rx.tolist() == [0, 1]
    assert active.z.tolist() == [1.0, 3.0] and active.offset.tolist() == [0, 1, 2]
    assert passive.tx.tolist() == [0] and passive.rx.tolist() == [1] and passive.z.tolist() == [2.0]
    assert np.allclose(passive.variance, 0.01)


@pytest.mark.parametrize(
    ("rows", "options", "std"),
    [
        ({"amplitude": 2.0, "std": 9.0}, {"rms_bandwidth": 1e9, "sigma": 9.0}, 0.0168693),
        ({"amplitude": 0.1}, {"rms_bandwidth": 1e9}, 0.0337385),
        ({"std": 0.2}, {"sigma": 9.0}, 0.2),
        ({}, {"sigma": 0.3}, 0.3),
    ],
)
def test_noise_comes_from_the_best_source(rows, options, std):
    _, (active, _) = steps(recording(rows), **options)[0]
    assert np.allclose(np.sqrt(active.variance), std, rtol=1e-5)


@pytest.mark.parametrize(
    ("rows", "word"), [({"amplitude": 2.0}, "rms_bandwidth"), ({}, "sigma"), ({"std": 0.0}, "std")]
)
def test_unknown_noise_is_an_error(rows, word):
    with pytest.raises(InputError, match=word):
        steps(recording(rows))


def test_one_of_several_devices_is_tracked():
    record = recording({"std": 0.1}, ("A1", "D", "A2", "D2"), ((0, 1, 0), (0, 3, 0), (0, 3, 2)))
    with pytest.raises(InputError, match=r"D D2 .*range-ls with .tags."):
        steps(record)
    with pytest.raises(InputError, match="D3"):
        steps(record, device="D3")
    _, (active, passive) = steps(record, device="D2")[0]
    assert active.z.tolist() == [2.0, 3.0] and passive.empty


def test_the_network_must_be_there():
    record = recording({"std": 0.1})
    with pytest.raises(InputError, match="one UWB stream"):
        network(replace(record, streams={}), None, None, 1.0, None)
    nodes = replace(record.streams["uwb"], nodes=("D", "D", "D"))
    with pytest.raises(InputError, match="anchors"):
        network(replace(record, streams={"uwb": nodes}), None, None, 1.0, None)
