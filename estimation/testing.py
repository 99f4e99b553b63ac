"""Check the properties that every estimator must have, in tests of this or another package.

    from estimation.testing import check_estimator

    def test_it_is_an_estimator():
        check_estimator(MyEstimator())

`check_estimator` calls each function in `CHECKS` with a copy of the estimator. The name and the
docstring of the function describe a property that every estimator must have. If the estimator does
not have this property, the function raises AssertionError, or an error that the estimator raised.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from copy import deepcopy
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np

from estimation.arrays import Floats
from estimation.checks import LARGEST, checked_samples
from estimation.compiled import Samples, compiled_sweep, interpreted_sweep, numbers
from estimation.estimator import Estimates, Estimator

Check = Callable[[Estimator], None]


def columns(estimates: Estimates) -> list[Floats]:
    """Return all fields of the estimates of n samples as a list of arrays of shape (n,)."""
    further = estimates.further.values()
    b, k, b_std, k_std, held, _ = estimates
    return [b, k, b_std, k_std, held.astype(np.float64)] + [
        column for series in further for column in series
    ]


def assert_equal(first: list[Floats], second: list[Floats], message: str) -> None:
    """Raise AssertionError(message) unless both lists contain equal arrays. NaN equals NaN."""
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a, b, equal_nan=True), message


def assert_finite(estimator: Estimator, estimates: Estimates) -> None:
    """Raise AssertionError if an estimate is not finite, or a number in the state is infinite.

    The state may contain NaN, because a standard deviation that is not computed is NaN.
    """
    values = [estimates.b, estimates.k, *(s.value for s in estimates.further.values())]
    assert all(np.isfinite(value).all() for value in values), "an estimate is not finite"
    assert not np.isinf(numbers(estimator.state)).any(), "a number of the state is infinite"


def check_names_and_units(estimator: Estimator) -> None:
    """The names of the first two estimated parameters are b and k.

    For each parameter there is one name, one value, one standard deviation and one unit.
    """
    assert estimator.names[:2] == ("b", "k"), f"names are {estimator.names}, expected b, k, ..."
    sizes = {len(part) for part in (estimator.names, estimator.units)}
    sizes |= {len(estimator.state.theta), len(estimator.state.std)}
    assert len(sizes) == 1, "names, units, theta and std differ in length"


def check_online_equals_batch(estimator: Estimator) -> None:
    """One call of `run` for n samples gives exactly the same results as n calls of `update`."""
    s = palpation(estimator)
    batch = deepcopy(estimator)
    samples = zip(s.x.tolist(), s.v.tolist(), s.f.tolist(), s.dt.tolist(), strict=True)
    more = [()] * len(s.x) if s.further is None else s.further.tolist()
    online = [estimator.update(*row, further) for row, further in zip(samples, more, strict=True)]
    size = len(estimator.names) - 2
    rows = [
        (*e[:5], *(value for i in range(size) for value in (e.further[i], e.further[size + i])))
        for e in online
    ]
    expected = np.array(rows, dtype=np.float64).T
    assert_equal(columns(batch.run(*s)), list(expected), "update and run differ")
    assert repr(batch.state) == repr(estimator.state), "update and run leave different states"


def check_compiled_equals_interpreted(estimator: Estimator) -> None:
    """Compiled and interpreted code give results that are identical to the bit.

    This is checked for a palpation, also with gaps and with samples that are not processed, and for
    extreme signals (for example, all values are zero). If numba is not installed, nothing is
    checked.
    """
    if not find_spec("numba"):
        return
    s = palpation(estimator)
    samples = [s, *held_and_gaps(s), *degenerate(estimator)]
    pickled = pickle.dumps(estimator)
    for part in samples:
        check_sweeps(pickled, estimator.step_samples(checked_samples(*part)))
    some = checked_samples(*s)
    some.open[700:900] = False
    check_sweeps(pickled, estimator.step_samples(some))


def check_sweeps(pickled: bytes, samples: Samples) -> None:
    """Raise AssertionError unless compiled and interpreted code agree, for a pickled estimator."""
    fast, slow = pickle.loads(pickled), pickle.loads(pickled)
    got = compiled_sweep(fast.law, fast.state, samples)
    expected = interpreted_sweep(slow.law, slow.state, samples)
    assert np.array_equal(got, expected, equal_nan=True), "compiled and interpreted differ"
    assert repr(fast.state) == repr(slow.state), "compiled and interpreted states differ"


def check_pieces_equal_the_whole(estimator: Estimator) -> None:
    """`run` called for each part of a recording gives the same estimates as one call for all."""
    s = palpation(estimator)
    pieces = deepcopy(estimator)
    parts = []
    for i in range(0, len(s.x), 300):
        x, v, f, dt = (channel[i : i + 300] for channel in (s.x, s.v, s.f, s.dt))
        further = None if s.further is None else s.further[i : i + 300]
        parts.append(columns(pieces.run(x, v, f, dt, further)))
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    assert_equal(joined, columns(estimator.run(*s)), "pieces and the whole differ")


def check_finite_for_all_signals(estimator: Estimator) -> None:
    """Estimates are finite for random signals of any magnitude and with any sample period."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x, v, f = rng.normal(size=(3, 300)) * 10.0 ** rng.uniform(-6.0, 3.0, (3, 1))
        x *= rng.integers(0, 2, 300)
        v *= rng.integers(0, 2, 300)
        dt = rng.uniform(1e-5, 0.1, 300)
        fresh = deepcopy(estimator)
        assert_finite(fresh, fresh.run(x, v, f, dt, further_regressors(fresh, x, v, f)))


def check_degenerate_signals(estimator: Estimator) -> None:
    """Extreme signals, such as zero or very small forces, cause no error. Estimates are finite.

    Such an error is, for example, a division by zero or the logarithm of zero.
    """
    moved = deepcopy(estimator)
    moved.run(*palpation(estimator, n=50))
    starts = [pickle.dumps(start) for start in (estimator, moved)]
    for signals in degenerate(estimator):
        for start in starts:
            fresh = pickle.loads(start)  # faster than a deepcopy
            assert_finite(fresh, fresh.run(*signals))


def check_a_gap_in_the_data(estimator: Estimator) -> None:
    """Estimates remain finite after a gap between two samples, here 0.1 s to 10^5 s."""
    for seed in range(10):
        s = palpation(estimator, n=400, seed=seed)
        s.dt[200] = 10.0 ** np.random.default_rng(seed).uniform(-1.0, 5.0)
        fresh = deepcopy(estimator)
        assert_finite(fresh, fresh.run(*s))


def check_numbers_of_any_kind(estimator: Estimator) -> None:
    """Python integers and numpy numbers give the same estimate as Python floats."""
    other = deepcopy(estimator)
    further = [1.0] * (estimator.model.regressors - 2)
    for value in (1e-3, 2e-3, 4e-3):
        single = np.float32(value)
        expected = estimator.update(float(single), 10.0 * float(single), 5.0, 1e-3, further)
        speed = float(np.float32(10.0) * np.float64(single))
        got = other.update(single, speed, 5, 1e-3, further)  # type: ignore[arg-type]
        assert repr(got) == repr(expected), "the estimate depends on the type of number"


def check_bad_samples_are_rejected(estimator: Estimator) -> None:
    """An invalid sample raises ValueError and does not change the state of the estimator.

    A sample is invalid if a value is not finite or too large, if the time since the previous sample
    is not positive, or if the number of regressors is wrong.
    """
    further = [1.0] * (estimator.model.regressors - 2)
    good = (1e-3, 0.01, 2.0, 1e-3, further)
    estimator.update(*good)
    before = repr(estimator.state)
    nan, inf = float("nan"), float("inf")
    bad = [(x, 0.0, 0.0, 1e-3, further) for x in (nan, inf, -inf, 10.0 * LARGEST, 1e308)]
    bad += [(0.0, v, 0.0, 1e-3, further) for v in (nan, inf)]
    bad += [(0.0, 0.0, f, 1e-3, further) for f in (nan, -inf, 1e154)]
    bad += [(0.0, 0.0, 0.0, dt, further) for dt in (0.0, -1e-3, nan, inf)]
    bad += [(1e-3, 0.0, 2.0, 1e-3, [*further, 1.0])]
    for x, v, f, dt, more in bad:
        assert_rejected(estimator, x, v, f, dt, more)
    assert repr(estimator.state) == before, "a rejected sample changed the state"


def assert_rejected(
    estimator: Estimator, x: float, v: float, f: float, dt: float, further: list[float]
) -> None:
    """Raise AssertionError unless `update` and `run` both raise ValueError for this sample.

    The sample consists of the arguments of `Estimator.update`.
    """
    row = np.array([further]) if further else None
    rejected = 0
    for call in (
        lambda: estimator.update(x, v, f, dt, further),
        lambda: estimator.run([x], [v], [f], [dt], row),
    ):
        try:
            call()
        except ValueError:
            rejected += 1
    assert rejected == 2, f"not rejected: x={x}, v={v}, f={f}, dt={dt}, further={further}"


def check_no_samples(estimator: Estimator) -> None:
    """Empty arrays give empty estimates and do not change the state."""
    before = repr(estimator.state)
    further = np.empty((0, estimator.model.regressors - 2))
    assert [len(s) for s in estimator.run([], [], [], [], further)[:5]] == [0] * 5
    assert repr(estimator.state) == before


def check_inputs_are_not_changed_or_shared(estimator: Estimator) -> None:
    """`run` does not change its input arrays, and its results share no memory with them."""
    s = [channel for channel in palpation(estimator, n=100) if channel is not None]
    copies = [channel.copy() for channel in s]
    results = columns(estimator.run(*s))
    assert all(map(np.array_equal, s, copies)), "an input was changed"
    assert not any(np.shares_memory(a, b) for a in results for b in s), "an input is shared"


def check_pickle(estimator: Estimator) -> None:
    """A copy made by pickle gives the same results for the next samples as the estimator itself."""
    s = palpation(estimator, n=200)
    estimator.run(*s)
    twin = pickle.loads(pickle.dumps(estimator))
    assert_equal(columns(twin.run(*s)), columns(estimator.run(*s)), "the pickled copy differs")


def check_reset(estimator: Estimator) -> None:
    """`reset` restores the state that the estimator had before the first sample."""
    before = repr(estimator.state)
    estimator.run(*palpation(estimator, n=200))
    estimator.reset()
    assert repr(estimator.state) == before, "reset does not restore the initial state"


def check_hold(estimator: Estimator) -> None:
    """`hold` sets the field `held` of the estimate to True, and changes no other field.

    `held` means that the latest sample did not change the estimate.
    """
    estimator.run(*palpation(estimator))
    before = estimator.estimate
    held = estimator.hold()
    assert held.held
    assert repr(held) == repr(before._replace(held=True)), "hold changed the estimate"
    assert repr(estimator.estimate) == repr(held)


CHECKS: tuple[Check, ...] = (
    check_names_and_units,
    check_online_equals_batch,
    check_pieces_equal_the_whole,
    check_finite_for_all_signals,
    check_degenerate_signals,
    check_a_gap_in_the_data,
    check_numbers_of_any_kind,
    check_bad_samples_are_rejected,
    check_no_samples,
    check_inputs_are_not_changed_or_shared,
    check_pickle,
    check_reset,
    check_hold,
    check_compiled_equals_interpreted,
)


def check_estimator(estimator: Estimator) -> None:
    """Check that an estimator has all properties that every estimator must have.

    All functions in `CHECKS` are called.

    Parameters
    ----------
    estimator
        A new estimator. Each check gets a copy of this estimator.

    Raises
    ------
    AssertionError
        A check failed. The traceback contains the name of the check.
    """
    for check in CHECKS:
        check(deepcopy(estimator))


class CheckSignals(NamedTuple):
    """Signals of n samples. They are the arguments of `Estimator.run`."""

    x: Floats
    """Displacement [m], shape (n,)."""
    v: Floats
    """Velocity [m/s], shape (n,)."""
    f: Floats
    """Force [N], shape (n,)."""
    dt: Floats
    """Time since the previous sample [s], shape (n,)."""
    further: Floats | None = None
    """The model's regressors besides v and x, shape (n, regressors - 2)."""


def palpation(
    estimator: Estimator, n: int = 2000, noise: float = 0.1, seed: int = 0
) -> CheckSignals:
    """Return the signals of a palpation of a Kelvin-Voigt body, with noise and uneven sampling.

    The displacement is a sum of two sines around a depth of 5 mm.

    `noise` is the standard deviation of the force noise [N].
    """
    rng = np.random.default_rng(seed)
    dt = 1e-3 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, n))
    t = np.cumsum(dt)
    x = 5e-3 + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    v = 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)
    f = 20.0 * v + 2100.0 * x + rng.normal(0.0, noise, n)
    return CheckSignals(x, v, f, dt, further_regressors(estimator, x, v, f))


def further_regressors(estimator: Estimator, x: Floats, v: Floats, f: Floats) -> Floats | None:
    """Return test values of the regressors that the estimator's model has besides v and x.

    The result has the shape (n, regressors - 2). It is None if the model has only v and x.
    """
    known = {"f0": np.ones_like(x), "m": 10.0 * v, "k3": x**3, "tau": -10.0 * f}
    columns = [known[parameter] for parameter in estimator.model.further]
    return np.column_stack(columns) if columns else None


def degenerate(estimator: Estimator) -> Iterator[CheckSignals]:
    """Yield signals that can cause a division by zero, an overflow or an underflow.

    Displacement, velocity and force are zero, constant, sinusoidal or random. Their magnitudes are
    between 1e-300 and 1e9, and the sample periods are between 1e-9 s and 1e6 s.
    """
    rng = np.random.default_rng(0)
    n = 24
    zero, one, wave = np.zeros(n), np.ones(n), np.sin(np.arange(n))
    random = rng.normal(size=n)
    for x, v, f in (
        (zero, zero, zero),
        (zero, zero, one),
        (one, zero, zero),
        (one, zero, one),
        (zero, one, one),
        (one, one, one),
        (one, -one, zero),
        (wave, zero, wave),
        (wave, wave, wave),
        (wave, -wave, one),
        (zero, wave, random),
        (random, random, zero),
    ):
        for size in (1.0, 1e-9, 1e-80, 1e-160, 1e-300, 1e9):
            for period in (1e-9, 1e-3, 1e6):
                xs, vs, fs = size * x, size * v, size * f
                further = further_regressors(estimator, np.clip(xs, -1e6, 1e6), vs, fs)
                yield CheckSignals(xs, vs, fs, np.full(n, period), further)


def held_and_gaps(s: CheckSignals) -> Iterator[CheckSignals]:
    """Yield two variants of the signals `s`.

    In the first variant, x, v and f are zero for 200 samples. In the second variant, the time
    between two samples is 0.5 s at one sample, 100 s at another, and 1 us at a third.
    """
    moving = np.ones_like(s.x)
    moving[200:400] = 0.0
    yield CheckSignals(s.x * moving, s.v * moving, s.f * moving, s.dt, s.further)
    dt = s.dt.copy()
    dt[[300, 800, 801]] = (0.5, 100.0, 1e-6)
    yield s._replace(dt=dt)
