from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

from teleop.studies.paper.study import finding, split_plot


def responses(effect=(0.0, 0.0, 0.0), trial=0.5, seeds=6, seed=0):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(3, 3, 3, seeds)) + trial * rng.normal(size=(3, 3, 1, seeds))
    for axis, size in enumerate(effect):
        shape = [1, 1, 1, 1]
        shape[axis] = 3
        y = y + size * np.arange(3.0).reshape(shape)
    return y


def test_equals_statsmodels_with_each_stratum_fitted_on_its_own():
    y = responses(effect=(0.3, 0.0, 0.8))
    index = np.indices(y.shape).reshape(4, -1)
    frame = pd.DataFrame(index.T, columns=["cube", "condition", "estimator", "seed"]).astype(str)
    frame["y"] = y.ravel()
    frame["trial"] = frame.cube + frame.condition + frame.seed
    got = {effect.source: effect for effect in split_plot(y)}

    trials = frame.groupby(["cube", "condition", "trial"], as_index=False).y.mean()
    between = anova_lm(ols("y ~ C(cube) * C(condition)", trials).fit())
    for source, term in {
        "cube": "C(cube)",
        "condition": "C(condition)",
        "cube x condition": "C(cube):C(condition)",
    }.items():
        row = between.loc[term]
        assert got[source].degrees == row.df
        assert got[source].error_degrees == between.df["Residual"]
        assert got[source].f == pytest.approx(row.F, rel=1e-6)
        assert got[source].p == pytest.approx(row["PR(>F)"], rel=1e-6)

    # the trials' means taken off, statsmodels has the squares but not the degrees of the error
    frame["y"] -= frame.groupby("trial").y.transform("mean")
    within = anova_lm(ols("y ~ C(estimator) * C(cube) * C(condition)", frame).fit())
    error_degrees = 9 * (6 - 1) * (3 - 1)
    error = within.sum_sq["Residual"] / error_degrees
    for source, term in {
        "estimator": "C(estimator)",
        "cube x estimator": "C(estimator):C(cube)",
        "condition x estimator": "C(estimator):C(condition)",
        "cube x condition x estimator": "C(estimator):C(cube):C(condition)",
    }.items():
        row = within.loc[term]
        assert got[source].degrees == row.df
        assert got[source].error_degrees == error_degrees
        assert got[source].f == pytest.approx(row.sum_sq / row.df / error, rel=1e-6)


def test_effect_sizes_are_fractions_of_the_variance():
    for effect in split_plot(responses(effect=(1.0, 0.0, 2.0))):
        assert 0.0 <= effect.eta_squared <= effect.partial_eta_squared <= 1.0


def test_the_finding_is_the_papers_when_only_the_estimator_matters():
    text = finding(split_plot(responses(effect=(0.0, 0.0, 3.0))))
    assert "only the estimator has an effect" in text


def test_the_finding_names_other_factors_that_matter():
    text = finding(split_plot(responses(effect=(5.0, 0.0, 1.0))))
    assert "Most variance is due to cube" in text
    assert "unlike in the paper" in text


def test_noise_alone_is_rarely_an_effect():
    p = [e.p for seed in range(200) for e in split_plot(responses(seed=seed))]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.02)


@pytest.mark.parametrize(
    ("y", "message"),
    [(np.zeros((3, 3, 3, 1)), "at least 2 seeds"), (np.full((3, 3, 3, 2), np.nan), "not finite")],
)
def test_data_that_allows_no_analysis_is_refused(y, message):
    with pytest.raises(ValueError, match=message):
        split_plot(y)
