"""Figures of a sweep: means without the effects of other factors, scales, numbers, names."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import LogNorm

from teleop.output.sweep_figures import (
    SweepRows,
    level_means,
    levels_of,
    main_effects_figure,
    map_figure,
)

CONDITIONS = ("free", "mimic", "autonomous")
K = {"soft": 2000.0, "medium": 6000.0, "hard": 50000.0}
GRID = [(x, y) for x in CONDITIONS for y in K]


def rows(names=("rls", "ai"), seeds=3, spread=0.05):
    """Return the rows of a sweep in which the stiffness depends on the cube only."""
    rng = np.random.default_rng(0)
    cells = [(x, y, name) for x, y in GRID for _ in range(seeds) for name in names]
    response = [K[cube] * np.exp(rng.normal(0.0, spread)) for _, cube, _ in cells]
    factors = {"condition": [x for x, _, _ in cells], "cube": [y for _, y, _ in cells]}
    estimators = np.array([name for _, _, name in cells])
    return SweepRows(factors, estimators, np.array(response), "k [N/m]")


def test_the_interval_at_a_level_does_not_contain_the_effect_of_another_factor():
    found = rows(("rls",))
    condition, cube = (levels_of(values) for values in found.factors.values())
    means, by_cube = level_means(found.response, [condition, cube], logarithmic=True)
    assert means.mean == pytest.approx([np.exp(np.mean(np.log([*K.values()])))] * 3, rel=0.05)
    assert (means.high / means.low < 1.15).all()
    assert by_cube.mean == pytest.approx([*K.values()], rel=0.05)


@given(st.lists(st.floats(-5.0, 5.0), min_size=18, max_size=18))
def test_means_and_intervals_are_those_of_a_two_way_analysis(values):
    from scipy.stats import t

    table = np.array(values).reshape(3, 3, 2)
    a, b = (np.repeat(one.ravel(), 2).astype(float) for one in np.indices((3, 3)))
    (first, second) = level_means(table.ravel(), [levels_of(a), levels_of(b)], logarithmic=False)
    centre = table.mean()
    for axis, found in enumerate((first, second)):
        assert found.mean == pytest.approx(table.mean(axis=(1 - axis, 2)), abs=1e-9)
    fitted = first.mean[:, None] + second.mean[None, :] - centre
    variance = ((table - fitted[:, :, None]) ** 2).sum() / (18 - 5)
    half = t.ppf(0.975, 13) * np.sqrt(variance / 6)
    assert first.high - first.mean == pytest.approx([half] * 3, abs=1e-6)


def test_factors_that_change_together_are_shown_one_by_one():
    a = np.repeat([1.0, 2.0, 3.0], 4)
    response = 10.0 * a + np.tile([-1.0, 1.0, -1.0, 1.0], 3)
    for means in level_means(response, [levels_of(a), levels_of(5.0 * a)], logarithmic=False):
        assert means.mean == pytest.approx([10.0, 20.0, 30.0])
        assert (means.high - means.low < 5.0).all()


def test_one_row_at_each_level_gives_means_without_intervals():
    a = np.array([1.0, 2.0, 3.0])
    (means,) = level_means(10.0 * a, [levels_of(a)], logarithmic=False)
    assert means.mean == pytest.approx([10.0, 20.0, 30.0])
    assert np.isnan(means.low).all()


def test_positive_results_beyond_a_decade_have_a_logarithmic_axis_and_positive_intervals():
    figure = main_effects_figure(rows(seeds=1, spread=0.4))
    condition, cube = figure.axes
    assert condition.get_yscale() == cube.get_yscale() == "log"
    assert condition.get_ylabel() == "geometric mean of k [N/m]"
    assert condition.get_ylim()[0] > 0.0
    narrow = rows()._replace(response=rows().response.clip(4000.0, 8000.0))
    axes = main_effects_figure(narrow).axes[0]
    assert (axes.get_yscale(), axes.get_ylabel()) == ("linear", "mean of k [N/m]")


def test_estimators_stand_side_by_side_and_names_are_horizontal():
    figure = main_effects_figure(rows(("rls", "ai", "me")))
    figure.draw_without_rendering()
    for axes in figure.axes:
        points = [one.lines[0].get_transform().transform((0.0, 5000.0)) for one in axes.containers]
        places = sorted(x for x, _ in points)
        assert min(np.diff(places)) > 4.0 * figure.dpi / 72.0
        labels = axes.get_xticklabels()
        assert {one.get_rotation() for one in labels} == {0.0}
        boxes = [one.get_window_extent() for one in labels]
        assert not any(one.overlaps(other) for one, other in pairwise(boxes))


def test_a_map_has_numbers_and_logarithmic_colours_if_the_values_span_a_decade():
    figure = map_figure(rows(("rls",), spread=0.0), "condition", "cube")
    axes = figure.axes[0]
    texts = [one.get_text() for one in axes.texts]
    assert texts == ["2000"] * 3 + ["6000"] * 3 + ["50000"] * 3
    assert isinstance(axes.images[0].norm, LogNorm)
    signed = rows(("rls",))._replace(response=np.linspace(-3.0, 5.0, 27))
    axes = map_figure(signed, "condition", "cube").axes[0]
    assert not isinstance(axes.images[0].norm, LogNorm)
    assert len(axes.texts) == 9


def test_cells_that_are_too_small_for_numbers_have_none():
    n = 12
    a, b = (one.ravel().astype(float) for one in np.indices((n, n)))
    names = [f"e{i}" for i in range(3)]
    found = SweepRows(
        {"a": [*a] * 3, "b": [*b] * 3},
        np.repeat(names, n * n),
        np.tile(1000.0 + a + b / 7.0, 3),
        "k [N/m]",
    )
    assert not map_figure(found, "a", "b").axes[0].texts
