"""The k best assignments over one or several cost matrices, by Murty's partitioning.

K. G. Murty, "An algorithm for ranking all the assignments in order of increasing cost",
Operations Research 16 (1968) 682-687. A solution splits what is left of its problem into disjoint
parts: part i keeps the columns of the rows before i and forbids that of row i.
"""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count

import numpy as np
from scipy.optimize import linear_sum_assignment

from ....models.records import Array


def k_best(costs: Array, k: int, gap: float = np.inf) -> tuple[Array, Array, Array]:
    """The ``k`` cheapest assignments of all rows to different columns, over all problems.

    Parameters
    ----------
    costs : (G, n, m), m >= n; an infinite entry forbids a pair
    k : how many assignments are wanted; fewer come back where there are no more
    gap : stop at assignments that cost more than the cheapest one plus ``gap``

    Returns
    -------
    problem (s,), column of each row (s, n) and cost (s,), s <= k, in order of increasing cost
    """
    heap: list[tuple[float, int, int, int, Array, Array]] = []
    order = count()

    def push(problem: int, start: int, C: Array) -> None:
        try:
            rows, columns = linear_sum_assignment(C)
        except ValueError:  # infeasible
            return
        heappush(heap, (C[rows, columns].sum(), next(order), problem, start, columns, C))

    for problem, C in enumerate(costs):
        push(problem, 0, C)
    found: list[tuple[int, Array, float]] = []
    while heap and len(found) < k:
        cost, _, problem, start, columns, C = heappop(heap)
        if found and cost > found[0][2] + gap:
            break
        found.append((problem, columns, cost))
        for i in range(start, len(C)):
            kept = C[i, columns[i]]
            part = C.copy()
            part[i, columns[i]] = np.inf
            push(problem, i, part)
            C = C.copy()
            C[i] = np.inf
            C[i, columns[i]] = kept
    problems, assignments, values = zip(*found, strict=True) if found else ((), (), ())
    return (
        np.array(problems, np.int64),
        np.array(assignments, np.int64).reshape(len(found), costs.shape[1]),
        np.array(values, float),
    )
