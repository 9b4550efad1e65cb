"""The posterior of a doubly inhomogeneous generalised shot noise Cox process, and jump moves on it.

Targets C = (c, E) send detections to the sensor state k with the mean rho_k(C) and the density
N(z; c, Sigma_k(c) + E E^T) around them; clutter has the intensity lambda_c, centres are a Gibbs
hard-core process of intensity lambda, extents are uniform in a box. Clutter beyond D has the
intensity b lambda_c, and counts for nothing else. With b_km = 1 for detections in D and b beyond,
eta_km(C) = rho_k(C) N(z_km; c, Sigma_k(c) + E E^T) / b_km and Z_km = lambda_c + sum_l eta_km(C_l),

    log posterior = sum_k [(1 - lambda_c) |D| - sum_l rho_k(C_l) + sum_m log b_km Z_km]
                    + L log lambda + L log pi_E

if the centres lie in D and at least R apart and the extents in their box. A problem in the plane
is one in space whose third axis is exact, see :mod:`..plane`: D is flat there.

The functions here define the moves and compute everything anew for each; the twins in
:mod:`.compiled.posterior` keep Z running and give the same chain for the same random numbers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....models.geometry import extent
from ....models.geometry.grids import Grid
from ....models.radar.ofdm import resolved
from ....models.records import Array

POSITION, EXTENT, BIRTH, DEATH, RELOCATE, JUMP = range(6)
KINDS = ("position", "extent", "birth", "death", "relocation", "jump")
"""Moves; ``jump`` is the paper's: a birth or a death by their total rates."""
MAX_GATE = 100.0
"""Largest squared Mahalanobis distance that a gate may have."""
FLOOR = 0.1
"""Where an element of an extent is nearer to zero [m], the paper's steps are those of this one:
steps that are only proportional would linger at zero."""
LEAST = 0.1
"""Least mean number of targets, and of false detections a scan, that intensities amount to."""
NODES = 2000
"""Nodes, about, that tell how much of D is left for another target."""
UNIFORMS, NORMALS = 14, 6
"""Random numbers that one move is given."""
KIND, TARGET, ACCEPT, SEED, ANYWHERE, PLACE, EXTENTS = 0, 1, 2, 3, 4, 5, 8
BALL, DEPTH = PLACE, PLACE + 1
"""What the uniform ones decide: the kind; the target, or for a jump birth or death; acceptance; the
detection that a birth is near, or for a jump who dies; whether it is anywhere; from PLACE on three
for where, or for a jump the BALL of the table and the DEPTH in it; from EXTENTS on six for the
extent. The normal ones make steps."""


class Scene(NamedTuple):
    """Detections, sensor states and prior: what is fixed while a chain runs.

    Detections z (3, M) [m] in the map frame, by sensor state and then along x; those of state k
    are ``offset[k]:offset[k + 1]``. ``table`` (K, nx, ny, nz, 7) holds p_D and the covariance xx xy
    xz yy yz zz at the nodes ``origin + i spacing``, ``outside`` (7,) beyond. ``position`` (K, 3)
    and ``frame`` (K, 3, 3) take points to the array's axes, for which ``cell`` (K, 5) holds the
    arguments of ``resolved`` in ``models/radar/ofdm``; the first is 0 where the last is r itself.
    Centres lie in [lower, upper] (3,), ``radius`` apart, extents in [e_lower, e_upper] (6,).
    Detections with a squared Mahalanobis distance above ``gate`` have eta = 0. ``beyond`` (M,) is
    the intensity of clutter at the detections relative to that in D, the b_km above. Births look
    where ``weight`` (M,) is high, ``spread`` [m] around detections, or anywhere with probability
    ``uniform``; ``informed`` steps shrink with the number of detections, others are the paper's.
    """

    z: Array
    offset: Array
    table: Array
    origin: Array
    spacing: Array
    outside: Array
    position: Array
    frame: Array
    cell: Array
    lower: Array
    upper: Array
    e_lower: Array
    e_upper: Array
    radius: float
    p_false: float
    gate: float
    beyond: Array
    weight: Array
    spread: float
    uniform: float
    informed: bool


class State(NamedTuple):
    """A configuration of L targets, in arrays with room for more; moves change it in place.

    ``size`` (1,) is L; centres c (n, 3), extents e (n, 6), the detections expected rho (n,), the
    precision A (n, 3, 3) of position steps, eta (n, M) with its non-zero range ``first`` and
    ``last`` (n, K), and ``shot`` (M,), its sum over the targets.
    """

    size: Array
    c: Array
    e: Array
    rho: Array
    A: Array
    eta: Array
    first: Array
    last: Array
    shot: Array


class Births(NamedTuple):
    """The paper's birth table: ``points`` (J, 3), weights that sum to one, ``radius`` of the balls
    around them, and the logarithm of the total birth rate."""

    points: Array
    weight: Array
    radius: float
    log_total: float


def empty(scene: Scene, room: int) -> State:
    """The configuration without targets, and with room for that many."""
    K, M = len(scene.offset) - 1, len(scene.weight)
    return State(
        np.zeros(1, np.int64),
        np.zeros((room, 3)),
        np.zeros((room, 6)),
        np.zeros(room),
        np.zeros((room, 3, 3)),
        np.zeros((room, M)),
        np.zeros((room, K), np.int64),
        np.zeros((room, K), np.int64),
        np.zeros(M),
    )


def free(lower: Array, upper: Array) -> tuple[Array, float]:
    """Axes along which a box extends, and its volume over them."""
    open_ = upper > lower
    return open_, float(np.prod((upper - lower)[open_]))


def sensor(scene: Scene, c: Array) -> tuple[Array, Array, Array]:
    """p_D (L, K), covariance (L, K, 3, 3) and resolution (L, K) at centres c (L, 3)."""
    K = len(scene.table)
    grid = Grid(scene.origin, scene.spacing, scene.table.shape[1:4])
    value = grid.interpolate(np.moveaxis(scene.table, 0, 3), c, np.tile(scene.outside, (K, 1)))
    row, column = np.triu_indices(3)
    S = np.zeros((len(c), K, 3, 3))
    S[..., row, column] = S[..., column, row] = value[..., 1:]
    q = np.einsum("kij,lkj->lki", scene.frame, c[:, None] - scene.position)
    r = np.tile(scene.cell[:, 4], (len(c), 1))
    told = scene.cell[:, 0] > 0
    r[:, told] = resolved(q[:, told], *scene.cell[told].T)
    return value[..., 0], S, r


def columns(scene: Scene, c: Array, e: Array) -> tuple[Array, Array, Array]:
    """rho (L, K), eta (L, M) and the precision A (L, 3, 3) of targets c (L, 3), e (L, 6).

    Along an axis on which D is flat, where nothing moves, A is one.
    """
    p, S, r = sensor(scene, c)
    rho = np.maximum(scene.p_false, p) * np.maximum(1.0, extent.volume(e)[:, None] * r)
    S = S + extent.covariance(e)[:, None]
    eta = np.zeros((len(c), scene.z.shape[1]))
    for k, (a, b) in enumerate(zip(scene.offset[:-1], scene.offset[1:], strict=True)):
        x = scene.z[:, a:b].T - c[:, None]
        d2 = np.einsum("lmi,lij,lmj->lm", x, np.linalg.inv(S[:, k]), x)
        peak = rho[:, k] / np.sqrt(np.linalg.det(2 * np.pi * S[:, k]))
        eta[:, a:b] = np.where(d2 <= scene.gate, peak[:, None] * np.exp(-d2 / 2), 0.0)
    eta /= scene.beyond
    w = rho if scene.informed else np.ones_like(rho)
    A = np.einsum("lk,lkij->lij", w, np.linalg.inv(S))
    closed = ~free(scene.lower, scene.upper)[0]
    A[:, closed], A[:, :, closed] = 0.0, 0.0
    A[:, closed, closed] = 1.0
    return rho, eta, A


def feasible(scene: Scene, c: Array, e: Array) -> bool:
    """Whether the prior of targets c (L, 3), e (L, 6) is positive."""
    inside = (c >= scene.lower) & (c <= scene.upper)
    box = (e >= scene.e_lower) & (e <= scene.e_upper)
    gap = np.linalg.norm(c[:, None] - c, axis=-1) + np.diag(np.full(len(c), np.inf))
    return bool(inside.all() and box.all() and (gap >= scene.radius).all())


def log_posterior(scene: Scene, c: Array, e: Array, intensity: Array) -> float:
    """The logarithm of the posterior, with intensity = (lambda, lambda_c) [m-3]."""
    if not feasible(scene, c, e):
        return -np.inf
    rho, eta, _ = columns(scene, c, e)
    K, D = rho.shape[1], free(scene.lower, scene.upper)[1]
    Z = scene.beyond * (intensity[1] + eta.sum(0))
    likelihood = K * (1 - intensity[1]) * D - rho.sum() + np.log(Z).sum()
    prior = np.log(intensity[0]) - np.log(free(scene.e_lower, scene.e_upper)[1])
    return float(likelihood + len(c) * prior)


def inside(z: Array, lower: Array, upper: Array) -> Array:
    """Which of the points z (n, 3) lie in a box."""
    return np.asarray(((z >= lower) & (z <= upper)).all(1))


def intensities(scene: Scene, L: int, rho: float, clutter: Array, volume: float) -> Array:
    """Intensities (lambda, lambda_c) if L targets expect rho detections and ``clutter`` (M,) are
    the false ones, of which those in D tell lambda_c.

    The model intensities update of section 4, where ``volume`` is all of D. That is a hard-core
    process' number per volume, less than its lambda where targets leave each other little room:
    over :func:`room` it is lambda (Besag's pseudo-likelihood). The least are numbers in the region.
    """
    K, M, D = len(scene.offset) - 1, len(scene.weight), free(scene.lower, scene.upper)[1]
    targets = L * (M - clutter.sum()) / (max(volume, LEAST * D) * rho) if L else 0.0
    false = (clutter & inside(scene.z.T, scene.lower, scene.upper)).sum()
    return np.maximum(LEAST / D, [targets, false / (max(K, 1) * D)])


def room(scene: Scene, c: Array) -> float:
    """Volume of D that is not within the hard core of a target at c (L, 3)."""
    open_, D = free(scene.lower, scene.upper)
    size = np.where(open_, scene.upper - scene.lower, 1.0)
    side = (D / NODES) ** (1 / open_.sum())
    shape = np.where(open_, np.maximum(np.ceil(size / side), 1), 1).astype(int)
    index = np.moveaxis(np.indices(tuple(shape.tolist())), 0, -1).reshape(-1, 3)
    nodes = np.where(open_, scene.lower + (index + 0.5) * size / shape, scene.lower)
    gap = np.linalg.norm(nodes[:, None] - c, axis=-1).min(1, initial=np.inf)
    return D * float((gap >= scene.radius).mean())


def refresh(scene: Scene, state: State) -> None:
    """Compute all that follows from size, c and e."""
    L = state.size[0]
    rho, eta, A = columns(scene, state.c[:L], state.e[:L])
    state.rho[:L], state.A[:L] = rho.sum(1), A
    state.eta[:] = 0.0
    state.eta[:L] = eta
    state.first[:], state.last[:] = scene.offset[:-1], scene.offset[1:]
    state.shot[:] = eta.sum(0)
