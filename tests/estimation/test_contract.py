"""What every estimator keeps to."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import (
    METHODS,
    MODELS,
    AdaptiveIdentification,
    MultiEstimator,
    RecursiveLeastSquares,
    paper_preset,
)
from estimation.checks import checked_samples
from estimation.compiled import (
    WORTH_COMPILING,
    compiled_sweep,
    interpreted_sweep,
)
from estimation.records import numbers

PRESET = paper_preset("medium")
VARIANTS = {
    "rls by the sample": lambda: RecursiveLeastSquares(0.98, (100.0, 100.0)),
    "ai exact": lambda: AdaptiveIdentification(PRESET.adaptation_gain, "exact"),
    "me that never forgets": lambda: MultiEstimator(PRESET.grid, 0.0),
}
ESTIMATORS = {name: lambda name=name: METHODS[name](PRESET) for name in METHODS} | VARIANTS
LINEAR = [
    name
    for name, make in METHODS.items()
    if make(replace(PRESET, model=MODELS["datum"])).model is MODELS["datum"]
]


@pytest.fixture(params=ESTIMATORS)
def make(request):
    return ESTIMATORS[request.param]


def columns(estimates) -> list[np.ndarray]:
    """Everything that an estimator says, a column each."""
    further = estimates.further.values()
    return [*estimates[:5], *(s.value for s in further), *(s.std for s in further)]


def equal(ours, theirs) -> bool:
    """Whether two answers are the same to the bit, a deviation that is not given included."""
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(ours, theirs, strict=True))


def test_online_and_batch_give_the_same_numbers_to_the_bit(make, palpation):
    s = palpation(noise=0.1, jitter=0.3)
    online, batch = make(), make()
    samples = zip(*(channel.tolist() for channel in s), strict=True)
    expected = [(*e[:5], *e.further) for e in (online.update(*sample) for sample in samples)]
    assert equal(columns(batch.run(*s)), np.array(expected).T)
    assert repr(batch.state) == repr(online.state)


@pytest.mark.usefixtures("compiled_estimators")
def test_compiled_and_interpreted_give_the_same_numbers_to_the_bit(make, palpation):
    pytest.importorskip("numba", reason="needs the `fast` extra")
    fast, slow = make(), make()
    samples = checked_samples(*palpation(noise=0.1, jitter=0.3))
    samples.open[700:900] = False
    samples = fast.as_taken(samples)
    answers = compiled_sweep(fast.law, fast.state, samples)
    expected = interpreted_sweep(slow.law, slow.state, samples)
    assert np.array_equal(answers, expected, equal_nan=True)
    assert repr(fast.state) == repr(slow.state)


@pytest.mark.usefixtures("compiled_estimators")
def test_a_long_batch_is_the_same_as_its_pieces(make, palpation):
    s = palpation(seconds=WORTH_COMPILING / 1000 + 1.0, noise=0.1)
    whole, pieces = make(), make()
    expected = columns(whole.run(*s))
    starts = range(0, len(s.x), 3000)
    got = [columns(pieces.run(*(channel[i : i + 3000] for channel in s))) for i in starts]
    assert equal([np.concatenate(column) for column in zip(*got, strict=True)], expected)


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.integers(-6, 3), name=st.sampled_from([*ESTIMATORS]))
def test_is_finite_whatever_the_signals(seed, size, name):
    rng = np.random.default_rng(seed)
    x, v, f = rng.normal(size=(3, 300)) * 10.0 ** rng.uniform(-6.0, size, (3, 1))
    x *= rng.integers(0, 2, 300)
    v *= rng.integers(0, 2, 300)
    estimator = ESTIMATORS[name]()
    estimates = estimator.run(x, v, f, rng.uniform(1e-5, 0.1, 300))
    assert np.isfinite(estimates[:2]).all()
    assert not np.isinf(numbers(estimator.state)).any()


@settings(max_examples=80, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    gap=st.floats(0.1, 1e5),
    name=st.sampled_from([name for name in ESTIMATORS if "never forgets" not in name]),
    at=st.integers(1500, 1700),
)
def test_recovers_from_a_gap_in_the_data(seed, gap, name, at):
    if name in ("hc_double", "hc_log"):
        gap = min(gap, 1e3)
    rng = np.random.default_rng(seed)
    t = np.arange(4000) * 1e-3
    x = 5e-3 + 3e-3 * np.sin(7.0 * t)
    v = 21e-3 * np.cos(7.0 * t)
    f = 10.0 * v + 5000.0 * x + rng.normal(0.0, 0.02, t.size)
    dt = np.full(t.size, 1e-3)
    dt[at] = gap
    estimator = ESTIMATORS[name]()
    estimates = estimator.run(x, v, f, dt)
    assert np.isfinite(estimates[:2]).all()
    assert not np.isinf(numbers(estimator.state)).any()
    assert estimates.k[-1] == pytest.approx(5000.0, rel=0.05)


@pytest.mark.parametrize("name", LINEAR)
@pytest.mark.parametrize("model", [model for model in MODELS.values() if model.further])
def test_a_linear_estimator_takes_any_model(name, model, palpation):
    s = palpation(seconds=6.0)
    a, x3 = np.gradient(s.v, 1e-3), s.x**3
    signals = {"f0": np.ones_like(s.x), "m": a, "k3": x3, "tau": -np.gradient(s.f, 1e-3)}
    truth = {"f0": 2.0, "m": 0.3, "k3": 2e7, "tau": 0.02}[model.further[0]]
    regressor = signals[model.further[0]]
    f = s.f + truth * regressor
    estimator = METHODS[name](replace(PRESET, model=model))
    estimates = estimator.run(s.x, s.v, f, s.dt, regressor[:, np.newaxis])
    assert np.isfinite(estimates[:2]).all()
    if name == "rls":
        assert estimates.further[model.further[0]].value[-1] == pytest.approx(truth, rel=1e-3)
        assert estimates.k[-1] == pytest.approx(2100.0, rel=1e-3)
    with pytest.raises(ValueError, match=f"but the model {model.name} has 1"):
        estimator.run(s.x, s.v, f, s.dt)


def test_numbers_of_any_kind_give_the_same_estimate(make):
    plain, odd = make(), make()
    for value in (1e-3, 2e-3, 4e-3):
        single = np.float32(value)
        expected = plain.update(float(single), 10.0 * float(single), 5.0, 1e-3)
        given = odd.update(single, np.float32(10.0) * np.float64(single), 5, 1e-3)
        assert repr(given) == repr(expected)


@pytest.mark.parametrize("sample", [(1e308, -1e308, 1.0), (1e31, 0.0, 0.0), (0.0, 0.0, 1e154)])
def test_an_absurdly_large_sample_is_refused(make, sample):
    with pytest.raises(ValueError, match="below 1e.30"):
        make().update(*sample, 1e-3)
    with pytest.raises(ValueError, match="below 1e.30"):
        make().run(*([value] for value in sample), 1e-3)


def test_a_bad_sample_is_refused_and_leaves_no_trace(make):
    estimator = make()
    estimator.update(1e-3, 0.01, 2.0, 1e-3)
    before = repr(estimator.state)
    for sample in ((np.nan, 0, 0, 1e-3), (0, np.inf, 0, 1e-3), (0, 0, -np.inf, 1e-3)):
        with pytest.raises(ValueError, match="finite"):
            estimator.update(*sample)
    for dt in (0.0, -1e-3, np.nan, np.inf):
        with pytest.raises(ValueError, match="dt > 0"):
            estimator.update(1e-3, 0.0, 2.0, dt)
    with pytest.raises(ValueError, match="2 regressors besides v and x were given"):
        estimator.update(1e-3, 0.0, 2.0, 1e-3, (1.0, 2.0))
    assert repr(estimator.state) == before


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
    before = repr(estimator.state)
    with pytest.raises(ValueError, match=message):
        estimator.run(*channels)
    assert repr(estimator.state) == before


def test_no_samples_change_nothing(make):
    estimator = make()
    before = repr(estimator.state)
    assert [len(series) for series in estimator.run([], [], [], [])[:5]] == [0] * 5
    assert repr(estimator.state) == before


def test_inputs_are_neither_kept_nor_changed(make, palpation):
    s = palpation(seconds=0.1)
    copies = [channel.copy() for channel in s]
    estimator = make()
    estimates = estimator.run(*s)
    assert all(map(np.array_equal, s, copies))
    assert not any(np.shares_memory(a, b) for a in estimates[:5] for b in s)


def test_a_pickle_goes_on_where_it_was_made(make, palpation):
    s = palpation(seconds=0.1, noise=0.1)
    estimator = make()
    estimator.run(*s)
    estimator.update(2e-3, 0.01, 5.0, 1e-3)
    twin = pickle.loads(pickle.dumps(estimator))
    expected = repr(estimator.update(2e-3, 0.01, 5.0, 1e-3))
    assert repr(twin.update(2e-3, 0.01, 5.0, 1e-3)) == expected


def test_reset_makes_it_as_new(make, palpation):
    estimator = make()
    estimator.run(*palpation(seconds=0.1))
    estimator.reset()
    assert repr(estimator.state) == repr(make().state)


def test_hold_leaves_everything_as_it_is_and_says_so(make, palpation):
    estimator = make()
    estimator.run(*palpation(seconds=2.0, noise=0.1))
    before = estimator.estimate
    held = estimator.hold()
    assert held.held
    assert repr(held[:4]) == repr(before[:4])
    assert repr(estimator.estimate) == repr(held)
