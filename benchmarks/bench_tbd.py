"""Track-before-detect of maps: ``python benchmarks/bench_tbd.py``.

Six stations, four pedestrians and four vehicles of ``jsc-6bs``, 40 scans in memory and everything
compiled beforehand. Its kernels by the definitions on NumPy and as they run, for the cells about
one vehicle; then the filter. Prints milliseconds and their ratio to the calibration kernel.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import partial

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from calibration import fastest, kernel

from echoset.campaign.scenarios import find
from echoset.estimators.maps.kernels import response
from echoset.estimators.maps.kernels.compiled import response as compiled
from echoset.estimators.maps.tbd import filter as tbd
from echoset.estimators.maps.tbd.scene import Layout, View, windows
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.simulate import jsc

SCANS = 40


def main() -> None:
    """Print both tables."""
    unit = fastest(kernel)
    print(f"calibration kernel {1e3 * unit:.1f} ms")
    params = replace(resolve(jsc.Params, *find("jsc-6bs").layers), scans=SCANS)
    recording = jsc.simulate(params, generator(1, "bench", "tbd"), "tbd")
    setup, scans, given = recording.setup(), list(recording.scans()), tbd.Params()
    layout = Layout.of(setup, list(recording.streams), given)
    view = View.of(layout, scans[:6], setup)
    rest, target = np.ones_like(view.power), np.array([3.0, 4.0, 0.3, 0.0, 0.0, 1.0, 0.0])
    at = windows(layout, 3.0, 4.0, 5.0)
    print("part                      NumPy ms  ratio  as it runs")
    for name, derive in (("fit", False), ("fit with its derivatives", True)):
        one = (view.power, rest, layout.stations, layout.beams, view.columns, layout.bodies[1],
               target, at, given.shape, derive)  # fmt: skip
        found = [fastest(partial(m.fit, *one)) for m in (response, compiled)]
        print(f"{name:24s}", *(f"{1e3 * s:8.3f} {s / unit:7.4f}" for s in found))
    places = view.power, rest, layout.cell, layout.weight, given.shape
    found = [fastest(partial(m.gains, *places)) for m in (response, compiled)]
    print(f"{f'gains, {len(layout.places)} places':24s}",
          *(f"{1e3 * s:8.3f} {s / unit:7.4f}" for s in found))  # fmt: skip
    list(tbd.estimate(setup, iter(scans), given, generator(1, "bench", "tbd")))
    seconds = fastest(lambda: list(tbd.estimate(setup, iter(scans), given, generator(1, "b", "t"))))
    print(f"{'filter, a scan':24s} {1e3 * seconds / SCANS:8.2f} {seconds / SCANS / unit:7.4f}")


if __name__ == "__main__":
    main()
