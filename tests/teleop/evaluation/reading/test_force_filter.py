"""A force filter that the header of a file states is compensated, or reported."""

import json
import math

import numpy as np
import pytest
from scipy.signal import bessel, butter, freqs, lfilter

from teleop.cli import main
from teleop.evaluation.formats.table import stated_filter
from teleop.evaluation.reading.force_filter import advanced, stated_delay
from teleop.evaluation.reading.signals import Signals, periods

K, B = 1.0e6, 20000.0
FINE, RATE = 10_000.0, 100.0


def mach1(tmp_path, frequency: float, filter_: str) -> str:
    """Write a sinusoid, measured through a third-order filter of 20 Hz, as a Mach-1 does."""
    t = np.arange(round(10.0 * FINE)) / FINE
    omega = 2.0 * np.pi * frequency
    x = 47e-6 * np.sin(omega * t)
    f = 150.0 + K * x + B * 47e-6 * omega * np.cos(omega * t)
    f = lfilter(*butter(3, 20.0, fs=FINE), f - 150.0) + 150.0
    f += np.random.default_rng(0).normal(0.0, 0.05, len(f))
    every = slice(round(FINE), None, round(FINE / RATE))
    rows = zip(t[every] - t[every][0], x[every] * 1e3 + 1.9, f[every], strict=True)
    text = (
        f"<Mach-1 File>\n<INFO>\nLoad cell:\t25 kg\t{filter_}\n<END INFO>\n\n<Sinusoid>\n<DATA>\n"
        "Time, s\tPosition (z), mm\tFz, N\n"
        + "".join(f"{a:.4f}\t{b:.6f}\t{c:.5f}\n" for a, b, c in rows)
        + "<END DATA>\n"
    )
    path = tmp_path / "sinusoid.txt"
    path.write_text(text)
    return str(path)


def result(capsys, *arguments: str) -> dict:
    assert main(["estimate", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)["result"]


@pytest.mark.parametrize("frequency", [0.5, 1.0, 2.0])
def test_b_is_right_with_the_stated_filter_and_biased_without(tmp_path, capsys, frequency):
    path = mach1(tmp_path, frequency, "Force filter: third-order 20 Hz low-pass")
    found = result(capsys, path)
    assert found["k"] == pytest.approx(K, rel=2e-3)
    assert found["b"] == pytest.approx(B, rel=0.05)
    assert any("advanced by 15.9 ms" in reason for reason in found["reasons"])
    (lag,) = (reason for reason in found["reasons"] if "is not known" in reason)
    assert lag.startswith("a lag of the force besides that of its filter is not known")
    without = result(capsys, path, "--force-lag", "0")
    assert without["b"] == pytest.approx(B - K * 0.0159, rel=0.1)
    assert not any("filter" in reason for reason in without["reasons"])


def test_a_filter_of_unknown_delay_is_a_remark(tmp_path, capsys):
    path = mach1(tmp_path, 1.0, "Force filter: 20 Hz")
    assert any("whose delay is not known" in reason for reason in result(capsys, path)["reasons"])


@pytest.mark.parametrize("order", range(1, 7))
def test_the_delay_is_that_of_a_butterworth_filter(order):
    b, a = butter(order, 2.0 * np.pi * 20.0, analog=True)
    low = 2.0 * np.pi * 0.01
    _, response = freqs(b, a, [low])
    found = stated_delay(f"Filter: Butterworth, order {order}, 20 Hz")
    assert found == pytest.approx(-float(np.angle(response[0])) / low, rel=1e-4)


@pytest.mark.parametrize(
    "text",
    [
        "third-order 20 Hz low-pass",
        "3rd order, 20 Hz",
        "Filter 3. Ordnung 20 Hz",
        "low-pass 0,02 kHz 3-pole",
        "3rd-order 0.02 kHz filter",
    ],
)
def test_a_description_is_understood(text):
    assert stated_delay(text) == pytest.approx(2.0 / (2.0 * math.pi * 20.0))


@pytest.mark.parametrize(
    "text",
    ["20 Hz", "third-order", "third-order notch 50 Hz", "4th order 10 Hz to 20 Hz", "order 0 5 Hz"],
)
def test_no_delay_is_guessed(text):
    assert stated_delay(text) is None


def test_a_bessel_filter_is_not_taken_for_a_butterworth_filter():
    b, a = bessel(3, 2.0 * np.pi * 20.0, analog=True, norm="mag")
    assert stated_delay("third-order 20 Hz Bessel") is None
    assert np.angle(freqs(b, a, [1.0])[1][0]) > -0.9 * stated_delay("third-order 20 Hz")


def test_a_filter_without_phase_needs_no_compensation():
    assert stated_delay("Zero-phase third-order 20 Hz") == 0.0


def test_the_force_is_advanced_within_each_piece_between_gaps():
    t = np.concatenate([np.arange(50) * 0.01, 2.0 + np.arange(50) * 0.01])
    f = np.sin(10.0 * (t - 0.016))
    signals = Signals(t, t, f, periods(t), "position", (50,))
    moved = advanced(signals, 0.016)
    np.testing.assert_allclose(moved.f, np.sin(10.0 * moved.t), atol=1e-5)
    assert moved.t[-1] <= t[-1] - 0.016
    assert [moved.t[i] for i in moved.gaps] == [2.0]


def test_order_and_cutoff_can_be_stated_in_two_lines():
    lines = [
        "Load Cell Low-pass filter:\tYes",
        "Load Cell Low-pass filter Order:\t3",
        "Load Cell Low-pass filter Cutoff frequency (Hz):\t20.00",
        "Position Low-pass filter Order:\t1",
    ]
    stated = stated_filter(lines)
    assert stated_delay(stated) == pytest.approx(2.0 / (2.0 * math.pi * 20.0))
    assert stated_delay(stated_filter(lines[2:])) is None
