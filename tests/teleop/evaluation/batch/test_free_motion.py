"""A record without contact: no estimates, no parameters, and figures that say why."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from teleop.cli import main
from teleop.evaluation.batch.analysis import motion_of
from teleop.evaluation.batch.contact_phases import find_phases
from teleop.evaluation.batch.smoothed_record import smoothed_signals
from teleop.evaluation.evaluate import evaluate
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.settings import EstimateSettings
from teleop.output.fit_figures import fit_figure

T = np.arange(0.0, 8.0, 4e-3)
NOISE = np.random.default_rng(0).normal(0.0, 0.02, T.size)


def signals(frequency=1.0, amplitude=3e-3, k=0.0):
    x = 3e-3 - amplitude * np.cos(2.0 * np.pi * frequency * T)
    return Signals(T, x, k * x + NOISE, np.full(T.size, 4e-3), "position")


def evaluation(estimators=None, k=0.0):
    return evaluate(signals(k=k), EstimateSettings(estimators=estimators))


@pytest.fixture
def path(tmp_path):
    data = signals()
    rows = (f"{t},{x},{f}\n" for t, x, f in zip(data.t, data.x * 1e3, data.f, strict=True))
    file = tmp_path / "free.csv"
    file.write_text("Time [s],Position [mm],Force [N]\n" + "".join(rows))
    return str(file)


def test_no_estimate_has_a_value_and_no_model_has_parameters(path, capsys):
    assert main(["estimate", path, "--estimators", "rls,me,hc_log", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert not document["result"]["identifiable"]
    assert document["models"] == []
    assert document["least_squares"]["k"] is None
    for row in document["estimates"].values():
        values = [row[name] for name in ("k", "b", "k_end", "b_end", "misfit", "note")]
        assert values == [None] * 6
        assert set(row["further"].values()) <= {None}


def test_the_tables_have_dashes_and_the_reason(path, capsys):
    assert main(["estimate", path, "--estimators", "rls,me,hc_log", "--details"]) == 0
    out = capsys.readouterr().out
    assert "no contact" in out
    assert "batch models: none is fitted" in out
    for name in ("rls", "me", "hc_log"):
        at_end, compared, averages = (
            row.split()[1:] for row in out.splitlines() if row.split()[:1] == [name]
        )
        assert at_end == ["-", "-", "100%", "-"]
        assert compared == ["-"] * 3
        assert averages == ["-"] * 5
        assert f"{name}: no estimate: no contact or no motion" in out
    assert "hunt-crossley" not in out
    assert "grid's edge" not in out


@pytest.mark.parametrize("estimators", [("rls", "ai"), None, "all"])
def test_the_figures_say_why_there_is_no_estimate_and_their_legends_have_lines(estimators):
    from estimation.registry import named_estimators

    found = evaluation(named_estimators("all") if estimators == "all" else estimators)
    for figure, text in (
        (found.plot(title="free"), "no estimate: no contact"),
        (found.plot_force(title="free"), "no estimate: no contact"),
        (fit_figure("free", found), "no model: the force does not follow the displacement"),
    ):
        assert any(text in shown.get_text() for axes in figure.axes for shown in axes.texts)
        labels = {
            one.get_label()
            for axes in figure.axes
            for one in axes.get_lines()
            if np.isfinite(one.get_ydata()).any()
        }
        for legend in figure.legends:
            names = {one.get_text() for one in legend.get_texts()} - {"motion (right axis)"}
            assert names <= labels


def test_a_contact_has_its_models_and_lines():
    found = evaluation(k=500.0)
    assert found.models
    assert math.isfinite(found.least_squares.k)
    for figure in (found.plot(title="contact"), found.plot_force(title="contact")):
        assert not [text for axes in figure.axes for text in axes.texts]


@pytest.mark.parametrize("k", [0.0, 500.0])
@pytest.mark.parametrize(("frequency", "amplitude"), [(0.7, 1e-3), (2.0, 3e-3)])
def test_frequency_and_amplitude_are_those_of_the_sine(k, frequency, amplitude):
    motion = motion_of(smoothed_signals(signals(frequency, amplitude, k)))
    assert motion.frequency_hz == pytest.approx(frequency, rel=0.01)
    assert motion.amplitude_m == pytest.approx(amplitude, rel=0.01)
    assert motion.travel_m == pytest.approx(2.0 * amplitude, rel=0.01)


def test_a_ramp_has_a_travel_and_no_frequency():
    x = 1e-3 * np.minimum(T, 4.0)
    motion = motion_of(
        smoothed_signals(Signals(T, x, 500.0 * x + NOISE, np.full(T.size, 4e-3), "x"))
    )
    assert math.isnan(motion.frequency_hz)
    assert motion.travel_m == pytest.approx(4e-3, rel=0.01)


def test_the_result_states_the_motion(path, capsys):
    assert main(["estimate", path, "--details"]) == 0
    assert "motion: 1 Hz, amplitude 3 mm (half of a stroke), travel 6 mm" in capsys.readouterr().out


@pytest.mark.parametrize("beyond", [-2.5e-3, 2.5e-3])
@pytest.mark.parametrize("gap", [False, True])
def test_one_larger_stroke_in_contact_is_neither_free_motion_nor_saturation(beyond, gap):
    """Beyond the other strokes, the force is outside of the usual range, but not constant."""
    t = np.arange(0.0, 20.0, 5e-3)
    x = 1e-3 * np.sin(1.6 * np.pi * t + 1.0) + 7e-4 * np.sin(2.6 * np.pi * t)
    middle = t[1900 + np.argmax(np.sign(beyond) * x[1900:2200])]
    x += 6e-3 + beyond * np.exp(-(((t - middle) / 0.12) ** 2))
    f = 500.0 * x + 3.0 * np.gradient(x, t) + np.random.default_rng(0).normal(0.0, 0.01, t.size)
    kept = ~((t > middle - 0.05) & (t < middle + 0.5)) if gap else np.ones(t.size, dtype=np.bool_)
    t, x, f = t[kept], x[kept], f[kept]
    gaps = tuple((1 + np.flatnonzero(np.diff(t) > 0.1)).tolist())
    phases = find_phases(smoothed_signals(Signals(t, x, f, periods(t), "position", gaps)))
    assert phases.free_force is None
    assert not phases.saturated
