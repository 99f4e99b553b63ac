"""Tests of factors on the results of recordings, against published values and statsmodels."""

from __future__ import annotations

import numpy as np
import pytest

from teleop.errors import InputError
from teleop.evaluation.across.mixed_model import Likelihood, fit_mixed_model

VACCINE = np.array(
    [
        [-0.8893, 0.3256, 44],
        [-1.5854, 0.1946, 55],
        [-1.3481, 0.4154, 42],
        [-1.4416, 0.0200, 52],
        [-0.2175, 0.0512, 13],
        [-0.7861, 0.0069, 44],
        [-1.6209, 0.2230, 19],
        [0.0120, 0.0040, 13],
        [-0.4694, 0.0564, 27],
        [-1.3713, 0.0730, 42],
        [-0.3394, 0.0124, 18],
        [0.4459, 0.5325, 33],
        [-0.0173, 0.0714, 33],
    ]
)
"""Log risk ratios of 13 trials of a vaccine, their variances, and the latitudes: the data `dat.bcg`
of the R package metafor (Colditz et al., 1994)."""


def test_the_variance_between_recordings_with_known_errors_is_that_of_metafor():
    y, variances, latitude = VACCINE.T
    one = np.ones(13)
    for design, between, beta, std in (
        (one[:, None], 0.3132, [-0.7145], [0.1798]),
        (np.column_stack([one, latitude]), 0.0764, [0.2515, -0.0291], [0.2491, 0.0072]),
    ):
        model = Likelihood(y, np.sqrt(variances), design, [], np.zeros(13, int))
        found = model.maximised()
        solution = model.solved(found)
        assert found == pytest.approx([between], abs=1e-4)
        assert solution.beta == pytest.approx(beta, abs=1e-4)
        assert np.sqrt(np.diag(solution.covariance)) == pytest.approx(std, abs=1e-4)


def subjects_and_tissues(seed):
    """Return results of six subjects with four tissues each, two recordings of each."""
    rng = np.random.default_rng(seed)
    subject, tissue = (np.repeat(each.ravel(), 2) for each in np.mgrid[0:6, 0:4])
    y = (
        100.0 * tissue
        + rng.normal(0.0, 80.0, 6)[subject]
        + rng.normal(0.0, 150.0, (6, 4))[subject, tissue]
    )
    return y + rng.normal(0.0, 20.0, y.size), subject.astype(str), tissue.astype(str)


def test_balanced_data_without_errors_have_the_analysis_of_variance_of_repeated_measures():
    pd = pytest.importorskip("pandas")
    anova = pytest.importorskip("statsmodels.stats.anova")
    y, subject, tissue = subjects_and_tissues(20461201)
    frame = pd.DataFrame({"y": y, "subject": subject, "tissue": tissue})
    expected = anova.AnovaRM(frame, "y", "subject", ["tissue"], aggregate_func="mean").fit()
    (effect,) = fit_mixed_model(y, 0.0 * y, ["tissue"], [tissue], "subject", subject).effects
    f, degrees, error_degrees, p = expected.anova_table.loc["tissue"]
    assert (effect.degrees, effect.error_degrees) == (degrees, error_degrees)
    assert (effect.f, effect.p) == pytest.approx((f, p), rel=1e-4)


def test_unbalanced_data_without_errors_have_the_variances_of_a_mixed_model():
    models = pytest.importorskip("statsmodels.regression.mixed_linear_model")
    y, subject, _ = subjects_and_tissues(20461202)
    kept = np.arange(y.size) % 7 != 3
    y, subject, treatment = y[kept], subject[kept], (subject[kept].astype(int) % 2).astype(str)
    found = fit_mixed_model(y, 0.0 * y, ["treatment"], [treatment], "subject", subject)
    design = np.column_stack([np.ones(y.size), 2.0 * treatment.astype(float) - 1.0])
    expected = models.MixedLM(y, design, subject).fit(reml=True)
    assert found.components["subject"] ** 2 == pytest.approx(expected.cov_re[0, 0], rel=1e-3)
    assert found.components["recording"] ** 2 == pytest.approx(expected.scale, rel=1e-3)
    (effect,) = found.effects
    assert effect.f == pytest.approx(float(expected.tvalues[1]) ** 2, rel=1e-3)
    assert effect.error_degrees == 4, "six subjects with two treatments, not 41 recordings"


def test_a_recording_with_a_wide_interval_hardly_changes_the_effect():
    rng = np.random.default_rng(20461203)
    body = np.repeat(["a", "b"], 8)
    y, std = rng.normal(0.0, 1.0, 16) + 3.0 * (body == "b"), np.full(16, 0.1)
    (clear,) = fit_mixed_model(y, std, ["body"], [body]).effects
    y[0], std[0] = 60.0, 100.0
    (with_outlier,) = fit_mixed_model(y, std, ["body"], [body]).effects
    assert with_outlier.p == pytest.approx(clear.p, rel=2.0)
    assert with_outlier.p < 1e-3
    (unweighted,) = fit_mixed_model(y, np.full(16, 0.1), ["body"], [body]).effects
    assert unweighted.p > 0.1


def test_results_that_scatter_less_than_their_intervals_are_tested_with_the_intervals():
    y = np.array([1.0, 1.1, 1.2, 2.0, 2.1, 2.2])
    body = [*"aaabbb"]
    (narrow,) = fit_mixed_model(y, np.full(6, 0.01), ["body"], [body]).effects
    (wide,) = fit_mixed_model(y, np.full(6, 1.0), ["body"], [body]).effects
    assert narrow.p < 1e-3
    assert wide.f == pytest.approx(1.0 / (1.0 / 3.0 + 1.0 / 3.0)), "difference 1, variances 1"


@pytest.mark.parametrize(
    ("levels", "problem"),
    [
        ([[*"aabb"], [*"xxyy"]], "2 combinations of the levels of body, day have no recording"),
        ([[*"aabb"], [*"xyxy"]], "too few recordings"),
        ([[*"aaaa"]], "expected a factor with two levels or more"),
    ],
)
def test_a_design_that_cannot_be_tested_is_refused(levels, problem):
    y = np.array([1.0, 2.0, 4.0, 7.0])
    with pytest.raises(InputError, match=problem):
        fit_mixed_model(y, 0.1 * y, ["body", "day"][: len(levels)], levels)
