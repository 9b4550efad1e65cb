"""Start-up of the command: ``python benchmarks/bench_startup.py``.

Prints the fastest of some runs of ``echoset --help`` and its ratio to an interpreter that starts
and does nothing, timed in the same run.
"""

from __future__ import annotations

import subprocess
import sys

from calibration import fastest

LIMIT = 0.3
RUNS = 20


def seconds(code: str) -> float:
    """Seconds that an interpreter needs to start, run ``code`` and end."""
    words = [sys.executable, "-c", code]
    return fastest(lambda: subprocess.run(words, check=True, stdout=subprocess.DEVNULL), RUNS)


def main() -> None:
    """Time start-up and say whether it is within the limit."""
    bare = seconds("pass")
    helped = seconds("from echoset.cli.main import main; main(['--help'])")
    print(f"{'echoset --help':<16} {1e3 * helped:8.1f} ms   {helped / bare:6.2f} bare interpreters")
    print(f"within {LIMIT} s: {'yes' if helped < LIMIT else 'no'}")


if __name__ == "__main__":
    main()
