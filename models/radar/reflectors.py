"""Points that a pedestrian or a vehicle reflects from, and from where each of them is seen.

A vehicle has twelve (Table I of E. Favarelli et al., "Multi-base station cooperative sensing with
AI-aided tracking"): four surfaces, four wheelhouses and four corners. Each has a visibility over
the direction of sight about its own axis, after M. Buehren and B. Yang, "Simulation of automotive
radar target lists using a novel approach of object representation", IEEE Intell. Veh. Symp. 2006;
here a trapezium: one up to an inner angle, none beyond an outer one (the angles are choices).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Reflectors:
    """Points in the object's frame, x forward: ``position`` (n, 2) [m], mean ``rcs`` (n,) [m2],
    and ``axis``, ``inner``, ``outer`` (n,) [rad] of their visibility."""

    position: Array
    rcs: Array
    axis: Array
    inner: Array
    outer: Array


def pedestrian(rcs: float) -> Reflectors:
    """One point that is seen from everywhere, from straight behind too."""
    zero, pi = np.zeros(1), np.full(1, np.pi)
    return Reflectors(np.zeros((1, 2)), np.full(1, rcs), zero, pi, 2 * pi)


def vehicle(
    length: float,
    width: float,
    rcs: tuple[float, float, float],
    narrow: tuple[float, float],
    wheel: tuple[float, float],
    corner: tuple[float, float],
) -> Reflectors:
    """Surfaces (front, left, rear, right), wheelhouses and corners with mean ``rcs`` [m2] each.

    ``narrow``, ``wheel`` and ``corner`` are the inner and outer angles [rad] of their visibility.
    """
    a, b = length / 2, width / 2
    side = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    position = np.vstack(
        ([[a, 0], [0, b], [-a, 0], [0, -b]], side * [0.6 * a, b], side * [a, b])
    ).astype(float)
    quarter = np.pi / 2
    normals = np.array([0.0, 1.0, 2.0, 3.0]) * quarter
    flanks = np.array([1.0, 1.0, -1.0, -1.0]) * quarter
    diagonals = (np.array([0.0, 1.0, 2.0, 3.0]) + 0.5) * quarter
    inner, outer = np.repeat(np.array([narrow, wheel, corner]), 4, axis=0).T
    axis = np.concatenate((normals, flanks, diagonals))
    return Reflectors(position, np.repeat(rcs, 4), axis, inner, outer)


def visibility(reflectors: Reflectors, direction: Array) -> Array:
    """Share (..., n) of the reflectors' mean power seen from ``direction`` (...) [rad].

    The direction is that of the observer in the object's frame.
    """
    off = np.asarray(direction)[..., None] - reflectors.axis
    off = np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi)))
    ramp = np.maximum(reflectors.outer - reflectors.inner, 1e-12)
    return np.asarray(np.clip((reflectors.outer - off) / ramp, 0.0, 1.0))
