"""The base station's budget, beams and capacity against numbers by hand."""

import numpy as np
import pytest

from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.models.radar.multibeam import (
    BaseStation,
    Echoes,
    beamformer,
    capacity,
    echo_amplitudes,
    frequencies,
    path_gain,
    steering,
)

STATION = BaseStation()


def test_axes_are_those_of_the_paper() -> None:
    assert len(STATION.azimuth_axis) == 51
    assert np.degrees(STATION.azimuth_axis[[0, 25, -1]]) == pytest.approx([-60, 0, 60])
    assert STATION.range_bin == pytest.approx(0.3943, abs=1e-4)
    assert STATION.range_axis[-1] <= 85 < STATION.range_axis[-1] + STATION.range_bin


def test_a_pedestrian_at_50_m_has_35_dB() -> None:
    # 0.3 W EIRP, (c / 28 GHz)^2 / (4 pi)^3 / 50^4, noise 4e-20 x 380.16 MHz, 50 x 3168 x 112.
    wavelength = 299792458 / 28e9
    by_hand = 0.3 * wavelength**2 / (4 * np.pi) ** 3 / 50**4 / (4e-20 * 380.16e6) * 50 * 3168 * 112
    beta = path_gain(STATION, np.array([50.0]), np.array([1.0]))
    echo = Echoes(np.array([50.0]), np.zeros(1), np.zeros(1), beta.astype(complex))
    away = np.arcsin(2 * 7 / 50)  # a null of the communication beam
    a = echo_amplitudes(STATION, echo, away)[25, 0]
    assert np.abs(a) ** 2 * 3168 * 112 == pytest.approx(by_hand, rel=1e-12)
    assert 10 * np.log10(by_hand) == pytest.approx(35.1, abs=0.1)


def test_beams_share_the_power() -> None:
    w = beamformer(STATION, 0.0, np.arcsin(0.4))  # mutual nulls
    towards = steering(50, np.array([0.0, np.arcsin(0.4)]))
    assert np.abs(towards @ w) ** 2 == pytest.approx([0.3, 0.7])


def test_frequencies_in_bins() -> None:
    e = Echoes(np.array([10.0]), np.zeros(1), np.array([3.0]), np.ones(1, complex))
    delay, doppler = frequencies(STATION, e)
    assert delay == pytest.approx(2 * 10 / 299792458 * 3168 * 120e3)
    assert doppler == pytest.approx(-2 * 3 * 28e9 / 299792458 * 112 * (1 / 120e3 + 0.586e-6))


def test_capacity_at_the_published_points() -> None:
    snr = 10**0.81
    found = [capacity(STATION, n, 6, snr) / 1e9 for n in (0, 3, 6)]
    assert found == pytest.approx([1.101, 1.018, 0.935], abs=2e-3)


@pytest.mark.parametrize(
    ("name", "value"), [("max_range", 1e6), ("symbols", 0), ("sensing_power", 1.2), ("aperture", 2)]
)
def test_impossible_parameters(name: str, value: float) -> None:
    with pytest.raises(ParameterError, match=name):
        resolve(BaseStation, ("", {name: value}))
