"""Both bounds of the scenario ``uwb-olos``: ``python benchmarks/bench_pcrlb.py``.

Prints the milliseconds of the fastest of three runs and their ratio to a fixed calibration kernel
timed in the same run: machines differ and drift, ratios do so less.
"""

from __future__ import annotations

from calibration import fastest, kernel
from scene import simulated

from echoset.metrics.bounds import pcrlb, pcrlb_star


def main() -> None:
    """Time the bounds on a recording made beforehand."""
    recording = simulated("uwb-olos", "bench")

    def bounds() -> None:
        pcrlb.link_information.cache_clear()
        pcrlb.bounds(recording, pcrlb.Params(), "pcrlb", blocked=False)
        pcrlb_star.bounds(recording, pcrlb.Params(), "pcrlb-star", blocked=True)

    taken, unit = fastest(bounds), fastest(kernel)
    print(f"pcrlb and pcrlb-star, 180 steps, 12 links: {1e3 * taken:.0f} ms, {taken / unit:.1f} x")


if __name__ == "__main__":
    main()
