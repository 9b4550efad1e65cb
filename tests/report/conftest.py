"""Small inputs for every kind of plot, made by the simulators, filters and metrics themselves."""

from __future__ import annotations

import logging
import warnings
from pathlib import Path

import numpy as np
import pytest

from echoset import formats
from echoset.cli.main import main
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.records import Meta, Objects, Recording, Sensor, Stream, Truth

SECOND = 10**9


def stations() -> Recording:
    """Four stations around a square, and maps of three objects of known places."""
    r, azimuth = np.arange(0.0, 90.0, 0.8), np.radians(np.linspace(-60, 60, 51))
    objects = np.array([[10.0, 5.0], [-8.0, 12.0], [0.0, -15.0]])
    time_ns = np.arange(1, 3) * SECOND
    rng = np.random.default_rng(5)
    sensors, streams = {}, {}
    for i, turn in enumerate(np.arange(4) * np.pi / 2):
        position = 50.0 * np.array([np.cos(turn), np.sin(turn), 0.0])
        yaw = turn + np.pi
        q = yaw_quaternion(np.array([yaw]))
        sensors[f"BS{i + 1}"] = Sensor("radar", np.zeros(1, np.int64), position[None], q)
        away = (objects - position[:2]) @ np.array(
            [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
        )
        d, a = np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])
        power = rng.exponential(size=(2, len(r), len(azimuth)))
        for k in range(3):
            peak = np.exp(-(((r - d[k]) / 1.0) ** 2))[:, None] * np.exp(
                -(((azimuth - a[k]) / 0.03) ** 2)
            )
            power += 3e3 * peak
        model = {"range_axis": r, "azimuth_axis": azimuth}
        streams[f"BS{i + 1}"] = Stream(
            "range_angle_map", (f"BS{i + 1}",), model, time_ns, np.zeros(3, np.int64),
            {"map": power.astype("f4")}, {},
        )  # fmt: skip
    truth = Objects(
        time_ns, np.array([0, 3, 6]), np.tile(np.arange(3), 2), ("x", "y"), ("m", "m"),
        np.tile(objects, (2, 1)),
    )  # fmt: skip
    return Recording(Meta("stations-s1-0000"), sensors, streams, Truth(truth))


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of recordings, estimates and scores: UWB, point targets, extended targets, maps."""
    folder = tmp_path_factory.mktemp("plots")
    show = warnings.showwarning

    def run(*words: object) -> None:
        assert main([str(w) for w in words]) == 0, words

    blocked = "blocked=[[4,6,1],[4,6,2],[7,9,1]]"
    run(
        "simulate",
        "uwb-olos",
        "--runs",
        2,
        "--set",
        "steps=14",
        "--set",
        blocked,
        "-o",
        f"{folder}/uwb/",
    )
    uwb = sorted((folder / "uwb").glob("*.h5"))
    run("estimate", "-e", "eopda-geo", "--set", "particles=200", *uwb, "-o", f"{folder}/geo/")
    geo = sorted((folder / "geo").glob("*.h5"))
    score = ("-m", "rmse,cdf,pcrlb,pcrlb-star,pcrlb-smooth", "-o", folder / "uwb.csv")
    run("score", *geo, "--truth", folder / "uwb", *score)
    run("simulate", "meeting", "--set", "steps=20", "--set", "last=[9]", "-o", folder / "points.h5")
    for name in ("mbm", "phd"):
        run("estimate", "-e", name, folder / "points.h5", "-o", folder / f"{name}.h5")
    score = ("-m", "ospa,gospa,cardinality", "-o", folder / "points.csv")
    run("score", folder / "mbm.h5", folder / "phd.h5", "--truth", folder / "points.h5", *score)
    run("simulate", "radar-extended", "--set", "epochs=2", "-o", folder / "extended.h5")
    chain = ("explore=1000", "max_explore=2000", "max_burn_in=2000", "burn_in=500", "thin=5")
    words = [w for setting in chain for w in ("--set", setting)]
    run("estimate", "-e", "di-gsncp", folder / "extended.h5", *words, "-o", folder / "chain.h5")
    run("simulate", "surveillance", "--set", "steps=30", "-o", folder / "views.h5")
    formats.write(stations(), folder / "maps.h5", "h5")
    logging.captureWarnings(False)
    warnings.showwarning = show
    return folder
