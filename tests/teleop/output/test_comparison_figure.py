"""The figure of `teleop compare` can be read for groups of very different size."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from teleop.evaluation.across.comparison import Compared
from teleop.evaluation.across.groups import grouped
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.output.comparison_figure import comparison_figure
from teleop.output.comparison_scales import set_scale

BY = ("condition", "cube")
SIZE = {"soft": (2400.0, -10.0), "medium": (6000.0, -60.0), "hard": (49000.0, -1700.0)}
"""Stiffness and damping of each cube."""


def compared(condition, cube, scale=1.0):
    k, b = (scale * value for value in SIZE[cube])
    result = StiffnessResult(k, 0.9 * k, 1.1 * k, b, 1.1 * b, 0.9 * b, True)
    return Compared(f"{condition}-{cube}.mcap", {"condition": condition, "cube": cube}, result, {})


def figure_of(cubes, conditions=("free", "mimic"), by=BY, missing=()):
    rows = [compared(x, cube, 1.0 + 0.1 * i) for i, x in enumerate(conditions) for cube in cubes]
    rows += [
        Compared(f"{cube}.mcap", {"condition": x, "cube": cube}, StiffnessResult(), {})
        for x, cube in missing
    ]
    return comparison_figure(rows, grouped(rows, by, {}), by)


def test_each_cube_has_its_own_axes_if_k_or_b_differs_by_more_than_a_decade():
    axes = np.reshape(figure_of(["soft", "medium", "hard"]).axes, (3, 2))
    assert [one.get_ylabel() for one in axes[:, 0]] == ["cube: soft", "cube: medium", "cube: hard"]
    assert [one.get_title() for one in axes[0]] == ["stiffness $k$ [N/m]", "damping $b$ [N s/m]"]
    assert [text.get_text() for text in axes[-1, 1].get_xticklabels()] == ["free", "mimic"]
    for row, values in zip(axes, SIZE.values(), strict=True):
        for one, value in zip(row, values, strict=True):
            assert one.get_yscale() == "linear"
            low, high = one.get_ylim()
            assert low < value < high
            assert high - low < abs(value), "the axis has the size of the values"


def test_groups_of_similar_size_share_their_axes():
    k, b = figure_of(["soft", "medium"]).axes
    assert [one.get_yscale() for one in (k, b)] == ["linear", "linear"]
    names = ["free\nsoft", "free\nmedium", "mimic\nsoft", "mimic\nmedium"]
    assert [text.get_text() for text in b.get_xticklabels()] == names


def test_with_one_factor_k_is_logarithmic_and_negative_b_is_too_beyond_zero():
    k, b = figure_of(["soft", "hard"], conditions=("free",), by=("cube",)).axes
    assert [one.get_yscale() for one in (k, b)] == ["log", "symlog"]


def test_a_cube_without_a_result_has_axes_without_numbers():
    figure = figure_of(["soft", "hard"], missing=[("free", "medium"), ("mimic", "medium")])
    axes = np.reshape(figure.axes, (3, 2))[2]
    assert [len(one.get_yticks()) for one in axes] == [0, 0]
    assert [text.get_text() for text in axes[0].texts] == ["no result", "no result"]


sizes = st.floats(1e-2, 1e4)
intervals = st.tuples(st.sampled_from([-1.0, 1.0]), sizes, st.floats(0.0, 2.0)).map(
    lambda one: tuple(sorted((one[0] * one[1], one[0] * one[1] * (1.0 - one[2]))))
)


@given(st.lists(intervals, min_size=1, max_size=6))
@example([(1e-5, 1.0), (11.0, 11.0)])
def test_on_any_axis_each_interval_ends_at_a_visible_distance_from_zero_or_is_logarithmic(found):
    axes = Figure().subplots()
    for i, (low, high) in enumerate(found):
        axes.plot([i, i], [low, high])
    set_scale(axes, found)
    axes.autoscale_view()
    assert (axes.get_yscale() == "log") <= all(low > 0.0 for low, _ in found)

    def place(value):
        return axes.transAxes.inverted().transform(axes.transData.transform((0.0, value)))[1]

    for low, high in found:
        end = max(low, high, key=abs)
        assert -1e-9 <= place(end) <= 1.0 + 1e-9
        if axes.get_yscale() != "log":
            assert abs(place(end) - place(0.0)) > 0.02
    numbers = [text.get_text() for text in axes.get_yticklabels()]
    assert len(numbers) <= 20
    assert all(
        math.isfinite(float(text.replace("\u2212", "-"))) for text in numbers if "$" not in text
    )


def test_an_axis_with_negative_values_is_logarithmic_only_if_small_values_would_be_invisible():
    for smallest, scale in ((-2.9, "linear"), (-1.5, "symlog")):
        axes = Figure().subplots()
        set_scale(axes, [(-34.0, 2.0), (smallest, smallest)])
        assert axes.get_yscale() == scale


@pytest.mark.parametrize("width", ["single", "double"])
def test_the_axes_of_the_rows_do_not_overlap(width):
    from estimation.figure_style import figure_style

    with figure_style(width):
        figure = figure_of(["soft", "medium", "hard"], ("free", "mimic", "autonomous"))
        figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    for i, one in enumerate(boxes):
        assert one.x0 >= 0.0
        assert not any(one.overlaps(other) for other in boxes[:i])


def test_the_mean_of_a_group_is_beside_its_recordings_in_one_column():
    from estimation.figure_style import figure_style

    rows = [compared(x, cube, 1.0 + 0.1 * i) for x in "abc" for cube in SIZE for i in range(4)]
    with figure_style("single"):
        figure = comparison_figure(rows, grouped(rows, BY, {}), BY)
        figure.draw_without_rendering()
    axes = figure.axes[0]
    points = [axes.transData.transform(line.get_xydata()) for line in axes.lines]
    sizes = [line.get_markersize() for line in axes.lines]
    marked = [i for i, line in enumerate(axes.lines) if line.get_marker() in ("o", "D")]
    means = [i for i in marked if axes.lines[i].get_marker() == "D"]
    assert len(means) == 3
    for mean in means:
        for other in set(marked) - {mean}:
            distance = np.abs(points[other][:, 0] - points[mean][0, 0]).min()
            assert distance > 0.5 * (sizes[mean] + sizes[other]) * figure.dpi / 72.0


def test_two_kinds_of_damping_have_different_marks_and_the_legend_states_them():
    rows = [compared("free", "soft"), compared("mimic", "soft")]
    loss = replace(rows[0].result, damping_at_hz=1.0)
    rows[0] = replace(rows[0], result=loss)
    figure = comparison_figure(rows, grouped(rows, BY, {}), BY)
    faces = [
        [line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"]
        for axes in figure.axes
    ]
    (k, b) = faces
    assert len(set(k)) == 1
    assert len(set(b)) == 2
    texts = [text.get_text() for text in figure.legends[0].get_texts()]
    assert any("besides relaxation" in text for text in texts)


def test_damping_of_one_kind_has_one_mark():
    axes = figure_of(["soft", "medium"]).axes[1]
    assert len({line.get_markerfacecolor() for line in axes.lines if line.get_marker() == "o"}) == 1


def test_damping_that_a_recording_does_not_determine_is_not_drawn():
    found = [compared("free", cube) for cube in ("soft", "medium")]
    unknown = replace(found[1].result, b=None, b_low=None, b_high=None)
    rows = [found[0], replace(found[1], result=unknown)]
    k, b = comparison_figure(rows, grouped(rows, BY, {}), BY).axes
    marks = [
        sum(line.get_marker() == "o" for container in axes.containers for line in container[:1])
        for axes in (k, b)
    ]
    assert marks == [2, 1]
    assert [text.get_text() for text in b.texts] == ["no result"]
