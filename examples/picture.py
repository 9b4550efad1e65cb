"""Draws a recording's true path, device and ellipse beside the estimates, as an SVG.

Usage: python examples/picture.py RECORDING ESTIMATES OUT.svg
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np

import echoset

matplotlib.use("svg")
matplotlib.rcParams["svg.hashsalt"] = "echoset"
matplotlib.rcParams["svg.fonttype"] = "none"
from matplotlib import pyplot as plt  # noqa: E402
from matplotlib.patches import Ellipse  # noqa: E402

BLUE, ORANGE, GREY = "#0072B2", "#E69F00", "#999999"
"""Colours of Okabe and Ito, told apart by the colour-blind."""


def draw(recording: echoset.Recording, estimates: echoset.Estimates, target: Path) -> None:
    """Draw the scene and the error of the device over time."""
    figure, (scene, error) = plt.subplots(1, 2, figsize=(10, 4.2), layout="constrained")
    anchors = {n: s.position[0] for n, s in recording.sensors.items() if s.kind == "anchor"}
    for name, p in anchors.items():
        scene.plot(p[0], p[1], "k^")
        scene.annotate(name, p[:2], xytext=(6, 4), textcoords="offset points")
    truth = recording.truth.objects
    for objects, colour, label in ((truth, BLUE, "truth"), (estimates.objects, ORANGE, "estimate")):
        scene.plot(*objects.columns("x", "y").T, color=colour, lw=1, label=f"centre, {label}")
        scene.plot(*objects.columns("device_x", "device_y").T, ".", ms=3, color=colour)
        for k in range(0, len(objects.time_ns), 20):
            centre = objects.columns("x", "y")[k]
            axes = 2 * objects.semi_axes[k]
            scene.add_patch(Ellipse(centre, *axes, fill=False, color=colour))
    scene.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    scene.legend(loc="upper left", fontsize="small")
    devices = [o.columns("device_x", "device_y") for o in (truth, estimates.objects)]
    offset = np.diff(devices, axis=0)
    t = estimates.objects.time_ns / 1e9
    error.plot(t, np.linalg.norm(offset[0], axis=1), color=ORANGE)
    blocked = np.unique(recording.truth.blocked_time_ns, return_counts=True)
    for time_ns, count in zip(*blocked, strict=True):
        shade = 0.15 * count
        error.axvspan(time_ns / 1e9 - 0.1, time_ns / 1e9, color=GREY, alpha=shade, lw=0)
    error.set(xlabel="time [s]", ylabel="error of the device [m]", ylim=(0, None), xlim=(0, t[-1]))
    figure.savefig(target, metadata={"Date": None})


if __name__ == "__main__":
    draw(echoset.read(sys.argv[1]), echoset.read(sys.argv[2]), Path(sys.argv[3]))
