"""The physics and the truth of benchmarks/independent.py, compared with closed-form solutions."""

from __future__ import annotations

import dataclasses
import functools
import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
bodies = importlib.import_module("independent_bodies")
independent = importlib.import_module("independent")

W = 2.0 * math.pi
T = np.arange(-2.0, 4.0, 1e-4)
X = 2e-3 + 1e-3 * np.sin(W * T)
RECORD = T >= 0.0


def stiffness(force: np.ndarray) -> complex:
    return bodies.complex_stiffness(T[RECORD], X[RECORD], force[RECORD], 1.0)


@functools.cache
def case(name: str):
    kind = next(kind for kind in independent.KINDS if kind.name == name)
    return independent.simulate(kind, 1, 0)


def test_the_complex_stiffness_of_a_kelvin_voigt_body_is_exact():
    force = bodies.kelvin_voigt(800.0, 4.0).force(T, X)
    assert stiffness(force) == pytest.approx(800.0 + 4.0j * W, rel=1e-6)


def test_the_complex_stiffness_of_a_springpot_is_that_of_the_equation():
    force = bodies.Springpot(500.0, 0.25, 300.0).force(T, X)
    expected = 300.0 + 500.0 * (1j * W) ** 0.25
    assert stiffness(force) == pytest.approx(expected, rel=2e-3)


def test_the_complex_stiffness_of_maxwell_arms_is_that_of_the_equation():
    arms = [(0.3, 0.05), (0.2, 0.4)]
    force = bodies.Relaxing(lambda d: 800.0 * d, arms).force(T, X)
    expected = 800.0 * (1.0 + sum(g * 1j * W * tau / (1.0 + 1j * W * tau) for g, tau in arms))
    assert stiffness(force) == pytest.approx(expected, rel=1e-3)


def test_the_complex_stiffness_of_a_poroelastic_layer_is_that_of_terzaghi():
    deeper = X + 3e-3
    force = bodies.poroelastic(800.0, 0.5, 200).force(T, deeper)
    root = np.sqrt(0.5j * W)
    assert stiffness(force) == pytest.approx(800.0 * root / np.tanh(root), rel=5e-3)


def test_a_gap_shifts_the_force_of_a_bonded_body_by_its_half_width():
    x = 1e-3 * np.sin(W * T)
    _, force = bodies.gap(x, 1e-4, 800.0, 0.0, 2e-4)
    expected = 800.0 * np.sign(x) * np.maximum(np.abs(x) - 2e-4, 0.0)
    np.testing.assert_allclose(force, expected, atol=1e-12)


def test_the_tip_in_a_gap_returns_to_zero_force_with_the_time_constant_of_the_body():
    x = np.where(np.arange(4000) < 2000, 1e-3, 0.0)
    tip, _ = bodies.gap(x, 1e-4, 800.0, 8.0, 5e-4)
    assert tip[2099] == pytest.approx(5e-4 * math.exp(-1.0), rel=0.02)


@pytest.mark.parametrize("form", ["coulomb", "dahl", "lugre", "bouc-wen"])
def test_friction_on_a_slider_loses_the_position_by_friction_times_compliance(form):
    k, compliance, friction = 1000.0, 1e-4, 1.0
    slider = bodies.Slider(form, friction, compliance, 5e-6)
    tip, force = slider.tip(X, 1e-4, k, 1.0)
    lost = X - tip - compliance * force
    middle = RECORD & (np.abs(X - 2e-3) < 2e-4)
    side = np.sign(np.gradient(X))
    np.testing.assert_allclose((lost * side)[middle], compliance * friction, rtol=0.05)


def test_the_loop_of_dahl_friction_has_the_area_of_its_closed_form():
    slip, amplitude = 2e-4, 1e-3
    z = bodies.dahl(X[RECORD], slip)
    one = slice(10_000, 20_001)
    area = np.trapezoid(z[one], X[RECORD][one])
    stroke = 2.0 * amplitude / slip
    steady = math.tanh(stroke / 2.0)
    # From z = -steady: z = 1 - (1 + steady) exp(-s), integrated over both strokes.
    expected = 2.0 * slip * (stroke - (1.0 + steady) * (1.0 - math.exp(-stroke)))
    assert area == pytest.approx(expected, rel=1e-3)


def test_the_slope_in_loading_ignores_the_unloading_and_the_level_of_a_pass():
    v = np.gradient(X, T)
    force = np.where(v > 0.0, 800.0 * X + 0.3, 1000.0 * X) + 0.02 * np.floor(T + 0.25)
    assert bodies.loading_slope(X, force, 2.0) == pytest.approx(800.0, rel=1e-3)


def test_the_delay_of_each_lag_is_as_stated():
    force = np.sin(W * T)
    for lagged in (
        bodies.first_order(force, 1e-4, 5e-3),
        bodies.delayed(force, 1e-4, 5e-3),
        bodies.low_pass(force, 1e-4, math.sqrt(2.0) / (W * 5e-3)),
    ):
        phase = np.angle(bodies.complex_stiffness(T[RECORD], force[RECORD], lagged[RECORD], 1.0))
        assert -phase / W == pytest.approx(5e-3, rel=0.015)


@pytest.mark.parametrize(
    "name",
    ["linear, sine", "force lag", "held position", "Hunt-Crossley n = 1"],
)
def test_the_truth_of_a_case_is_that_of_its_body(name):
    made = case(name)
    force = 0.5 * float(made.truth.body.max())
    assert made.body.tangent(np.array(1e-3)) == pytest.approx(made.draw.k)
    assert made.draw.k in [pytest.approx(k, rel=2e-3) for k in made.stiffnesses(force)]
    expected = made.body.viscosity(made.depths_at(force))
    assert made.dampings(force, False)[0] == pytest.approx(expected[0], rel=2e-3)


def test_a_coulomb_link_changes_neither_the_true_stiffness_in_series_nor_the_true_damping():
    made = case("known lost motion")
    compliance = made.draw.notes["compliance"]
    dynamic = made.draw.k + 1j * made.draw.omega * made.draw.b
    assert made.complex_stiffness == pytest.approx(dynamic / (1.0 + compliance * dynamic), rel=2e-3)
    by_hand = dataclasses.replace(made, kind=dataclasses.replace(made.kind, steady=False))
    assert by_hand.stiffnesses(1.0) == [
        pytest.approx(made.draw.k / (1.0 + compliance * made.draw.k))
    ]


def result(**values: object) -> dict[str, object]:
    return {
        "identifiable": True, "k": 800.0, "k_low": 799.0, "k_high": 801.0, "reasons": [],
        "b": 4.0, "b_low": 3.9, "b_high": 4.1, "damping_at_hz": 1.0, "tangent": {"force_n": 1.0},
    } | values  # fmt: skip


def judged(name: str, share: float, named: bool = False, **values: object) -> str:
    """Return the verdict on a k that is a share of the true one."""
    made = case(name)
    force = 0.5 * float(made.truth.body.max())
    k = share * made.draw.k
    given = result(k=k, k_low=0.999 * k, k_high=1.001 * k, tangent={"force_n": force}, **values)
    return independent.judge_k(made, given, named).verdict


def test_the_verdict_depends_on_the_error_and_on_the_named_cause():
    assert judged("force lag", 1.0005) == "right"
    assert judged("force lag", 1.05) == "near"
    assert judged("force lag", 1.2) == "WRONG"
    assert judged("force lag", 1.2, named=True) == "named"


def test_a_refusal_is_needless_only_if_a_stiffness_exists():
    refusal = result(identifiable=False, k=None)
    assert independent.judge_k(case("linear, sine"), refusal, False).verdict == "refused"
    assert independent.judge_k(case("saturation"), refusal, False).verdict == "unnamed"
    assert independent.judge_k(case("saturation"), refusal, True).verdict == "named"
    assert judged("saturation", 1.0) == "WRONG"


def test_the_claims_of_a_remark_are_judged_one_by_one():
    text = "Kelvin-Voigt is insufficient: the stiffness depends on depth (degree 3) and force "
    text += "relaxes (0.2 s); residual 2 N, and 1 N if the model contains this"
    first, second = independent.claims(text)
    assert ("depends on depth" in first, "relaxes" in first) == (True, False)
    assert ("depends on depth" in second, "relaxes" in second) == (False, True)


def test_at_least_forty_kinds_with_different_names_have_a_cause_or_need_none():
    names = [kind.name for kind in independent.KINDS]
    assert len(set(names)) == len(names) >= 40
    assert all(kind.cause for kind in independent.KINDS if not kind.has_k)
