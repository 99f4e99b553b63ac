"""The physics and the table of benchmarks/interval_coverage.py."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from estimation.filters import Play
from estimation.stiffening import Interval

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
bodies = importlib.import_module("independent_bodies")
records = importlib.import_module("interval_coverage_records")
coverage = importlib.import_module("interval_coverage")

DT = 1e-4
T = np.arange(0.0, 2.0, DT)
Z = 2e-3 + 1e-3 * np.sin(2.0 * math.pi * 2.0 * T)
KINDS = {kind.name: kind for kind in coverage.KINDS}


def test_the_play_by_strokes_is_that_of_each_sample():
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.normal(size=2000))
    np.testing.assert_allclose(records.play(x, 2.5), Play(2.5).run(x), atol=1e-12)


@pytest.mark.parametrize(
    "body",
    [
        bodies.kelvin_voigt(1000.0, 5.0),
        bodies.hunt_crossley(2e4, 1.5, 10.0),
        bodies.Relaxing(lambda d: 1000.0 * np.maximum(d, 0.0), [(0.3, 0.1)]),
    ],
)
def test_depth_and_stretch_of_the_transmission_are_the_position_behind_the_play(body):
    c = 5e-5
    depth, force = records.compressed(body, Z, DT, c)
    np.testing.assert_allclose(depth + c * force, Z, atol=1e-9)
    later = slice(2000, None)
    expected = body.force(T, depth)[later]
    np.testing.assert_allclose(force[later], expected, atol=2e-3 * force.max())


def test_the_force_of_a_linear_body_is_that_of_the_implicit_steps():
    body, c = bodies.kelvin_voigt(1000.0, 5.0), 5e-5
    _, exact = records.compressed(body, Z, DT, c)
    _, stepped = records.compressed_viscous(body, Z, DT, c)
    np.testing.assert_allclose(stepped[2000:], exact[2000:], atol=1e-3 * exact.max())


@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_the_lag_of_the_force_channel_is_the_sum_of_delay_and_time_constant(share):
    rig = records.Transmission(4e-3, share, 0.0, 0.0)
    ramp = records.sensed(rig, T, DT)
    assert T[-1] - ramp[-1] == pytest.approx(4e-3, rel=1e-6)


def test_a_record_of_a_spring_without_noise_has_its_compliance_and_its_lost_motion():
    rig = records.Transmission(0.0, 0.0, 5e-5, 2e-5)
    record = records.spring_record(
        np.random.default_rng(1), "chirp", 500.0, rig, 1e-3, 5000.0, (1e-9, 1e-9), (1e7, 1e7)
    )
    _, x, f = record.log
    series = 1.0 / 5000.0 + 2e-5
    behind = x - f * series
    assert np.abs(behind).max() == pytest.approx(5e-5, rel=1e-3)


def test_the_truth_of_a_linear_record_is_that_of_body_and_transmission_in_series():
    case = KINDS["linear, sine"].case(1, 0)
    result = coverage.StiffnessResult(k=1.0, force=1.0, damping_at_hz=1.0)
    k, b, c = case.draw.k, case.draw.b, case.draw.notes["compliance"]
    dynamic = k + 1j * case.draw.omega * b
    series = dynamic / (1.0 + c * dynamic)
    assert coverage.true_stiffnesses(case, result) == [pytest.approx(series.real, rel=1e-4)]
    expected = series.imag / case.draw.omega
    assert coverage.true_dampings(case, result) == [pytest.approx(expected, rel=2e-3)]


def test_the_truth_of_a_nonlinear_body_is_that_in_series_at_the_stated_position():
    case = KINDS["Hunt-Crossley, presses"].case(1, 0)
    c, depth = case.draw.notes["compliance"], np.array([0.6 * float(case.truth.depth.max())])
    position = case.draw.origin + depth + c * case.viscous.elastic(depth)
    result = coverage.StiffnessResult(k=1.0, force=1.0, position=float(position[0]))
    (k,), (b,) = coverage.true_stiffnesses(case, result), coverage.true_dampings(case, result)
    alone = float(case.viscous.tangent(depth)[0])
    np.testing.assert_allclose(1.0 / k, 1.0 / alone + c, rtol=1e-6)
    np.testing.assert_allclose(b, case.viscous.viscosity(depth)[0] * (k / alone) ** 2, rtol=1e-6)


def test_a_spring_is_measured_with_the_same_numbers_each_time():
    kind = KINDS["spring, chirp, 100 Hz"]
    found = kind.checked(1, 3)
    assert found == kind.checked(1, 3)
    assert set(found) == {"lag", "d", "c"}
    for one in found.values():
        assert abs(one.interval.value - one.truths[0]) < 2.5 * (
            one.interval.high - one.interval.low
        )


def checked(truth: float) -> dict[str, object]:
    return {"k": coverage.Checked(Interval(1.0, 0.9, 1.1), [truth])}


def test_a_coverage_outside_the_aim_is_marked_for_the_fitted_form_only():
    answers = [checked(1.05)] * 19 + [checked(1.2)]
    assert coverage.rows(KINDS["linear, sine"], answers)[0].split()[-3:] == ["20", "95.0%", "9.52%"]
    assert coverage.rows(KINDS["linear, sine"], [checked(1.2)])[0].endswith("outside")
    assert not coverage.rows(KINDS["Dahl link, sine"], [checked(1.2)])[0].endswith("outside")


def test_any_of_the_truths_of_a_nonlinear_body_is_right():
    assert coverage.Checked(Interval(1.0, 0.9, 1.1), [2.0, 1.0]).covers


def test_names_of_kinds_differ_and_each_is_of_one_of_the_tables():
    assert len(KINDS) == len(coverage.KINDS)
    assert {kind.fitted for kind in coverage.KINDS} == {False, True}
