"""Recordings of targets that go straight where a test wants them."""

from __future__ import annotations

import numpy as np

from echoset.campaign.scenarios import find
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.parameters import resolve
from echoset.models.records import Meta, Recording, Sensor, Stream, Truth
from echoset.simulate import jsc, spectral


def straight(kinds, place, heading, speed, seed, **changes):
    """Targets of classes ``kinds`` that pass ``place`` (n, 2) in the middle of the time."""
    params = resolve(jsc.Params, *find("jsc-6bs").layers, ("here", changes))
    rng, kinds = np.random.default_rng(seed), np.asarray(kinds)
    h, t = np.asarray(heading, float), params.time_ns / 1e9
    v = np.asarray(speed, float)[:, None] * np.stack((np.cos(h), np.sin(h)), 1)
    where = np.asarray(place, float)[:, None] + v[:, None] * (t - t.mean())[:, None]
    state = np.concatenate((where, np.repeat(v[:, None], len(t), 1)), 2)
    turn = np.repeat(h[:, None], len(t), 1)
    none, sensors, streams = np.zeros(len(t) + 1, np.int64), {}, {}
    for q, pose in enumerate(params.poses):
        name = f"S{q}"
        still = Sensor.static("radar", pose[:3])
        sensors[name] = Sensor("radar", still.time_ns, still.position, yaw_quaternion(pose[3:]))
        maps = []
        for k in range(len(t)):
            e = jsc.echoes(params, kinds, state[:, k], turn[:, k], pose[:3], float(pose[3]), rng)
            user = rng.uniform(-params.aperture, params.aperture)
            maps.append(spectral.range_angle_map(params, e, user, True, rng).astype("f4"))
        model = jsc._model(params, pose[:2], float(pose[3]))
        scan = {"map": np.stack(maps)}
        streams[name] = Stream("range_angle_map", (name,), model, params.time_ns, none, scan, {})
    truth = Truth(jsc._truth(params, kinds, state, turn))
    return Recording(Meta("straight"), sensors, streams, truth)
