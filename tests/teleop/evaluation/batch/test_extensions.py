"""Layers, damping that grows with depth, mass and friction, on bodies of known truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from teleop.evaluation.batch.analysis import Analysis, analyse, contradiction
from teleop.evaluation.batch.candidate import DEPTH_DAMPING, FRICTION, KNOT, MASS
from teleop.evaluation.batch.extension_texts import free_motion, layers
from teleop.evaluation.batch.extensions import Base, exact_columns, refined_knot
from teleop.evaluation.batch.kinds import STORAGE, TANGENT
from teleop.evaluation.batch.regression_rows import RegressionRows
from teleop.evaluation.reading.signals import Signals, periods

RATE = 500.0
T = np.arange(0.0, 7.0, 1.0 / RATE)


def sine(frequency=1.3, amplitude=2e-3, centre=4e-3):
    w = 2.0 * math.pi * frequency
    x = centre + amplitude * np.sin(w * T)
    return x, amplitude * w * np.cos(w * T), -(w**2) * (x - centre)


def tones(centre=5e-3):
    x, v, a = np.full(len(T), centre), np.zeros(len(T)), np.zeros(len(T))
    for amplitude, frequency, phase in ((8e-4, 0.53, 0.3), (1e-3, 1.4, 2.0), (4e-4, 2.9, 4.0)):
        w = 2.0 * math.pi * frequency
        x += amplitude * np.sin(w * T + phase)
        v += amplitude * w * np.cos(w * T + phase)
        a -= amplitude * w**2 * np.sin(w * T + phase)
    return x, v, a


def analysed(x, f, seed=0, noise=2e-3) -> Analysis:
    rng = np.random.default_rng(seed)
    f = f + rng.normal(0.0, noise * np.ptp(f), len(f))
    return analyse(Signals(T, x + rng.normal(0.0, 1e-6, len(x)), f, periods(T), "position"))


def kinds(found: Analysis) -> list[str]:
    assert found.local is not None
    return [part.kind for part in found.local.best.parts]


@pytest.mark.parametrize(("motion", "seed"), [(sine, 0), (tones, 1)])
def test_a_soft_layer_on_a_stiff_one_is_reported_with_both_stiffnesses(motion, seed):
    x, v, _ = motion()
    change = float(np.quantile(x, 0.6))
    found = analysed(x, 400.0 * x + 3600.0 * np.maximum(x - change, 0.0) + 2.0 * v, seed)
    layers = found.result.summary()["layers"]
    for name, true in (("k_before", 400.0), ("k_after", 4000.0)):
        assert layers[name]["value"] == pytest.approx(true, rel=0.01)
    position = found.local.best.part(KNOT).values[0].value
    assert position == pytest.approx(change, abs=1e-5)
    lowest = found.record.x[found.phases.usable].min()
    assert layers["depth_m"]["value"] == pytest.approx(change - lowest, abs=1e-5)
    # half of the force range is in the stiff layer
    assert found.result.k == pytest.approx(4000.0, rel=0.01)
    assert any("the stiffness changes at a depth" in one for one in found.result.reasons)


def test_a_knot_before_which_the_force_hardly_increases_is_no_layer():
    """A polynomial also has a slope on the side of the contact point where the force has none."""
    x, v, _ = tones()
    change = float(np.quantile(x, 0.6))
    f = 400.0 * x + 3600.0 * np.maximum(x - change, 0.0) + 2.0 * v
    best = analysed(x, f).local.best
    whole = 400.0 * np.ptp(x) + 3600.0 * (x.max() - change)
    assert best.share_before_knot == pytest.approx(400.0 * (change - x.min()) / whole, rel=0.05)
    assert layers(best)
    assert not free_motion(best)
    hidden = best._replace(share_before_knot=0.005)
    assert not layers(hidden)
    assert free_motion(hidden)


def test_a_smooth_transition_between_layers_does_not_bias_the_stiffness():
    x, v, _ = tones()
    width, change = 2e-4, float(np.quantile(x, 0.6))

    def force(at):
        return 400.0 * at + 3600.0 * width * np.logaddexp(0.0, (at - change) / width)

    middle = 0.5 * (force(x.min()) + force(x.max()))
    place = brentq(lambda at: force(at) - middle, x.min(), x.max())
    true = 400.0 + 3600.0 / (1.0 + math.exp(-(place - change) / width))
    assert analysed(x, force(x) + 2.0 * v).result.k == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize("seed", range(2))
def test_damping_that_grows_with_depth_does_not_change_the_stiffness(seed):
    x = 2.5e-3 * np.sin(2.0 * math.pi * 1.1 * T) + 5e-4  # partly out of contact
    v = 2.5e-3 * 2.0 * math.pi * 1.1 * np.cos(2.0 * math.pi * 1.1 * T)
    f = np.maximum(530.0 * np.maximum(x, 0.0) * (1.0 + 15.0 * v), 0.0)
    found = analysed(x, f, seed)
    assert found.result.k == pytest.approx(530.0, rel=0.02)
    assert DEPTH_DAMPING in kinds(found)
    assert any("damping grows with depth" in one for one in found.result.reasons)
    assert not any("relaxes" in one for one in found.result.reasons)


def test_the_damping_is_that_at_the_position_of_the_stiffness():
    x, v, _ = tones()
    found = analysed(x, 800.0 * x + 4000.0 * x * v)
    depth = found.local.best.position
    assert found.result.b == pytest.approx(4000.0 * depth, rel=0.02)
    ends = found.result.summary()["damping_by_depth"]
    assert ends["highest"]["value"] == pytest.approx(4000.0 * x.max(), rel=0.03)
    assert ends["lowest"]["value"] == pytest.approx(4000.0 * x.min(), rel=0.03)


def test_a_mass_beyond_the_sensor_is_separated_from_the_stiffness():
    x, v, a = tones()
    found = analysed(x, 800.0 * x + 3.0 * v + 0.4 * a)
    assert found.result.k == pytest.approx(800.0, rel=0.01)
    assert found.result.summary()["mass_kg"]["value"] == pytest.approx(0.4, rel=0.02)
    assert any("a mass of 0.4" in one or "a mass of 0.39" in one for one in found.result.reasons)


def test_the_effect_of_a_mass_is_stated_if_a_single_sine_cannot_show_it():
    x, v, a = sine(4.0)
    found = analysed(x, 800.0 * x + 3.0 * v + 0.4 * a)
    change = found.result.k_change_per_100g
    assert found.result.k + 4.0 * change == pytest.approx(800.0, rel=0.01)
    assert any(reason.startswith("inertia: 100 g") for reason in found.result.reasons)
    assert MASS not in kinds(found)


def test_friction_in_the_specimen_does_not_bias_the_stiffness():
    x, v, _ = tones()
    friction, element, stuck = np.zeros(len(x)), 0.0, 1e-4
    for i in range(1, len(x)):  # elastoplastic element: 0.3 N after a travel of 0.1 mm
        element = min(max(element + x[i] - x[i - 1], -stuck), stuck)
        friction[i] = 0.3 * element / stuck
    found = analysed(x, 800.0 * x + 1.0 * v + friction)
    assert FRICTION in kinds(found)
    assert found.result.k == pytest.approx(800.0, rel=0.01)
    force = found.result.summary()["friction_n"]
    assert force["low"] < 0.3 < force["high"] < 0.36


@pytest.mark.parametrize("motion", [sine, tones])
def test_lost_motion_before_the_specimen_is_not_reported_as_friction(motion):
    x, v, _ = motion()
    tip = np.empty(len(x))
    tip[0] = x[0]
    for i in range(1, len(x)):
        tip[i] = min(max(tip[i - 1], x[i] - 4e-5), x[i] + 4e-5)
    assert FRICTION not in kinds(analysed(x, 800.0 * tip + 1.0 * v))


@pytest.mark.parametrize(("motion", "seed"), [(sine, 0), (tones, 1)])
def test_a_linear_body_has_no_extension_and_no_remark(motion, seed):
    x, v, _ = motion()
    found = analysed(x, 800.0 * x + 3.0 * v, seed)
    assert kinds(found) == []
    unknown = ("a lag of the force is not known", "inertia: 100 g")
    assert all(one.startswith(unknown) for one in found.result.reasons)


def test_a_stiffening_body_has_no_layers():
    x, v, _ = sine()
    found = analysed(x, 3e5 * x**1.5 * 0.1 + 3.0 * v)
    assert KNOT not in kinds(found)
    assert found.result.summary()["layers"] is None


def test_a_stiffening_body_in_a_sine_has_a_tangent_and_another_storage_stiffness():
    x, v, _ = sine()
    rise = 500.0

    def slope(at):
        return 200.0 * math.exp(rise * at)

    found = analysed(x, 200.0 / rise * np.expm1(rise * x) + 1.0 * v)
    assert found.result.kinds["k"] == TANGENT
    at = found.local.best.position
    assert found.result.k == pytest.approx(slope(at), rel=0.01)
    # describing function of the force over one cycle
    phase = np.linspace(0.0, 2.0 * math.pi, 4096, endpoint=False)
    force = 200.0 / rise * np.expm1(rise * (4e-3 + 2e-3 * np.sin(phase)))
    storage = 2.0 * np.mean(force * np.sin(phase)) / 2e-3
    assert found.complex_stiffness()["storage_n_per_m"] == pytest.approx(storage, rel=2e-3)
    assert abs(found.result.k - storage) > 3.0 * (found.result.k_high - found.result.k)


def test_k_of_a_linear_body_in_a_sine_is_the_storage_stiffness():
    x, v, _ = sine()
    found = analysed(x, 800.0 * x + 3.0 * v)
    assert found.result.kinds["k"] == STORAGE
    assert found.result.storage_at_hz == pytest.approx(1.3, rel=0.01)


def test_the_misfit_of_the_best_model_widens_the_interval():
    x, v, _ = tones()
    wave = 2.0 * math.pi / 1.2e-3  # of the stiffness over depth: no candidate contains it
    f = 800.0 * x + 0.02 * np.sin(wave * x) + 3.0 * v
    found = analysed(x, f, noise=2e-4)
    at = found.local.best.position
    true = 800.0 + 0.02 * wave * math.cos(wave * at)
    assert found.result.k_low < true < found.result.k_high


def test_a_hunt_crossley_fit_that_is_better_and_has_another_tangent_withholds_k():
    x = 2.5e-3 * np.sin(2.0 * math.pi * 1.1 * T) + 5e-4  # partly out of contact
    v = 2.5e-3 * 2.0 * math.pi * 1.1 * np.cos(2.0 * math.pi * 1.1 * T)
    found = analysed(x, np.maximum(530.0 * np.maximum(x, 0.0) * (1.0 + 10.0 * v), 0.0))
    assert contradiction(found) is None
    worse = found.local.best._replace(rms=3.0 * found.local.best.rms)
    local = replace(found.local, best=worse)
    assert contradiction(replace(found, local=local)) is None  # the same tangent
    other = replace(found.result, k=813.0, k_low=724.0, k_high=903.0)
    reason = contradiction(replace(found, local=local, result=other))
    assert reason is not None
    assert "Hunt-Crossley" in reason.text


def presses(bottom=-1e-3, top=4e-3, frequency=0.6):
    """Presses from motion out of contact, whose surface is at zero."""
    w, half = 2.0 * math.pi * frequency, 0.5 * (top - bottom)
    x = bottom + half * (1.0 - np.cos(w * T))
    return x, half * w * np.sin(w * T)


def test_the_depth_of_a_layer_begins_at_the_surface_of_the_soft_layer():
    x, v = presses()
    depth = np.maximum(x, 0.0)
    f = 150.0 * depth + 1350.0 * np.maximum(depth - 1.5e-3, 0.0) + 1.0 * v * (x > 0.0)
    layers = analysed(x, f, 2, noise=5e-4).result.summary()["layers"]
    assert layers["depth_m"]["low"] <= 1.5e-3 <= layers["depth_m"]["high"]
    assert layers["depth_m"]["high"] - layers["depth_m"]["low"] < 0.2e-3


def test_the_secant_of_a_damped_linear_body_is_its_stiffness():
    x, v = presses()
    found = analysed(x, np.where(x > 0.0, 400.0 * x + 25.0 * v, 0.0), noise=1e-3).result
    assert found.secant == pytest.approx(400.0, rel=0.02)
    assert found.force == pytest.approx(0.5 * 400.0 * 4e-3, rel=0.4)


def test_motion_out_of_contact_that_a_drift_hides_is_not_a_layer():
    x, v = presses()
    f = np.where(x > 0.0, 600.0 * x + 20.0 * v, 0.0) + 0.08 * T
    found = analysed(x, f, noise=3e-3).result
    assert found.summary()["layers"] is found.summary()["damping_by_depth"] is None
    assert not any("layer" in one and "very soft" not in one for one in found.reasons)
    assert not any("damping grows" in one for one in found.reasons)
    assert found.k_low <= 600.0 <= found.k_high


def test_there_is_no_storage_stiffness_over_cycles_that_leave_the_body():
    x, v = presses()
    found = analysed(x, np.where(x > 0.0, 700.0 * x + 6.0 * v, 0.0))
    assert found.result.k == pytest.approx(700.0, rel=0.01)
    assert found.complex_stiffness() is None


def test_the_mass_in_a_chirp_is_no_change_of_the_stiffness_with_frequency():
    t = np.arange(0.0, 20.0, 2e-3)
    phase = 2.0 * math.pi * (0.3 + 0.12 * t) * t
    v = 3.0 * math.pi * 1e-3 * (0.3 + 0.24 * t) * np.cos(phase)
    x, a = 4e-3 + 1.5e-3 * np.sin(phase), np.gradient(v, t)
    f = 700.0 * x + 4.0 * v + 0.2 * a + np.random.default_rng(0).normal(0.0, 0.01, len(t))
    found = analyse(Signals(t, x, f, periods(t), "position"))
    assert not found.record.sinusoidal
    assert found.result.k == pytest.approx(700.0, rel=0.01)
    assert found.result.parts["mass_kg"]["value"] == pytest.approx(0.2, rel=0.03)


def test_a_knot_is_refined_although_a_jump_at_a_wrong_position_fits_better():
    """The polynomial does not describe a second knot, at which contact begins."""
    x, v, _ = sine()
    surface, change = np.quantile(x, [0.1, 0.5])
    layers = 400.0 * np.maximum(x - surface, 0.0) + 2000.0 * np.maximum(x - change, 0.0)
    found = analysed(x, layers + 2.0 * v)
    rows, base = RegressionRows(found.record, found.phases), Base(2, (), (), (), ())
    _, (knot, _) = refined_knot(rows, base, 0.0, 0.0)
    fits = [sharp_knot_squares(rows, base, at) for at in (knot - 5e-3, knot, knot + 5e-3)]
    assert fits[1] < min(fits[0], fits[2])


def sharp_knot_squares(rows: RegressionRows, base: Base, knot: float) -> float:
    """Sum of squares with a sharp knot, without a jump of the force."""
    columns = exact_columns(rows, KNOT, (knot, 0.0))[:1]
    return float(np.sum(rows.fit(base.degree, [], columns).residual ** 2))
