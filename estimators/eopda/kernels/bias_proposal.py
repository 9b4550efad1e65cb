"""Where the device may sit on its object: a proposal of the bias that looks at the LOS ranges.

The bias (b_rho, b_phi) wanders far in a step (0.1 m, 0.5 rad) and a line of sight pins the device
to centimetres. So each particle draws K biases from the random walk and keeps one in proportion to
``g``, the likelihood of the LOS model alone. The factor ``mean g / g`` in its weight makes up for
the choice: the particles still stand for the exact posterior, whatever ``g > 0``.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array
from ....models.uwb import at_height, device_position, distance


def propose_bias(
    centre: Array,
    height: Array,
    length: Array,
    angle: Array,
    pick: Array,
    anchors: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    floor: float,
    los: float,
) -> tuple[Array, Array, Array]:
    """Length (N,), angle (N,) and log weight correction (N,) of the biases that are kept.

    ``centre`` (2, N), ``height`` (N,), candidates ``length`` (K, N) [m] and ``angle`` (K, N) [rad],
    ``pick`` (N,) uniform; active links ``rx`` (L,), ``offset`` (L + 1,) into ``z`` (M,) and
    ``variance`` (M,), ``shift`` and ``doubt`` as in :mod:`.link_likelihood`. ``g`` is the product
    over ranges of ``floor + los f_LOS``, both in 1/m.
    """
    device = at_height(device_position(centre.T, length, angle), height)
    g = np.ones(length.shape)
    for e, j in enumerate(rx):
        h, loose = distance(device, anchors[j]), 0.0
        if len(shift):
            h, loose = h + shift[e], doubt[e]
        for l in range(offset[e], offset[e + 1]):
            v = variance[l] + loose
            t = (z[l] - h) ** 2 / (2 * v)
            g *= 1 + los / floor / np.sqrt(2 * np.pi * v) * np.exp(-t) * (t < 32)
    total = np.cumsum(g, axis=0)
    k = (total[:-1] < pick * total[-1]).sum(0)
    n = np.arange(len(pick))
    return length[k, n], angle[k, n], np.log(total[-1] / len(g) / g[k, n])
