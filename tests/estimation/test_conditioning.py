from __future__ import annotations

import functools
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from estimation import (
    FilteredDifference,
    FirstOrderAdaptiveWindowing,
    MatchedFilter,
    RecursiveLeastSquares,
    StateVariableFilter,
    compiled,
    least_squares,
)
from estimation.conditioning import WithDelay, WithoutLostMotion, make_conditioner
from estimation.filters import Delay, Lag
from estimation.model import MODELS

ALL = {
    "difference": lambda: FilteredDifference(20.0),
    "foaw": lambda: FirstOrderAdaptiveWindowing(1e-6),
    "svf": lambda: StateVariableFilter(20.0),
    "matched": lambda: MatchedFilter(20.0),
    "with delay": lambda: WithDelay(MatchedFilter(20.0), 3.3e-3),
    "without lost motion": lambda: WithoutLostMotion(MatchedFilter(20.0), 2e-4),
}


@pytest.fixture(params=ALL)
def make(request):
    return ALL[request.param]


def test_a_ramp_has_its_slope_for_velocity(make):
    rng = np.random.default_rng(0)
    dt = rng.uniform(0.5e-3, 2e-3, 2000)
    x = 0.01 + 0.03 * np.cumsum(dt)
    _, v, *_ = make().run(x, x, dt)
    np.testing.assert_allclose(v[-500:], 0.03, rtol=1e-6)


def test_a_rest_has_no_velocity_wherever_it_is(make):
    x, v, f, *_ = make().run(np.full(50, 1.5), np.full(50, 7.0), 1e-3)
    assert np.abs(v).max() < 1e-12
    np.testing.assert_allclose((x[-1], f[-1]), (1.5, 7.0))


def test_online_and_batch_agree_and_reset_restores_the_initial_state(make, palpation):
    s = palpation(seconds=0.2, jitter=0.3)
    conditioner = make()
    batch = conditioner.run(s.x, s.f, s.dt)
    conditioner.reset()
    online = [conditioner.update(x, f, dt) for x, f, dt in zip(s.x, s.f, s.dt, strict=True)]
    assert np.array_equal(np.transpose(batch[:3]), [sample[:3] for sample in online])


def test_state_variable_filter_equals_an_ode_solver():
    rng = np.random.default_rng(0)
    dt = rng.uniform(0.5e-3, 2e-3, 200)
    t = np.cumsum(dt)
    u = rng.normal(size=200)
    omega = 2.0 * np.pi * 20.0
    solution = solve_ivp(
        lambda s, y: [y[1], omega**2 * (np.interp(s, t, u) - y[0]) - 2.0 * omega * y[1]],
        (t[0], t[-1]),
        [u[0], 0.0],
        t_eval=t,
        rtol=1e-9,
        atol=1e-9,
        max_step=2e-4,
    )
    x, v, f, *_ = MatchedFilter(20.0).run(u, 3.0 * u, dt)
    np.testing.assert_allclose(x, solution.y[0], atol=1e-6)
    np.testing.assert_allclose(v, solution.y[1], atol=1e-3)
    np.testing.assert_allclose(f, 3.0 * x, atol=1e-12)
    _, v_alone, *_ = StateVariableFilter(20.0).run(u, u, dt)
    assert np.array_equal(v_alone, v)


def test_matched_filtering_keeps_the_regression_exact_where_filtering_velocity_alone_does_not(
    palpation,
):
    s = palpation(seconds=4.0, b=20.0, k=18_000.0)
    errors = {}
    for name in ("matched", "svf"):
        x, v, f, *_ = ALL[name]().run(s.x, s.f, s.dt)
        errors[name] = abs(least_squares(x[1000:], v[1000:], f[1000:]).b - 20.0)
    assert errors["matched"] < 0.01
    assert errors["svf"] > 100.0 * errors["matched"]


def test_matched_filtering_has_the_least_parameter_error_from_an_encoder(palpation):
    s = palpation(seconds=10.0, b=20.0, k=18_000.0, noise=0.02)
    counts = np.round(s.x * 1e6) * 1e-6
    error = {}
    for name, make in ALL.items():
        estimates = RecursiveLeastSquares(0.98, (100.0, 100.0)).run(*make().run(counts, s.f, s.dt))
        error[name] = np.sqrt(np.mean((estimates.b[2000:] - 20.0) ** 2))
    assert min(error, key=error.get) == "matched"


def test_foaw_is_quiet_at_rest_and_prompt_in_motion():
    dither = 1e-6 * (np.arange(200) % 2)
    start = np.concatenate((dither, 1e-6 + 0.05e-3 * np.arange(1, 20)))
    _, foaw, *_ = FirstOrderAdaptiveWindowing(1e-6).run(start, start, 1e-3)
    _, difference, *_ = FilteredDifference(1e3).run(start, start, 1e-3)
    assert np.abs(foaw[50:200]).max() < 0.1 * np.abs(difference[50:200]).max()
    assert foaw[203] == pytest.approx(0.05, rel=0.05)


@pytest.mark.parametrize("make", [FilteredDifference, StateVariableFilter, MatchedFilter])
@pytest.mark.parametrize("bandwidth", [0.0, -1.0, np.nan, np.inf])
def test_a_bandwidth_that_is_not_positive_is_refused(make, bandwidth):
    with pytest.raises(ValueError, match="bandwidth must be positive"):
        make(bandwidth)


def test_a_bad_sample_is_refused_and_does_not_change_the_state(make):
    conditioner, twin = make(), make()
    for c in (conditioner, twin):
        c.update(1e-3, 2.0, 1e-3)
    for bad in ((np.nan, 2.0, 1e-3), (1e-3, np.inf, 1e-3), (1e-3, 2.0, 0.0), (1e-3, 2.0, -1e-3)):
        with pytest.raises(ValueError, match="must be finite"):
            conditioner.update(*bad)
    assert conditioner.update(2e-3, 4.0, 1e-3) == twin.update(2e-3, 4.0, 1e-3)


def test_foaw_refuses_an_impossible_window():
    with pytest.raises(ValueError, match="resolution"):
        FirstOrderAdaptiveWindowing(0.0)
    with pytest.raises(ValueError, match="at least one"):
        FirstOrderAdaptiveWindowing(1e-6, 0)


@pytest.mark.parametrize(
    "make",
    [
        functools.partial(FilteredDifference, 20.0),
        functools.partial(make_conditioner, "difference", 20.0, 1e-6, lost_motion=2e-4),
        functools.partial(
            make_conditioner, "matched", 20.0, 1e-6, 5e-3, lost_motion=2e-4, delay_share=0.6
        ),
        *(
            functools.partial(MatchedFilter, 20.0, lag, model)
            for lag in (0.0, 3e-3)
            for model in MODELS.values()
        ),
    ],
)
def test_filters_give_the_same_bits_online_in_blocks_and_compiled(make, monkeypatch):
    rng = np.random.default_rng(1)
    dt = rng.uniform(0.5e-3, 2e-3, 4000)
    x, f = (rng.normal(size=4000).cumsum() * 1e-4 for _ in range(2))
    conditioner = make()
    rows = [conditioner.update(*sample) for sample in zip(x, f, dt, strict=True)]
    online = np.array([(c.x, c.v, c.f, *c.further) for c in rows])
    for is_compiled in (False, True):
        if is_compiled:
            pytest.importorskip("numba", reason="needs the `fast` extra")
        monkeypatch.setattr(compiled.choice, "is_compiled", lambda n, chosen=is_compiled: chosen)
        for bounds in ([0, 4000], [0, 1, 2, 1500, 4000]):
            conditioner = make()
            parts = [conditioner.run(x[a:b], f[a:b], dt[a:b]) for a, b in pairwise(bounds)]
            batch = np.concatenate([np.column_stack([*p[:3], p.further]) for p in parts])
            assert np.array_equal(batch, online)


@pytest.mark.parametrize("name", ["matched", "svf", "foaw", "difference"])
def test_behind_lost_motion_a_conditioner_receives_the_position_of_a_backlash(name):
    """After a reversal, the motor moves by twice the half width of the backlash before the tip."""
    there = np.linspace(0.0, 3e-3, 3001)
    x = np.concatenate([there, there[::-1]])
    tip = np.concatenate([np.maximum(there - 1e-4, 0.0), np.minimum(there[::-1] + 1e-4, 2.9e-3)])
    behind, rigid = (make_conditioner(name, 20.0, 1.5e-6, lost_motion=d) for d in (1e-4, 0.0))
    for found, expected in zip(
        behind.run(x, x, 1e-3)[:3], rigid.run(tip, x, 1e-3)[:3], strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert behind.settling == rigid.settling
    assert behind.correlation(1e-3) == rigid.correlation(1e-3)


PERIODS = st.lists(st.floats(1e-4, 5e-3), min_size=1, max_size=40)


@given(delay=st.floats(0.0, 0.05), dt=PERIODS, data=st.data())
def test_a_delay_is_the_interpolated_input_of_an_earlier_time(delay, dt, data):
    size = len(dt)
    u = np.array(data.draw(st.lists(st.floats(-1.0, 1.0), min_size=size, max_size=size)))
    t = np.cumsum(dt)
    expected = np.interp(t - delay, t, u)  # before the first sample, the input is constant
    np.testing.assert_allclose(Delay(delay).run(u, np.array(dt)), expected, atol=1e-7)


@given(delay=st.floats(0.0, 0.05), dt=PERIODS, cut=st.integers(0, 40))
def test_a_delay_gives_the_same_bits_sample_by_sample_and_in_blocks(delay, dt, cut):
    dt = np.array(dt)
    u = np.sin(50.0 * np.cumsum(dt))
    single, blocks = Delay(delay), Delay(delay)
    online = [single.update(*one) for one in zip(u.tolist(), dt.tolist(), strict=True)]
    parts = [blocks.run(u[part], dt[part]) for part in (slice(cut), slice(cut, None))]
    assert np.array_equal(np.concatenate(parts), online)
    blocks.reset()
    assert np.array_equal(blocks.run(u, dt), online)


def test_the_memory_of_a_delay_is_limited():
    delay = Delay(5e-3)
    for _ in range(10_000):
        delay.update(1.0, 1e-3)
    assert len(delay._past) <= 7


@pytest.mark.parametrize("delay", [-1e-3, np.nan, np.inf])
def test_an_impossible_delay_is_refused(delay):
    with pytest.raises(ValueError, match="delay must be >= 0"):
        Delay(delay)


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_an_impossible_share_of_a_delay_is_refused(share):
    with pytest.raises(ValueError, match="expected 0 to 1"):
        make_conditioner("matched", 20.0, 1e-6, 1e-3, delay_share=share)


@pytest.mark.parametrize("share", [0.0, 0.6, 1.0])
def test_k_and_b_are_right_only_with_the_share_of_the_delay_in_the_lag(share):
    """A spring and a damper, whose force channel has the given share of a delay in 20 ms."""
    k, b, lag, fine = 1000.0, 20.0, 20e-3, 1e-4
    t = np.arange(0.0, 6.0, fine)
    depth = sum(1e-3 * np.sin(2.0 * np.pi * f * t + f) for f in (0.7, 2.3, 5.9))
    late = np.interp(t - share * lag, t, k * depth + b * np.gradient(depth, fine))
    force = Lag((1.0 - share) * lag).run(late, np.full(t.size, fine))
    x, f = depth[::10], force[::10]
    errors = {}
    for used in (0.0, 0.6, 1.0):
        conditioner = make_conditioner("matched", 20.0, 1e-6, lag, delay_share=used)
        sampled = conditioner.run(x, f, 1e-3).part(slice(1000, None))
        fit = np.linalg.lstsq(np.column_stack([sampled.x, sampled.v]), sampled.f, rcond=None)[0]
        errors[used] = np.abs(fit / (k, b) - 1.0)
    assert errors.pop(share).max() < 5e-3
    assert all(wrong[1] > 0.02 for wrong in errors.values())
