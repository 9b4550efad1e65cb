"""The bound against the Kalman filter, closed forms and finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.eopda import ideal
from echoset.metrics.bounds import paths, pcrlb, pcrlb_star
from echoset.metrics.bounds.information import covariance_bounds, information, intensity
from echoset.models.errors import InputError, ParameterError
from echoset.models.parameters import resolve, sensor_model
from echoset.models.records import Recording, Scores
from echoset.simulate import uwb

Y = np.array([2.3, 1.7, 0.4, -0.2, 0.32, -1.0, 0.3, 0.2, 0.1])
RX, TX = np.array([4.0, 4.5]), np.array([6.5, 0.0])
OPENING = 2 * np.pi / 3


def pick(scores: Scores, metric: str, part: str) -> np.ndarray:
    """The values per time."""
    keys = zip(scores.metric, scores.part, scores.time, scores.value, strict=True)
    return np.array([v for m, p, t, v in keys if (m, p) == (metric, part) and t == t])


def differences(f, y: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Central differences of ``f`` in ``y``, the last axis."""
    return np.stack([(f(y + e) - f(y - e)) / (2 * step) for e in step * np.eye(len(y))], -1)


def test_linear_gaussian_is_kalman() -> None:
    rng = np.random.default_rng(1)
    d, n = 4, 30
    F = np.eye(d) + 0.1 * rng.normal(size=(n, d, d))
    B, H = rng.normal(size=(n, d, 2)), rng.normal(size=(n, 2, d))
    Q, R = B @ B.swapaxes(1, 2), np.diag([0.3, 0.7])
    bound = covariance_bounds(np.eye(d), F, Q, H.swapaxes(1, 2) @ np.linalg.solve(R, H))
    P = np.eye(d)
    for k in range(n):
        P = F[k] @ P @ F[k].T + Q[k]
        K = P @ H[k].T @ np.linalg.inv(H[k] @ P @ H[k].T + R)
        P = (np.eye(d) - K @ H[k]) @ P @ (np.eye(d) - K @ H[k]).T + K @ R @ K.T
        np.testing.assert_allclose(bound[k], P, rtol=0, atol=1e-9 * np.abs(P).max())


def test_one_path_without_clutter_is_a_gaussian_count() -> None:
    gradient = np.array([[0.6, -0.8]])
    J = information(np.array([3.0]), np.array([0.05]), np.array([2.5]), gradient, 0.0)
    np.testing.assert_allclose(J, 2.5 / 0.05**2 * gradient.T @ gradient, rtol=1e-10)


def test_clutter_takes_information_away() -> None:
    args = np.array([3.0]), np.array([0.05]), np.array([1.0]), np.ones((1, 1))
    values = [information(*args, c)[0, 0] for c in (0.0, 0.25, 2.5, 1e6)]
    assert values == sorted(values, reverse=True)
    # Far above the peak the rate is the clutter's: int (lambda')^2 dz / c, by hand.
    np.testing.assert_allclose(values[-1], 1 / (4 * np.sqrt(np.pi) * 0.05**3 * 1e6), rtol=1e-4)


@pytest.mark.parametrize("tx", [TX, RX, None], ids=["bistatic", "monostatic", "device"])
def test_gradients_of_paths(tx: np.ndarray | None) -> None:
    _, G = paths.scattered(Y, tx, RX, OPENING)
    numeric = differences(lambda y: paths.scattered(y, tx, RX, OPENING)[0], Y)
    np.testing.assert_allclose(G, numeric, atol=1e-8)


def test_gradients_of_direct_path_and_device() -> None:
    _, G = paths.direct(Y, RX)
    np.testing.assert_allclose(G, differences(lambda y: paths.direct(y, RX)[0], Y), atol=1e-8)
    _, G = paths.device(Y)
    np.testing.assert_allclose(G, differences(lambda y: paths.device(y)[0], Y), atol=1e-8)


@pytest.mark.parametrize("tx", [(6.5, 0.0), None], ids=["passive", "active"])
def test_information_is_that_of_the_log_intensity(tx: tuple[float, float] | None) -> None:
    """``int lambda (grad log lambda)(grad log lambda)^T`` with gradients by finite differences."""
    params = pcrlb.Params()
    sender = None if tx is None else np.array(tx)

    def link(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        h = paths.scattered(y, sender, RX, OPENING)[0]
        weight = 5.0 * paths.nodes()[2]
        if tx is None:
            return np.append(h, paths.direct(y, RX)[0]), np.append(weight, 1.0)
        return h, weight

    h0, weight = link(Y)
    beta, u = 500e6 / np.sqrt(12), 10**1.5 / h0
    std = 299_792_458.0 / (np.sqrt(8) * np.pi * beta * u)
    z = np.linspace(h0.min() - 0.5, h0.max() + 0.5, 1500)
    score = differences(lambda y: np.log(intensity(z, link(y)[0], std, weight, 0.25)), Y, 1e-5)
    rate = intensity(z, h0, std, weight, 0.25)
    J = (z[1] - z[0]) * (score * rate[:, None]).T @ score
    exact = pcrlb.link_information(tuple(Y.tolist()), tx, tuple(RX.tolist()), params)
    np.testing.assert_allclose(exact, J, rtol=1e-6, atol=1e-6 * np.abs(J).max())


def test_prior_and_transitions_by_hand() -> None:
    # a uniform disc of radius R has the variance R^2 / 4 on each axis; one anchor is enough
    P = pcrlb.prior(np.array([[4.0, 4.5, 0.0]]), pcrlb.Params(max_range=8.0))
    np.testing.assert_allclose(P[:2, :2], 16 * np.eye(2), atol=0.01)
    np.testing.assert_allclose(
        np.diag(P)[2:] * 12, [12, 12, 0.36, 4 * np.pi**2, 0.16, 0.16, 0.0361]
    )
    F, Q = pcrlb.transitions(np.array([0.0, 0.1]), pcrlb.Params())
    np.testing.assert_array_equal(F[0], np.eye(9))
    np.testing.assert_array_equal(Q[0], 0)
    np.testing.assert_allclose(F[1] @ np.arange(9), [0.2, 1.3, 2, 3, 4, 5, 6, 7, 8])
    np.testing.assert_allclose(Q[1][:4:2, :4:2], 4 * np.array([[0.25e-4, 0.5e-3], [0.5e-3, 0.01]]))
    np.testing.assert_allclose(np.diag(Q[1])[4:], [0.01, 0.25, 0.0025, 0.0025, 0.0025])
    # two steps of half the time are one: walks by the root of time, velocity by white noise
    F, Q = pcrlb.transitions(np.array([0.0, 0.05]), pcrlb.Params())
    twice = F[1] @ Q[1] @ F[1].T + Q[1]
    whole = pcrlb.transitions(np.array([0.1]), pcrlb.Params())[1][0]
    np.testing.assert_allclose(np.diag(twice)[2:], np.diag(whole)[2:])


def test_the_bound_assumes_what_the_filter_assumes() -> None:
    """Parameters of the same name have the same default, but for what only a recording tells."""
    own, theirs = pcrlb.Params(), ideal.Params()
    shared = set(own.__dataclass_fields__) & set(theirs.__dataclass_fields__)
    assert {"acceleration_std", "bias_angle_std", "axes_prior", "width_std"} <= shared
    for name in shared - {"max_range", "rms_bandwidth", "device_height"}:
        assert getattr(own, name) == getattr(theirs, name), name


@pytest.mark.parametrize("tx", [(6.5, 0.0, 2.0), None], ids=["passive", "active"])
def test_gradients_of_slant_paths(tx: tuple[float, ...] | None) -> None:
    sender, rx = None if tx is None else np.array(tx), np.array([4.0, 4.5, 2.5])
    h, G = paths.scattered(Y, sender, rx, OPENING, 1.0)
    numeric = differences(lambda y: paths.scattered(y, sender, rx, OPENING, 1.0)[0], Y)
    np.testing.assert_allclose(G, numeric, atol=1e-8)
    q, _ = paths.scatterers(Y, rx[:2], OPENING)
    start = paths.device(Y)[0] if tx is None else np.array(tx[:2])
    up = 0.0 if tx is None else 1.0
    legs = np.hypot(np.hypot(*(q - start).T), up) + np.hypot(np.hypot(*(q - rx[:2]).T), 1.5)
    np.testing.assert_allclose(h, legs)
    d, _ = paths.direct(Y, rx, 1.0)
    np.testing.assert_allclose(d, np.hypot(np.hypot(*(paths.device(Y)[0] - rx[:2])), 1.5))


@pytest.mark.parametrize(
    "settings", [{"snr_db": 15.0}, {"device_height": 1.5}, {"width": 0.02, "mean_clutter": 20.0}]
)
def test_information_at_other_settings(settings: dict[str, float]) -> None:
    """By finite differences of the log intensity, as above."""
    params, rx = pcrlb.Params(**settings), np.array([4.0, 4.5, 2.5])  # type: ignore[arg-type]
    height, snr = params.device_height, params.snr_db

    def path(y: np.ndarray) -> np.ndarray:
        return np.append(
            paths.direct(y, rx, height)[0], paths.scattered(y, None, rx, OPENING, height)[0]
        )

    y0 = np.array([*Y[:8], params.width])
    h0, weight = path(y0), np.append(1.0, 5.0 * paths.nodes()[2])
    std = 299_792_458.0 / (np.sqrt(8) * np.pi * 500e6 / np.sqrt(12) * 10 ** (snr / 20) / h0)
    clutter = params.mean_clutter / 20.0
    z = np.linspace((h0 - 8.5 * std).min(), (h0 + 8.5 * std).max(), 1500)
    score = differences(lambda y: np.log(intensity(z, path(y), std, weight, clutter)), y0, 1e-5)
    rate = intensity(z, h0, std, weight, clutter)
    J = (z[1] - z[0]) * (score * rate[:, None]).T @ score
    exact = pcrlb.link_information(tuple(y0.tolist()), None, (4.0, 4.5, 2.5), params)
    np.testing.assert_allclose(exact, J, rtol=1e-5, atol=1e-5 * np.abs(J).max())


def test_star_has_the_blocked_links(network: Recording) -> None:
    plain = pcrlb.score(None, network, pcrlb.Params())  # type: ignore[arg-type]
    star = pcrlb_star.score(None, network, pcrlb.Params())  # type: ignore[arg-type]
    for part in ("device", "centre"):
        a, b = pick(plain, "pcrlb", part), pick(star, "pcrlb-star", part)
        np.testing.assert_allclose(a[:2], b[:2], rtol=1e-12)
        assert (a[2:] > b[2:]).all()
    free = replace(
        network,
        truth=replace(
            network.truth,
            **{
                f"blocked_{k}": np.zeros(0, t)
                for k, t in (("time_ns", int), ("tx", "i4"), ("rx", "i4"))
            },
        ),
    )
    unblocked = pcrlb_star.score(None, free, pcrlb.Params())  # type: ignore[arg-type]
    np.testing.assert_array_equal(unblocked.value, plain.value)


def test_steps_with_unknown_angle_are_marked(network: Recording) -> None:
    passive = network.streams["uwb"]
    keep = np.flatnonzero((passive.scan["mode"] == 1) | (passive.time_ns == 100_000_000))
    stream = replace(
        passive,
        time_ns=passive.time_ns[keep],
        row_offset=np.zeros(len(keep) + 1, np.int64),
        scan={k: v[keep] for k, v in passive.scan.items()},
    )
    recording = replace(network, streams={"uwb": stream})
    scores = pcrlb.score(None, recording, pcrlb.Params(bias_angle_std=0.72))  # type: ignore[arg-type]
    # The angle is found at the first step, then its sigma grows as 0.72 sqrt(k): 0.72, 1.02, ...
    np.testing.assert_array_equal(pick(scores, "pcrlb-valid", "device"), [1, 1, 0, 0, 0])


def test_window_and_lacking_truth(network: Recording) -> None:
    scores = pcrlb.score(None, network, pcrlb.Params(start=0.3, stop=0.4))  # type: ignore[arg-type]
    assert len(pick(scores, "pcrlb", "centre")) == 2
    short = replace(network.truth.objects, extent_kind="", semi_axes=None, rotation=None)
    for truth in (None, replace(network.truth, objects=short)):
        with pytest.raises(InputError):
            pcrlb.score(None, replace(network, truth=truth), pcrlb.Params())  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no event"):
        pcrlb.score(None, network, pcrlb.Params(skip=9))  # type: ignore[arg-type]
    with pytest.raises(InputError, match="streams"):
        pcrlb.score(None, replace(network, streams={}), pcrlb.Params())  # type: ignore[arg-type]
    stream = network.streams["uwb"]
    tx = np.where(stream.scan["mode"] == 0, 3 + np.arange(len(stream)) % 2, stream.scan["tx"])
    several = {"uwb": replace(stream, scan={**stream.scan, "tx": tx})}
    with pytest.raises(InputError, match="one device"):
        pcrlb.score(None, replace(network, streams=several), pcrlb.Params())  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="max_range"):
        resolve(pcrlb.Params, ("settings", {"max_range": 0.0}))


def test_offsets_of_the_recording_are_part_of_the_state() -> None:
    """Direct ranges alone, one step: the joint Gaussian of device and one offset an anchor."""
    scene = uwb.Params(steps=1, mean_scatter=0.0, mean_clutter=0.0)
    recording = uwb.simulate(scene, np.random.default_rng(1), "one")
    stream = recording.streams["uwb"]
    told = {"mean_scatter": 0.0, "mean_clutter": 1e-9, "range_bias_std": 0.3}
    recording = replace(recording, streams={"uwb": replace(stream, model=stream.model | told)})
    params = resolve(pcrlb.Params, *sensor_model(recording, pcrlb.Params))
    assert params.range_bias_std == 0.3 and params.range_bias_spread == 0.1
    found = pick(pcrlb.score(None, recording, params), "pcrlb", "device")[0]  # type: ignore[arg-type]

    anchors = np.array(scene.anchors)
    y = pcrlb.true_states(recording, np.array([100_000_000]), params)[0]
    H = np.zeros((3, 12))
    for j, a in enumerate(anchors):
        H[j, :9] = differences(lambda y, a=a: np.hypot(*(paths.device(y)[0] - a))[None], y)
        H[j, 9 + j] = 1.0
    d = np.hypot(*(paths.device(y)[0] - anchors).T)
    std = 299_792_458.0 / (np.sqrt(8) * np.pi * 500e6 / np.sqrt(12) * 10**1.5 / d)
    P0 = np.zeros((12, 12))
    P0[:9, :9] = pcrlb.prior(anchors, params)
    P0[9:, 9:] = 0.09 + 0.01 * np.eye(3)
    P = np.linalg.inv(np.linalg.inv(P0) + H.T @ np.diag(std**-2) @ H)
    G = differences(lambda y: paths.device(y)[0], y)
    assert found == pytest.approx(np.sqrt(np.trace(G @ P[:9, :9] @ G.T)), rel=1e-4)
    calibrated = replace(params, range_bias_std=0.0)
    less = pick(pcrlb.score(None, recording, calibrated), "pcrlb", "device")[0]  # type: ignore[arg-type]
    assert less < 0.5 * found
