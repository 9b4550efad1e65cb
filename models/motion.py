"""Motion models."""

from __future__ import annotations

from typing import Any

import numpy as np

from .records import Array


def constant_velocity(dt: float) -> tuple[Array, Array]:
    """Transition ``F`` (4, 4) and noise gain ``G`` (4, 2) of constant velocity in the plane.

    The state is x y vx vy [m, m/s]; the acceleration is white and constant over each step of
    ``dt`` [s], so the process noise is ``sigma_a^2 G G^T``. Bar-Shalom, Li and Kirubarajan,
    "Estimation with Applications to Tracking and Navigation", section 6.3.2.
    """
    I, O = np.eye(2), np.zeros((2, 2))
    F = np.block([[I, dt * I], [O, I]])
    G = np.vstack((dt**2 / 2 * I, dt * I))
    return F, G


def white_acceleration(dt: float) -> Array:
    """Covariance (4, 4) that white acceleration of density 1 m^2 s^-3 adds in ``dt`` [s].

    Acceleration is white in continuous time, so that two steps add what one of their length adds.
    Bar-Shalom, Li and Kirubarajan, section 6.2.2.
    """
    I = np.eye(2)
    return np.block([[dt**3 / 3 * I, dt**2 / 2 * I], [dt**2 / 2 * I, dt * I]])


def coordinated_turn(dt: float, rate: float) -> Array:
    """Transition (4, 4) of x y vx vy over ``dt`` [s] with the velocity turning by ``rate`` [rad/s].

    Bar-Shalom, Li and Kirubarajan, section 11.7.1; that of constant velocity where it is 0.
    """
    angle = rate * dt
    # sin(a) / w and (1 - cos(a)) / w, both exact for small angles.
    along = dt * np.sinc(angle / np.pi)
    across = dt * np.sin(angle / 2) * np.sinc(angle / 2 / np.pi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    way = np.array([[along, -across], [across, along]])
    return np.block([[np.eye(2), way], [np.zeros((2, 2)), turn]])


def constant_acceleration(dt: float, density: float) -> tuple[Array, Array]:
    """Transition (6, 6) and noise of x y vx vy ax ay over ``dt`` [s], with white jerk.

    Its density is in m^2 s^-5. Bar-Shalom, Li and Kirubarajan, section 6.2.3.
    """
    F = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    Q = np.array(
        [
            [dt**5 / 20, dt**4 / 8, dt**3 / 6],
            [dt**4 / 8, dt**3 / 3, dt**2 / 2],
            [dt**3 / 6, dt**2 / 2, dt],
        ]
    )
    return np.kron(F, np.eye(2)), density * np.kron(Q, np.eye(2))


def random_walk(dt: float, diffusion: float) -> tuple[Array, Array]:
    """Transition (4, 4) and noise of what stands: x and y gain ``diffusion`` [m^2/s], and no speed.

    Its velocity is that of the step, about 0 whatever it was before.
    """
    speed = max(diffusion / dt if dt > 0 else 0.0, LEAST_SPEED**2)
    Q = np.diag([diffusion * dt, diffusion * dt, speed, speed])
    return np.diag([1.0, 1.0, 0.0, 0.0]), Q


def backwards(F: Array) -> Array:
    """The way back of a transition F (dx, dx): what it leaves of the state, zero for the rest."""
    inverse = np.linalg.inv if np.linalg.det(F) else np.linalg.pinv
    return np.asarray(inverse(F))


LEAST_SPEED = 1e-3
"""Deviation [m/s] of the velocity of what stands, at least."""
STEP = 0.1
"""Time [s] to which the standard deviations of a device's motion and random walks refer."""


def acceleration_variance(std: float, dt: float) -> float:
    """Variance over ``dt`` [s] of an acceleration with ``std`` per step of 0.1 s.

    A velocity gains the same variance in any number of steps.
    """
    return std**2 * STEP / dt if dt > 0 else 0.0


def motion_noise(std: float, dt: float) -> Array:
    """Covariance (4, 4) that x y vx vy gain over ``dt`` [s]."""
    _, G = constant_velocity(dt)
    return np.asarray(acceleration_variance(std, dt) * G @ G.T)


def walk_std(std: Any, dt: float) -> Any:
    """Standard deviation of a random walk over ``dt`` [s] from its ``std`` per step of 0.1 s."""
    return std * np.sqrt(dt / STEP)
