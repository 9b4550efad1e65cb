"""The bound against simulated measurements and against an independent prototype's figures."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
import yaml

from echoset.metrics.bounds import paths, pcrlb, pcrlb_star
from echoset.metrics.bounds.information import intensity
from echoset.models.parameters import resolve
from echoset.models.scatter import unit_square_nodes
from echoset.simulate import uwb

RUNS = 20_000


@pytest.mark.verification
@pytest.mark.parametrize("tx", [(6.5, 0.0), None], ids=["passive", "active"])
def test_information_is_the_covariance_of_the_score(tx: tuple[float, float] | None) -> None:
    """Poisson counts, positions drawn path by path; tolerance 4.5 standard errors of 20,000 runs.

    The score of a run is ``sum_l grad log lambda(z_l) - int grad lambda``, its mean zero.
    """
    rng = np.random.default_rng(11)
    y, rx = np.array([2.3, 1.7, 0.4, -0.2, 0.32, -1.0, 0.3, 0.2, 0.1]), np.array([4.0, 4.5])
    params = pcrlb.Params()
    h, G = paths.scattered(y, None if tx is None else np.array(tx), rx, params.opening_angle)
    weight = params.mean_scatter * paths.nodes()[2]
    if tx is None:
        los, los_y = paths.direct(y, rx)
        h, G, weight = np.append(h, los), np.vstack([G, los_y]), np.append(weight, 1.0)
    std = 299_792_458.0 / (np.sqrt(8) * np.pi * params.rms_bandwidth * 10**1.5 / h)

    signal, clutter = rng.poisson(weight.sum(), RUNS), rng.poisson(params.mean_clutter, RUNS)
    path = rng.choice(len(h), signal.sum(), p=weight / weight.sum())
    z = np.append(
        h[path] + std[path] * rng.normal(size=len(path)),
        rng.uniform(0, params.max_range, clutter.sum()),
    )
    run = np.append(np.repeat(np.arange(RUNS), signal), np.repeat(np.arange(RUNS), clutter))

    def log_gradient(z: np.ndarray) -> np.ndarray:
        x = (z[:, None] - h) / std
        peak = weight * np.exp(-0.5 * x**2) / (np.sqrt(2 * np.pi) * std)
        rate = intensity(z, h, std, weight, params.mean_clutter / params.max_range)
        return (peak * x / std) @ G / rate[:, None]

    score = np.zeros((RUNS, len(y)))
    for part in np.array_split(np.arange(len(z)), 200):
        np.add.at(score, run[part], log_gradient(z[part]))
    J = pcrlb.link_information(tuple(y.tolist()), tx, tuple(rx.tolist()), params)
    products = score[:, :, None] * score[:, None, :]
    stderr = products.std(axis=0) / np.sqrt(RUNS)
    assert (np.abs(score.mean(0)) <= 4.5 * score.std(0) / np.sqrt(RUNS)).all()
    assert (np.abs(products.mean(0) - J) <= 4.5 * stderr + 1e-12).all()


@pytest.mark.verification
def test_bounds_of_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """Root mean squares over segments of a prototype's table, which has three digits.

    Near an anchor (131-180) its 0.025 is what a lattice of 100 scatterers gives; the integral is
    0.028.
    """
    text = (files("echoset.simulate") / "scenarios" / "uwb-olos.yaml").read_text()
    scene = resolve(uwb.Params, ("uwb-olos", yaml.safe_load(text)["parameters"]))
    recording = uwb.simulate(scene, np.random.default_rng(1), "uwb-olos-s1-0000")

    def bound(metric: object) -> np.ndarray:
        scores = metric.score(None, recording, pcrlb.Params())  # type: ignore[attr-defined]
        mine = [i for i, p in enumerate(scores.part) if p == "device"]
        mine = [i for i in mine if not scores.metric[i].endswith("valid")]
        return scores.value[mine][~np.isnan(scores.time[mine])]

    def segment(values: np.ndarray, first: int, last: int) -> float:
        return round(float(np.sqrt(np.mean(values[first - 1 : last] ** 2))), 3)

    steps = ((11, 30), (31, 60), (61, 80), (81, 110), (111, 130), (131, 180))
    plain, star = bound(pcrlb), bound(pcrlb_star)
    table = [0.030, 0.744, 0.094, 0.042, 0.613, 0.028]
    assert [segment(plain, *s) for s in steps] == table
    assert round(float(plain[10:].mean()), 3) == 0.223
    assert [segment(star, *s) for s in steps] == [0.030, 0.030, 0.028, 0.031, 0.029, 0.028]

    u, t = unit_square_nodes(100)
    monkeypatch.setattr(paths, "nodes", lambda: (u, t, np.full(100, 0.01)))
    pcrlb.link_information.cache_clear()
    coarse = bound(pcrlb_star)
    pcrlb.link_information.cache_clear()
    assert segment(coarse, 131, 180) == 0.025
    assert round(float(coarse[10:].mean()), 3) == 0.028
