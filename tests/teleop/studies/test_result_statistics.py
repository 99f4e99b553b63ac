"""Statistics of the results of files: which recordings, factors and weights they use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_ind

from estimation.stiffening import Interval
from teleop.errors import InputError
from teleop.evaluation.across.comparison import Compared
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.studies.result_statistics import effects_on_results, repeated_results


def row(k, half=1.0, **factors):
    levels = {name: str(level) for name, level in factors.items()}
    result = StiffnessResult(
        *(k, k - half, k + half, 5.0, 4.0, 6.0), identifiable=True, damping_at_hz=1.0
    )
    return Compared("/".join(levels.values()), levels, result, {})


def treated(seed=20461501):
    """Return four recordings of each of four specimens, which are numbered in each treatment."""
    rng = np.random.default_rng(seed)
    return [
        row(offset + rng.normal(0.0, 5.0), treatment=treatment, specimen=specimen, n=n)
        for treatment in ("saline", "dry")
        for specimen in range(4)
        for offset in [1000.0 + rng.normal(0.0, 50.0)]
        for n in range(4)
    ]


def test_repeated_recordings_of_a_specimen_do_not_count_as_independent():
    rows = treated()
    means = [
        np.mean([one.result.k for one in rows[start : start + 4]]) for start in range(0, 32, 4)
    ]
    expected = ttest_ind(means[:4], means[4:])
    found = effects_on_results(rows, ["treatment"], "k", "treatment:specimen")
    (effect,) = found.model.effects
    assert effect.error_degrees == 6
    assert effect.f == pytest.approx(expected.statistic**2, rel=1e-3)
    assert effect.p == pytest.approx(expected.pvalue, rel=1e-3)
    (crossed,) = effects_on_results(rows, ["treatment"], "k").model.effects
    assert crossed.error_degrees == 3, "the same number is the same specimen"
    (alone,) = effects_on_results(rows, ["treatment"], "k", "none").model.effects
    assert alone.error_degrees == 30


def test_the_design_names_what_is_averaged_and_left_out():
    rows = treated()
    rows[0] = Compared("no result", rows[0].factors, StiffnessResult(reasons=("no contact",)), {})
    rows.append(row(1e6, specimen=1, n=9))
    text = " ".join(effects_on_results(rows, ["treatment"], "k", "specimen", ["day", "n"]).notes)
    assert "of 31 recordings" in text
    assert "Recordings that differ in n count as repetitions." in text
    assert "Without k, and left out: 1 of 32 recordings." in text
    assert "Left out: 1 of 33 recordings, whose level of treatment, specimen is not known." in text
    assert "N/m between levels of specimen" in text


def test_only_values_of_the_most_frequent_kind_are_analysed():
    rows = treated()
    for i in range(3):
        other = StiffnessResult(1e6, 9e5, 2e6, identifiable=True, storage_at_hz=1.0)
        rows[i] = Compared("k'", rows[i].factors, other, {})
    found = effects_on_results(rows, ["treatment"], "k", "treatment:specimen")
    assert found.model.recordings == 29
    assert any("only the 29 of the kind tangent are used" in note for note in found.notes)


def test_the_stiffness_at_the_tip_is_analysed_apart_from_that_in_series():
    rows = [
        replace(
            one, result=replace(one.result, k_tip=Interval(2.0 * k, 2.0 * k - 3.0, 2.0 * k + 3))
        )
        for one in treated()
        for k in [one.result.k]
    ]
    series, tip = (
        effects_on_results(rows, ["treatment"], name, "treatment:specimen")
        for name in ("k", "k_tip")
    )
    assert any("specimen and transmission in series" in note for note in series.notes)
    assert tip.model.error == pytest.approx(1.5 * 2.0 / 1.959964)
    assert tip.model.components["recording"] == pytest.approx(
        2.0 * series.model.components["recording"], rel=0.01
    )


def test_values_of_b_that_cannot_be_used_alone_are_counted():
    rows = [
        Compared(str(i), {"cube": cube}, one, {})
        for i, cube in enumerate(6 * ["soft", "hard"])
        for one in [StiffnessResult(1e3, 990.0, 1010.0, 5.0 + i, 4.0, 6.0 + 2 * i, True)]
    ]
    found = effects_on_results(rows, ["cube"], "b")
    assert not any("cannot be used" in note for note in found.notes)
    bad = StiffnessResult(1e3, 990.0, 1010.0, 5.0, 4.0, 6.0, True, b_reason="lag")
    rows[0] = Compared("0", {"cube": "soft"}, bad, {})
    found = effects_on_results(rows, ["cube"], "b")
    assert any("The b of 1 of 12 recordings cannot be used alone" in one for one in found.notes)


def test_two_operators_are_compared_for_the_objects_that_both_measured():
    rows = [
        row(1000.0 * (i + 1) + 10.0 * i + offset, operator=operator, specimen=i, n=1)
        for i in range(4)
        for operator, offset in (("A", 0.0), ("B", 50.0))
        if (i, operator) != (3, "B")
    ]
    found = repeated_results(rows, "k", ["operator", "specimen"], "operator")
    assert found.repeatability.objects == 3
    assert found.agreement.differences == pytest.approx([50.0, 50.0, 50.0])
    assert found.agreement.bias == pytest.approx((50.0, 50.0, 50.0))
    assert any("Left out, without a value for a level: 3/1." in note for note in found.notes)
    backwards = repeated_results(rows, "k", ["operator", "specimen"], "operator=B,A")
    assert backwards.agreement.bias.value == pytest.approx(-50.0)


def test_differences_in_proportion_to_the_value_are_a_constant_ratio():
    rows = [
        row(k * factor, half=0.01 * k, specimen=k, n=n)
        for k in (100.0, 300.0, 1000.0, 3000.0)
        for n, factor in enumerate((1.0, 1.1))
    ]
    measures = {
        one.quantity: one.interval
        for one in repeated_results(rows, "k", ["specimen"], logarithm=True).measures
    }
    assert measures["bias (1 / 0)"] == pytest.approx((1.1, 1.1, 1.1))
    # two values that differ by d have the standard deviation d / sqrt(2)
    variation = np.sqrt(np.expm1(0.5 * np.log(1.1) ** 2))
    assert measures["coefficient of variation within objects"].value == pytest.approx(variation)


def test_two_files_of_the_same_object_and_repetition_are_refused():
    rows = [row(1000.0 + i, specimen=i // 2, n=1) for i in range(8)]
    with pytest.raises(InputError, match=r"0/1 and 0/1 both have specimen = 0, n = 1: expected"):
        repeated_results(rows, "k", ["specimen"])


def test_a_negative_value_has_no_logarithm():
    rows = [row(-5.0 + 10.0 * i, specimen=i // 2, n=i % 2) for i in range(8)]
    with pytest.raises(InputError, match="--log: k of 0/0 is -5: expected positive values"):
        repeated_results(rows, "k", ["specimen"], logarithm=True)
