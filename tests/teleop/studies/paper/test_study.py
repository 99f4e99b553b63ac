from __future__ import annotations

from teleop.studies.anova import Effect
from teleop.studies.paper.study import finding


def effect(source, share, p):
    return Effect(source, 2, 20, 1.0, p, share, share)


def test_the_finding_is_the_papers_when_only_the_estimator_matters():
    text = finding([effect("cube", 0.01, 0.4), effect("estimator", 0.9, 1e-9)])
    assert "only the estimator has an effect" in text


def test_the_finding_names_other_factors_that_matter():
    text = finding([effect("cube", 0.8, 1e-9), effect("estimator", 0.1, 1e-3)])
    assert "Most variance is due to cube" in text
    assert "unlike in the paper" in text


def test_the_finding_without_a_significant_effect_is_not_the_papers():
    text = finding([effect("cube", 0.1, 0.6), effect("estimator", 0.1, 0.6)])
    assert "unlike in the paper, no effect is significant" in text
