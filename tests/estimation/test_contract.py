"""What every estimator keeps to."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import AdaptiveIdentification, MultiEstimator, RecursiveLeastSquares, paper_preset
from estimation.compiled import WORTH_COMPILING, compiled, interpreted

PRESET = paper_preset("medium")
ESTIMATORS = {
    "rls": lambda: RecursiveLeastSquares(0.98, (100.0, 100.0)),
    "rls in time": lambda: RecursiveLeastSquares(0.98, (100.0, 100.0), 1e-3),
    "ai by rk4": lambda: AdaptiveIdentification(PRESET.adaptation_gain, "rk4"),
    "ai exact": lambda: AdaptiveIdentification(PRESET.adaptation_gain, "exact"),
    "me": lambda: MultiEstimator(PRESET.grid, 10.0),
    "me that never forgets": lambda: MultiEstimator(PRESET.grid, 0.0),
}


@pytest.fixture(params=ESTIMATORS)
def make(request):
    return ESTIMATORS[request.param]


def test_online_and_batch_give_the_same_numbers_to_the_bit(make, palpation):
    s = palpation(noise=0.1, jitter=0.3)
    online, batch = make(), make()
    expected = [online.update(*map(float, sample)) for sample in zip(*s, strict=True)]
    assert np.array_equal(np.column_stack(batch.run(*s)), expected)
    assert batch.state == online.state


def test_compiled_and_interpreted_give_the_same_numbers_to_the_bit(make, palpation):
    pytest.importorskip("numba", reason="needs the `fast` extra")
    x, v, f, dt = palpation(noise=0.1, jitter=0.3)
    e = make()
    fast = compiled(type(e).step, e.helpers)(e.parameters, e.state, v, x, f, dt)
    assert np.array_equal(fast, interpreted(type(e).step, e.parameters, e.state, (v, x, f, dt)))


def test_a_long_batch_is_the_same_as_its_pieces(make, palpation):
    s = palpation(seconds=WORTH_COMPILING / 1000 + 1.0, noise=0.1)
    whole, pieces = make(), make()
    expected = whole.run(*s)
    got = [pieces.run(*(channel[i : i + 3000] for channel in s)) for i in range(0, len(s.x), 3000)]
    assert np.array_equal(np.hstack(got), expected)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(-6, 3), name=st.sampled_from([*ESTIMATORS]))
def test_is_finite_whatever_the_signals(seed, size, name):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 300)) * 10.0 ** rng.uniform(-6.0, size, (3, 1))
    x *= rng.integers(0, 2, 300)
    v *= rng.integers(0, 2, 300)
    estimator = ESTIMATORS[name]()
    estimates = estimator.run(x, v, f, rng.uniform(1e-5, 0.1, 300))
    assert np.isfinite(estimates).all()
    assert np.isfinite(estimator.state).all()


@settings(max_examples=100, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gap=st.floats(0.1, 1e5),
    name=st.sampled_from([name for name in ESTIMATORS if "never forgets" not in name]),
    at=st.integers(1500, 1700),
)
def test_recovers_from_a_gap_in_the_data(seed, gap, name, at):
    rng = np.random.default_rng(seed)
    t = np.arange(4000) * 1e-3
    x = 5e-3 + 3e-3 * np.sin(7.0 * t)
    v = 21e-3 * np.cos(7.0 * t)
    f = 10.0 * v + 5000.0 * x + rng.normal(0.0, 0.02, t.size)
    dt = np.full(t.size, 1e-3)
    dt[at] = gap
    estimator = ESTIMATORS[name]()
    estimates = estimator.run(x, v, f, dt)
    assert np.isfinite(estimates).all()
    assert np.isfinite(estimator.state).all()
    assert estimates.k[-1] == pytest.approx(5000.0, rel=0.05)


def test_numbers_of_any_kind_give_the_same_estimate(make):
    plain, odd = make(), make()
    for value in (1e-3, 2e-3, 4e-3):
        single = np.float32(value)
        expected = plain.update(float(single), 10.0 * float(single), 5.0, 1e-3)
        assert odd.update(single, np.float32(10.0) * np.float64(single), 5, 1e-3) == expected


@pytest.mark.parametrize("sample", [(1e308, -1e308, 1.0), (1e31, 0.0, 0.0), (0.0, 0.0, 1e154)])
def test_an_absurdly_large_sample_is_refused(make, sample):
    with pytest.raises(ValueError, match="below 1e.30"):
        make().update(*sample, 1e-3)
    with pytest.raises(ValueError, match="below 1e.30"):
        make().run(*([value] for value in sample), 1e-3)


def test_a_bad_sample_is_refused_and_leaves_no_trace(make):
    estimator = make()
    estimator.update(1e-3, 0.01, 2.0, 1e-3)
    before = estimator.state
    for sample in ((np.nan, 0, 0, 1e-3), (0, np.inf, 0, 1e-3), (0, 0, -np.inf, 1e-3)):
        with pytest.raises(ValueError, match="finite"):
            estimator.update(*sample)
    for dt in (0.0, -1e-3, np.nan, np.inf):
        with pytest.raises(ValueError, match="dt > 0"):
            estimator.update(1e-3, 0.0, 2.0, dt)
    assert estimator.state == before


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (([0.0, np.nan], [0, 0], [0, 0], 1e-3), r"x\[1\] is nan"),
        (([0, 0], [0, 0], [0, 0], [1e-3, 0.0]), r"dt\[1\] is 0.0, expected a positive"),
        (([0, 0], [0], [0, 0], 1e-3), r"v has shape \(1,\), but x has \(2,\)"),
        (([[0, 0]], [[0, 0]], [[0, 0]], 1e-3), "one-dimensional"),
    ],
)
def test_bad_arrays_are_refused_and_leave_no_trace(make, channels, message):
    estimator = make()
    before = estimator.state
    with pytest.raises(ValueError, match=message):
        estimator.run(*channels)
    assert estimator.state == before


def test_no_samples_change_nothing(make):
    estimator = make()
    before = estimator.state
    assert [len(series) for series in estimator.run([], [], [], [])] == [0, 0]
    assert estimator.state == before


def test_inputs_are_neither_kept_nor_changed(make, palpation):
    s = palpation(seconds=0.1)
    copies = [channel.copy() for channel in s]
    estimator = make()
    estimates = estimator.run(*s)
    assert all(map(np.array_equal, s, copies))
    assert not any(np.shares_memory(a, b) for a in estimates for b in s)


def test_a_pickle_goes_on_where_it_was_made(make, palpation):
    s = palpation(seconds=0.1, noise=0.1)
    estimator = make()
    estimator.run(*s)
    twin = pickle.loads(pickle.dumps(estimator))
    assert twin.update(2e-3, 0.01, 5.0, 1e-3) == estimator.update(2e-3, 0.01, 5.0, 1e-3)


def test_reset_makes_it_as_new(make, palpation):
    estimator = make()
    estimator.run(*palpation(seconds=0.1))
    estimator.reset()
    assert estimator.state == make().state
