"""Regenerate tables and figures of the papers: ``PYTHONPATH=benchmarks python -m papers``.

Pieces that are there already are not made again, so a run that was stopped takes up where it was.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

from . import control, crowds, extended, maps, stations, uwb
from .pieces import Paper, complete

PAPERS: dict[str, Paper] = {
    paper.NAME: paper for paper in (uwb, control, extended, stations, maps, crowds)
}
KEPT = Path("build/pieces")


def main() -> None:
    """Make what is missing, then the pages."""
    parser = argparse.ArgumentParser(prog="papers", description=__doc__)
    quick = parser.add_mutually_exclusive_group()
    quick.add_argument("--share", type=float, default=1.0, help="share of the runs (%(default)s)")
    quick.add_argument("--quick", dest="share", action="store_const", const=0.1, help="a tenth")
    parser.add_argument("--only", choices=PAPERS, action="append", metavar="NAME",
                        help=f"one of {', '.join(PAPERS)}; may be repeated")  # fmt: skip
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/results"))
    parser.add_argument("--pieces", type=Path, default=KEPT, help="(%(default)s)")
    parser.add_argument("-j", "--jobs", type=int, default=2)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.only or PAPERS:
        make(PAPERS[name], given.share, given.output, given.pieces, given.jobs)


def make(paper: Paper, share: float, output: Path, kept: Path, jobs: int) -> None:
    """Make the pieces of a page that ``kept`` lacks, then the page."""
    pieces = paper.pieces(share)
    complete(pieces, kept, jobs, paper.NAME)
    paper.write([(piece, piece.result(kept)) for piece in pieces], output)


if __name__ == "__main__":
    main()
