"""Analysis of variance of balanced designs."""

from __future__ import annotations

import builtins
from itertools import product

import numpy as np
import pytest

from teleop.errors import InputError
from teleop.studies.anova import analysis_of_variance, check_available, design_text


def trials(y):
    """Rows of an array of shape (cubes, conditions, estimators, repetitions)."""
    return [
        {
            "cube": f"cube {q}",
            "condition": f"condition {c}",
            "estimator": f"estimator {e}",
            "trial": f"{q} {c} {s}",
            "subject": f"subject {s}",
            "e_f": y[q, c, e, s],
        }
        for q, c, e, s in product(*map(range, y.shape))
    ]


def responses(effect=(0.0, 0.0, 0.0), trial=0.5, seeds=6, seed=0):
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(3, 3, 3, seeds)) + trial * rng.normal(size=(3, 3, 1, seeds))
    for axis, size in enumerate(effect):
        shape = [1, 1, 1, 1]
        shape[axis] = 3
        y = y + size * np.arange(3.0).reshape(shape)
    return y


def effects(y, subject=None):
    found = analysis_of_variance(trials(y), "e_f", ("cube", "condition"), "trial", subject)
    return {effect.source: effect for effect in found}


def test_a_split_plot_equals_a_fit_of_each_stratum_on_its_own():
    import pandas as pd
    from statsmodels.formula.api import ols
    from statsmodels.stats.anova import anova_lm

    y = responses(effect=(0.3, 0.0, 0.8))
    got = effects(y)
    frame = pd.DataFrame(trials(y))
    means = frame.groupby(["cube", "condition", "trial"], as_index=False).e_f.mean()
    between = anova_lm(ols("e_f ~ C(cube) * C(condition)", means).fit())
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

    # without the means of the trials, statsmodels has the squares but not the error's degrees
    frame["e_f"] -= frame.groupby("trial").e_f.transform("mean")
    within = anova_lm(ols("e_f ~ C(estimator) * C(cube) * C(condition)", frame).fit())
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


def test_each_effect_of_subjects_is_tested_against_its_interaction_with_them():
    y = responses(effect=(0.5, 0.0, 0.8))
    cells = y.mean(axis=(1, 2))  # cube, subject
    mean = cells.mean()
    cube = 6 * np.sum((cells.mean(axis=1) - mean) ** 2)
    left = cells - cells.mean(axis=1, keepdims=True) - cells.mean(axis=0, keepdims=True) + mean
    error = np.sum(left**2)
    effect = effects(y, subject="subject")["cube"]
    assert (effect.degrees, effect.error_degrees) == (2, 10)
    assert effect.f == pytest.approx((cube / 2) / (error / 10), rel=1e-9)
    assert effect.partial_eta_squared == pytest.approx(cube / (cube + error), rel=1e-9)


@pytest.mark.parametrize("subject", [None, "subject"])
def test_effect_sizes_are_fractions_of_the_variance(subject):
    for effect in effects(responses(effect=(1.0, 0.0, 2.0)), subject).values():
        assert 0.0 <= effect.eta_squared <= effect.partial_eta_squared <= 1.0


def test_noise_alone_is_rarely_an_effect():
    p = [e.p for seed in range(40) for e in effects(responses(seed=seed)).values()]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.02)


def test_one_estimator_or_one_level_is_no_factor():
    assert list(effects(responses()[:, :1, :1])) == ["cube"]


OTHER_SUBJECTS = [
    row | {"subject": f"{row['cube']} {row['subject']}"} for row in trials(responses(seeds=2))
]
"""Each subject has one cube only."""


@pytest.mark.parametrize(
    ("rows", "subject", "problem"),
    [
        (trials(responses(seeds=1)), None, "at least 2 trials"),
        (trials(np.full((3, 3, 3, 2), np.nan)), None, "e_f is not finite"),
        (trials(np.zeros((3, 3, 3, 2))), None, "or the same, in every trial"),
        (trials(responses(seeds=2))[:-1], None, "same number of trials"),
        (trials(np.zeros((1, 1, 1, 2))), None, "a factor with two levels"),
        (OTHER_SUBJECTS, "subject", "each subject to have all combinations"),
        ([], None, "expected at least one trial"),
        (trials(responses()[..., :1]), "subject", "expected at least 2 of subject, got 1"),
        (trials(1e200 * responses()), None, "expected e_f of at most 1e\\+100"),
        (trials(responses()[..., :1].repeat(3, axis=3)), None, "the same in all trials with the"),
        (trials(responses()[..., :1].repeat(3, axis=3)), "subject", "the same in all trials with"),
    ],
)
def test_data_that_allow_no_analysis_are_refused(rows, subject, problem):
    with pytest.raises(InputError, match=problem):
        analysis_of_variance(rows, "e_f", ("cube", "condition"), "trial", subject)


def test_without_statsmodels_the_extra_is_named(monkeypatch):
    original = builtins.__import__

    def without(name, *rest, **further):
        if name.startswith("statsmodels"):
            raise ImportError(name)
        return original(name, *rest, **further)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"pip install 'telepalpation\[stats\]'"):
        check_available()


def test_the_design_without_subjects_is_a_split_plot():
    found = analysis_of_variance(trials(responses()), "e_f", ("cube", "condition"), "trial")
    text = design_text(found, ["repetition"])
    assert text.startswith("Design: split plot. No factor is random.")
    assert "Between trials: cube, condition, tested" in text
    assert "Within a trial: estimator, tested" in text
    assert "Trials with the same levels, which differ in repetition, count as repetitions." in text
