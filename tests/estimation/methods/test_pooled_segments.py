from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from estimation import MatchedFilter, PooledSegments
from estimation.methods import pooled_segments
from estimation.methods.pooled_segments import FEWEST

DT = 1e-3


def fits(signals, count, correlation=1.0):
    """Return value and variance of b and k of each segment of a number of samples, by numpy."""
    x, v, f = (channel[: len(channel) // count * count].reshape(-1, count) for channel in signals)
    found = []
    for segment in zip(x, v, f, strict=True):
        phi = np.column_stack((segment[1], segment[0]))
        theta, (rss,), *_ = np.linalg.lstsq(phi, segment[2])
        noise = rss * correlation / max(count - 2.0 * correlation, 1.0)
        found.append((*theta, *(noise * np.diag(np.linalg.inv(phi.T @ phi)))))
    return np.array(found)[:, :2].T, np.array(found)[:, 2:].T


def changing(palpation, seed=0, seconds=10.0, spread=0.3):
    """Return a palpation of a body whose b changes every 0.5 s."""
    x, v, f, dt = palpation(seconds=seconds, noise=0.05, seed=seed)
    b = np.random.default_rng(seed + 100).normal(0.0, spread * 20.0, round(2 * seconds))
    return x, v, f + np.repeat(b, 500) * v, dt


@pytest.mark.parametrize("correlation", [1.0, 7.0])
def test_pools_as_cochran_and_hedges_and_olkin_do(palpation, correlation):
    x, v, f, dt = changing(palpation)
    pooled = PooledSegments(0.5, correlation)
    pooled.run(x, v, f, dt)
    assert pooled.segments == 20
    values, variances = fits((x, v, f), 500, correlation)
    for (value, std), name, y, variance in zip(
        pooled.values.values(), ("b", "k"), values, variances, strict=True
    ):
        w = 1.0 / variance
        mean = (w @ y) / w.sum()
        q = w @ (y - mean) ** 2
        between = max(y.var(ddof=1) - variance.mean(), 0.0)
        assert value == pytest.approx(mean, rel=1e-9)
        disagree = q > chi2.ppf(0.999, 19)
        assert disagree == (name == "b")
        assert std == pytest.approx(math.sqrt(1.0 / w.sum() + disagree * between), rel=1e-6)
        if disagree:
            assert pooled.misfit[name] == pytest.approx(
                math.sqrt(between) / math.hypot(y.mean(), math.sqrt(between)), rel=1e-6
            )


@pytest.mark.parametrize("seed", range(5))
def test_pools_as_statsmodels_does(palpation, seed):
    from statsmodels.stats.meta_analysis import combine_effects

    x, v, f, dt = changing(palpation, seed)
    pooled = PooledSegments(0.5)
    pooled.run(x, v, f, dt)
    values, variances = fits((x, v, f), 500)
    for pool, y, variance in zip((pooled.state.b, pooled.state.k), values, variances, strict=True):
        oracle = combine_effects(y, variance, method_re="chi2")
        assert pool.count == oracle.k
        assert pool.weighted_mean == pytest.approx(oracle.mean_effect_fe, rel=1e-9)
        assert 1.0 / pool.weights == pytest.approx(oracle.var_eff_w_fe, rel=1e-9)
        assert pytest.approx(oracle.q, rel=1e-6) == pool.Q


def pool(count, q):
    return pooled_segments.Pool(count, 1.0, 0.0, q, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("freedom", [1, 2, 5, 20, 100, 1000])
def test_disagrees_beyond_the_quantile_of_chi_squared(freedom):
    limit = float(chi2.ppf(0.999, freedom))
    close = 0.04 if freedom < 10 else 0.01  # what Wilson and Hilferty's approximation is good for
    for q, expected in (((1.0 - close) * limit, False), ((1.0 + close) * limit, True)):
        assert pooled_segments.disagree(pool(freedom + 1, q)) is expected


def test_one_segment_cannot_disagree():
    assert not pooled_segments.disagree(pool(1, 1e9))
    assert pooled_segments.spread(pool(1, 0.0)) == 0.0


def test_hardly_ever_flags_a_linear_plant(palpation):
    flagged = significant = 0
    for seed in range(300):
        pooled = PooledSegments(0.1)
        signals = palpation(seconds=1.0, noise=0.05, seed=seed)
        pooled.run(*signals)
        flagged += bool(pooled.misfit)
        significant += any(map(pooled_segments.disagree, (pooled.state.b, pooled.state.k)))
    assert flagged < 3
    assert significant < 3


def test_hardly_ever_flags_a_linear_plant_behind_the_filter(palpation):
    conditioner = MatchedFilter(20.0)
    flagged = 0
    for seed in range(60):
        x, _, f, dt = palpation(seconds=4.0, noise=0.05, seed=seed)
        conditioner.reset()
        pooled = PooledSegments(0.5, conditioner.correlation(DT))
        pooled.run(*conditioner.run(x, f, dt)[:4])
        flagged += bool(pooled.misfit)
    assert flagged == 0


def test_interval_contains_the_true_values_of_a_linear_plant(palpation):
    inside = []
    for seed in range(200):
        pooled = PooledSegments(0.25)
        pooled.run(*palpation(seconds=1.0, noise=0.05, seed=seed))
        (b, b_std), (k, k_std) = pooled.values.values()
        inside.append((abs(b - 20.0) < 1.96 * b_std, abs(k - 2100.0) < 1.96 * k_std))
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 0.05)


def hysteretic(frequency, seconds, seed=0):
    """Return signals of a body with a constant loss per cycle: b = 60 / frequency."""
    t = np.arange(0.0, seconds, DT)
    w = 2.0 * np.pi * frequency
    x, v = 5e-3 + 3e-3 * np.sin(w * t), 3e-3 * w * np.cos(w * t)
    noise = np.random.default_rng(seed).normal(0.0, 0.05, t.size)
    return x, v, 2100.0 * x + 60.0 / frequency * v + noise, DT


def test_flags_a_plant_whose_damping_depends_on_frequency():
    pooled = PooledSegments(1.0)
    for frequency in (1.0, 2.0, 5.0):
        alone = PooledSegments(1.0)
        alone.run(*hysteretic(frequency, 5.0))
        assert not alone.misfit
        assert alone.note(alone.run([], [], [], [])) is None
        assert alone.values["b"][0] == pytest.approx(60.0 / frequency, rel=0.05)
        estimates = pooled.run(*hysteretic(frequency, 5.0))
    assert [*pooled.misfit] == ["b"]
    note = pooled.note(estimates)
    assert note.startswith("Kelvin-Voigt does not fit: b varies by")
    assert "between the 15 segments of 1 s, more than the noise" in note
    assert pooled.values["b"][1] > 100.0 * alone.values["b"][1]


def test_recordings_of_unlike_noise_are_pooled_with_the_correlation_of_each():
    pooled, alone = PooledSegments(1.0), PooledSegments(1.0, 25.0)
    pooled.correlation = 25.0
    pooled.run(*hysteretic(1.0, 5.0))
    alone.run(*hysteretic(1.0, 5.0))
    assert pooled.values == alone.values
    assert pooled.correlation == 25.0
    with pytest.raises(ValueError, match="correlation must be at least 1"):
        pooled.correlation = 0.5


def test_a_small_spread_is_not_reported(palpation):
    pooled = PooledSegments(0.5)
    pooled.run(*changing(palpation, spread=0.05))
    assert pooled_segments.disagree(pooled.state.b)
    assert not pooled.misfit


def test_holds_until_the_first_segment_and_then_updates_once_per_segment(palpation):
    estimates = PooledSegments(0.5).run(*palpation(seconds=2.0, noise=0.05))
    assert np.isnan(estimates.k_std[:498]).all()
    assert estimates.held[:498].all()
    taken = np.flatnonzero(~estimates.held)
    assert taken[0] == pytest.approx(499, abs=1)
    assert np.ptp(estimates.k[taken[0] :][:400]) == 0.0
    assert len(np.unique(estimates.k[taken[0] :])) == 4


def test_a_gap_closes_a_segment(palpation):
    x, v, f, dt = (channel[:1000].copy() for channel in palpation(noise=0.05))
    dt[300] = 5.0
    f[:300] += 50.0  # another body, before the gap; no segment reaches over it
    pooled = PooledSegments(0.5)
    pooled.run(x, v, f, dt)
    values, variances = fits((x[300:], v[300:], f[300:]), 501)
    assert pooled.segments == 1
    assert pooled.values["k"][0] == pytest.approx(values[1, 0], rel=1e-9)
    assert pooled.values["k"][1] == pytest.approx(math.sqrt(variances[1, 0]), rel=1e-6)


def test_segments_of_fewer_samples_grow_until_there_are_enough(palpation):
    pooled = PooledSegments(2e-3)
    pooled.run(*palpation(seconds=1.0, noise=0.05))
    assert pooled.segments == 1000 // FEWEST


def test_a_segment_that_does_not_separate_b_and_k_is_omitted():
    t = np.arange(0.0, 4.0, DT)
    x = np.where(t < 2.0, 5e-3, 5e-3 + 3e-3 * np.sin(8.0 * t))
    v = np.where(t < 2.0, 0.0, 24e-3 * np.cos(8.0 * t))
    pooled = PooledSegments(0.5)
    pooled.run(x, v, 2100.0 * x + 20.0 * v, DT)
    assert pooled.segments == 4
    assert pooled.values["k"][0] == pytest.approx(2100.0, rel=1e-6)
    assert not pooled.misfit


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0,), "length must be positive"),
        ((math.nan,), "length must be positive"),
        ((math.inf,), "length must be positive"),
        ((1.0, 0.5), "correlation must be at least 1"),
        ((1.0, math.nan), "correlation must be at least 1"),
    ],
)
def test_a_setting_out_of_range_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        PooledSegments(*arguments)
