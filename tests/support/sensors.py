"""Recordings of radars and UWB networks of which all is known."""

from __future__ import annotations

import numpy as np

from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.records import Meta, Objects, Recording, Sensor, Stream, Truth

SECOND = 10**9
ANCHORS = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 8.0], [0.0, 8.0], [5.0, -2.0]])
OFFSETS = np.array([0.1, 0.25, -0.05, 0.15, 0.3])
RADAR = {"latency": 0.8, "p_detect": 0.85, "clutter_rate": 10.0}
POSITION = {"registration_x": 3.0, "registration_y": -2.0, "std_position": 5.0}
POLAR = {
    "registration_range": 3.0, "registration_azimuth": 0.004, "std_range": 3.0,
    "std_azimuth": 0.008,
}  # fmt: skip
UWB = {"sigma": 0.08, "scale": 0.01, "device_height": 1.0, "p_detect": 0.8, "mean_clutter": 0.5}


def radar(seed, kind="position", scans=100, targets=6, each=1, moving=False, **changes):
    """Targets that go straight at 15 m/s, seen by a radar that stands, or drives and turns."""
    polar = kind == "range_bearing"
    true = {**RADAR, **(POLAR if polar else POSITION), **changes}
    rng = np.random.default_rng(seed)
    heading = rng.uniform(-np.pi, np.pi, targets)
    v = 15.0 * np.stack((np.cos(heading), np.sin(heading)), 1)
    start = rng.uniform(-500, 500, (targets, 2)) - v * scans / 2
    fine = np.arange(-2.0, scans + 1.0, 0.5)
    x = start + fine[:, None, None] * v
    names = ("range", "azimuth") if polar else ("x", "y")
    offset = [true[f"registration_{n}"] for n in names]
    std = [true["std_range"], true["std_azimuth"]] if polar else [true["std_position"]] * 2
    pose = np.column_stack((4.0 * fine, -2.0 * fine, 0 * fine)) * moving
    yaw = 0.02 * fine * moving
    rows = []
    for k in range(scans):
        t = k - true["latency"]
        found = (start + t * v)[rng.random(targets) < true["p_detect"]].repeat(each, 0)
        c, s = np.cos(0.02 * t * moving), np.sin(0.02 * t * moving)
        local = (found - np.array([4.0 * t, -2.0 * t]) * moving) @ np.array([[c, -s], [s, c]])
        if polar:
            local = np.stack((np.hypot(*local.T), np.arctan2(local[:, 1], local[:, 0])), 1)
        z = local + offset + rng.normal(size=local.shape) * std
        n = rng.poisson(true["clutter_rate"])
        area = ((0, -np.pi), (2000, np.pi)) if polar else ((-1000, -1000), (1000, 1000))
        z = np.vstack((z, rng.uniform(*area, (n, 2))))
        if polar:
            z[:, 1] = (z[:, 1] + np.pi) % (2 * np.pi) - np.pi
            z[:, 0] = np.abs(z[:, 0])
        rows.append(z)
    begin = 5 * SECOND
    stream = Stream(
        kind, ("R",), {}, np.arange(scans) * SECOND + begin, np.cumsum([0, *map(len, rows)]), {},
        dict(zip(names, np.concatenate(rows).T.copy(), strict=True)),
    )  # fmt: skip
    time = np.rint(fine * SECOND).astype(np.int64) + begin
    truth = Objects(
        time, np.arange(len(fine) + 1) * targets, np.tile(np.arange(targets), len(fine)),
        ("x", "y"), ("m", "m"), x.reshape(-1, 2),
    )  # fmt: skip
    sensor = Sensor("radar", time, pose, yaw_quaternion(yaw))
    return Recording(Meta(f"radar-{seed}"), {"R": sensor}, {"R": stream}, Truth(truth)), true


def uwb(seed, events=1500, level=2.5, **changes):
    """A device that walks about among five anchors at a height."""
    true = {**UWB, **changes, **{f"offset A{k}": b for k, b in enumerate(OFFSETS)}}
    rng = np.random.default_rng(seed)
    t, node = np.arange(events) * 0.05, np.arange(events) % 5
    x = np.stack(
        (
            5 + 4 * np.sin(0.31 * t) + 0.5 * np.sin(1.3 * t),
            4 + 3.2 * np.cos(0.23 * t) + 0.4 * np.cos(1.7 * t),
        ),
        1,
    )
    d = np.sqrt(((x - ANCHORS[node]) ** 2).sum(1) + (level - true["device_height"]) ** 2)
    z = (1 + true["scale"]) * d + OFFSETS[node] + true["sigma"] * rng.normal(size=events)
    rows = [
        [*z[k : k + (rng.random() < true["p_detect"])],
         *rng.uniform(0, 20, rng.poisson(true["mean_clutter"]))]
        for k in range(events)
    ]  # fmt: skip
    scan = {"mode": np.zeros(events, "u1"), "tx": np.full(events, 5, "i4"), "rx": node.astype("i4")}
    time = np.rint(t * SECOND).astype(np.int64)
    stream = Stream(
        "uwb", ("A0", "A1", "A2", "A3", "A4", "D"), {}, time, np.cumsum([0, *map(len, rows)]), scan,
        {"distance": np.concatenate(rows)},
    )  # fmt: skip
    sensors = {
        f"A{k}": Sensor.static("anchor", np.array([*a, level])) for k, a in enumerate(ANCHORS)
    }
    label = np.zeros(events, np.int64)
    truth = Objects(time, np.arange(events + 1), label, ("x", "y"), ("m", "m"), x)
    nodes = {**sensors, "D": Sensor.device(0)}
    return Recording(Meta(f"uwb-{seed}"), nodes, {"uwb": stream}, Truth(truth)), true
