"""Figures: lines that differ, axes, thinning, fonts."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_rgb

from estimation import Estimates, Regression, least_squares
from estimation.figure_style import (
    BINS,
    WIDTHS,
    extremes,
    figure_style,
    line,
    name_ticks,
    new_figure,
)
from estimation.figures import (
    TOGETHER,
    Result,
    Truth,
    estimates_figure,
    force_figure,
    misfit_remark,
)
from estimation.stiffening import Interval
from teleop.evaluation.evaluate import EstimateSettings, evaluate
from teleop.evaluation.reading.signals import Signals
from teleop.output.figure_files import save
from teleop.output.fit_figures import fit_figure
from teleop.output.trial_figures import stiffness_figure
from teleop.output.web_page import svg

T = np.linspace(0.0, 10.0, 5000)
X, V = 4e-3 - 3e-3 * np.cos(6.0 * T), 18e-3 * np.sin(6.0 * T)


def series(k=2000.0, b=5.0, held=0):
    full = np.full(T.size, 1.0)
    return Estimates(b * full, k * full, 0.1 * b * full, 0.01 * k * full, np.arange(T.size) < held)


def figure(names, **options):
    return estimates_figure("title", T, X, V, {name: series() for name in names}, **options)


def lines(axes):
    return {one.get_label(): one for one in axes.get_lines()}


def test_the_lines_of_one_panel_differ_in_print_and_for_the_colour_blind():
    for one, other in combinations([line(i) for i in range(TOGETHER)], 2):
        grey = [np.dot(to_rgb(style["color"]), (0.299, 0.587, 0.114)) for style in (one, other)]
        dashes = [style.get("linestyle") for style in (one, other)]
        widths = [style["linewidth"] for style in (one, other)]
        assert dashes[0] != dashes[1] or (abs(grey[0] - grey[1]) > 0.1 and max(widths) > 1.5)


def test_more_estimators_have_panels_of_their_own_with_common_axes():
    together = figure([f"e{i}" for i in range(TOGETHER)])
    assert len(together.axes) == 4
    apart = figure([f"e{i}" for i in range(21)])
    drawn = [axes for axes in apart.axes if axes.has_data()]
    assert len(drawn) == 42
    assert len({axes.get_ylim() for axes in drawn}) == 2
    assert {text.get_text() for axes in drawn for text in axes.texts} == {
        f"e{i}" for i in range(21)
    }


def test_names_are_those_that_users_write():
    (legend,) = figure(["rls_conditional", "me"]).legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts[:3] == ["rls_conditional", "me", "95 % intervals"]


def shades(axes):
    """Return the lowest and the highest value of each shaded interval in a panel."""
    areas = [one.get_paths() for one in axes.collections]
    ends = [np.concatenate([path.vertices[:, 1] for path in area]) for area in areas if area]
    return [(float(one.min()), float(one.max())) for one in ends]


def test_the_intervals_of_all_estimators_are_shaded_unless_they_are_wider_than_the_panel():
    wide = series()
    wide.k_std[:] = 1e6
    shown = estimates_figure("", T, X, V, {"rls": series(), "ai": series(3000.0), "me": wide})
    k_axes, b_axes = shown.axes[:2]
    assert shades(k_axes) == [
        pytest.approx((k * (1.0 - 0.0196), k * (1.0 + 0.0196)), rel=1e-3) for k in (2.0, 3.0)
    ]
    assert len(shades(b_axes)) == 3
    low, high = b_axes.get_ylim()
    assert low < 4.02
    assert high > 5.98, "an interval that is narrower than its value is within the panel"


@pytest.mark.parametrize("names", [("rls", "me"), [f"e{i}" for i in range(7)]])
def test_the_result_is_drawn_with_its_interval_and_a_remark_stands_below_the_title(names):
    found = Result(Interval(6000.0, 5900.0, 6100.0), None, "k'")
    shown = figure(names, result=found, remark="misfit above 5%")
    k_axes, b_axes = shown.axes[:2]
    levels = {float(np.ravel(one.get_ydata())[0]) for one in k_axes.get_lines()}
    assert 6.0 in levels
    (band,) = k_axes.patches
    assert (band.get_y(), band.get_y() + band.get_height()) == pytest.approx((5.9, 6.1))
    assert k_axes.get_ylim()[1] > 6.1
    assert not b_axes.patches
    title = shown.get_suptitle() or k_axes.get_title(loc="left")
    assert title == "title\nmisfit above 5%"
    assert "result (k: k')" in [one.get_text() for one in shown.legends[0].get_texts()]


def test_the_remark_on_the_misfit_names_the_estimators_above_the_limit():
    text = misfit_remark({"rls": 0.18, "ai": 0.049, "me": 0.0541, "window": float("nan")})
    assert text == "misfit above 5%, estimates cannot be used: rls 18%, me 5.4%"
    assert misfit_remark({"rls": 0.01}) == ""


def test_the_start_does_not_set_the_axes_and_samples_before_the_first_estimate_are_not_drawn():
    start = series()
    start.k[:400], start.b[:400] = 1e6, -1e6
    shown = estimates_figure("title", T, X, V, {"rls": start, "segments": series(held=1000)})
    k_axes, b_axes = shown.axes[:2]
    assert k_axes.get_ylim()[1] < 3.0  # kN/m
    assert b_axes.get_ylim()[0] > -20.0
    drawn = lines(k_axes)["segments"]
    assert drawn.get_xdata()[np.isfinite(drawn.get_ydata())].min() == pytest.approx(2.0, abs=0.02)


def test_the_truth_is_drawn_and_within_the_axes():
    k_axes, b_axes = figure(["rls"], truth=Truth(90.0, 1500.0, 4000.0)).axes[:2]
    levels = {float(np.ravel(one.get_ydata())[0]) for one in k_axes.get_lines()}
    assert {1.5, 4.0} <= levels
    assert k_axes.get_ylim()[1] > 4.0
    assert b_axes.get_ylim()[1] > 90.0


def test_trials_of_one_cube_have_a_common_axis():
    panels = {"free": (T, {"rls": series(2000.0)}), "mimic": (T, {"rls": series(5000.0)})}
    paper = {"free": 2100.0, "mimic": 2200.0}
    same = stiffness_figure(panels, paper, same_scale=True).axes
    assert same[0].get_ylim() == same[1].get_ylim()
    assert same[0].get_ylim()[1] > 5.0
    apart = stiffness_figure(panels, paper).axes
    assert apart[0].get_ylim() != apart[1].get_ylim()


@given(st.integers(0, 30_000), st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_extremes_of_each_bin(n, seed):
    values = np.random.default_rng(seed).normal(size=n)
    kept = extremes(values)
    assert len(kept) <= 3 * BINS + 1
    assert (np.diff(kept) > 0).all()
    if n > 3 * BINS:
        edges = np.linspace(0, n, BINS + 1).astype(int)
        for reduce in (np.minimum, np.maximum):
            starts = np.searchsorted(kept, edges[:-1])
            thinned = reduce.reduceat(values[kept], starts)
            assert np.array_equal(thinned, reduce.reduceat(values, edges[:-1]))
    else:
        assert np.array_equal(kept, np.arange(n))


def test_a_pdf_has_no_type_3_fonts_and_the_width_of_its_column(tmp_path):
    with figure_style("single"):
        drawn = figure(["rls", "me"])
        save(drawn, tmp_path / "figure.pdf")
    assert drawn.get_figwidth() == WIDTHS["single"]
    content = (tmp_path / "figure.pdf").read_bytes()
    assert b"/Type3" not in content
    assert b"/CIDFontType2" in content


def test_the_size_of_a_drawing_does_not_grow_with_the_duration():
    sizes = []
    for n in (10_000, 100_000):
        t, noise = np.arange(n) * 1e-3, np.random.default_rng(0).normal(size=n)
        e = Estimates(noise, noise, abs(noise), abs(noise), np.zeros(n, dtype=bool))
        x = np.cumsum(noise)
        regression = Regression(x, noise, noise, np.full(n, 1e-3), np.empty((n, 0)))
        fit = least_squares(x, noise, noise)
        figures = (
            estimates_figure("", t, x, noise, {"rls": e}),
            force_figure("", t, regression, "rls", e, fit),
        )
        sizes.append(sum(len(svg(drawn)) for drawn in figures))
    assert sizes[1] < 1.2 * sizes[0] < 1_000_000


def test_an_svg_has_text_as_text(tmp_path):
    save(figure(["rls"]), tmp_path / "figure.svg")
    assert "95 % intervals</text>" in (tmp_path / "figure.svg").read_text()


def test_the_figure_of_the_force_has_measurement_prediction_and_model():
    f = 2000.0 * X + 5.0 * V
    regression = Regression(X, V, f, np.full(T.size, 2e-3), np.empty((T.size, 0)))
    fit = least_squares(X, V, f)
    drawn = force_figure("title", T, regression, "rls", series(), fit)
    over_t, error, over_x = drawn.axes
    assert {"measured", "predicted by rls"} <= lines(over_t).keys()
    assert np.abs(error.get_lines()[0].get_ydata()[1:]).max() == pytest.approx(0.0, abs=1e-9)
    (model,) = over_x.collections
    assert model.get_label() == "least squares of the model"
    assert model.get_zorder() < lines(over_x)["measured"].get_zorder(), "the measurement is on top"
    places, forces = model.get_paths()[0].vertices.T
    loop = [f[np.abs(X * 1e3 - 4.0) < 0.03].min(), f[np.abs(X * 1e3 - 4.0) < 0.03].max()]
    near = forces[np.abs(places - 4.0) < 0.03]
    assert (near.min(), near.max()) == pytest.approx(loop, abs=0.05)


@pytest.mark.parametrize(
    ("width", "lines_used", "rotation"), [(6.0, 1, 0.0), (2.0, 2, 0.0), (0.5, 1, 30.0)]
)
def test_names_that_do_not_fit_are_written_on_several_lines_and_slanted_only_if_they_must_be(
    width, lines_used, rotation
):
    axes = new_figure(0.5).subplots()
    name_ticks(axes, [0, 1, 2], ["free", "mimic", "autonomous"], width)
    texts = [one.get_text() for one in axes.get_xticklabels()]
    assert [one.strip() for one in texts] == ["free", "mimic", "autonomous"]
    assert len({one.count("\n") for one in texts}) == lines_used
    assert {one.get_rotation() for one in axes.get_xticklabels()} == {rotation}


@pytest.mark.parametrize("width", WIDTHS)
def test_a_figure_has_the_width_of_its_column_and_a_legend_with_long_names_is_within(width):
    with figure_style(width):
        drawn = figure(["rls_conditional", "rls_directional"], truth=Truth(1.0, 2.0, 3.0))
    assert drawn.get_figwidth() == WIDTHS[width]
    drawn.draw_without_rendering()
    (legend,) = drawn.legends
    box = legend.get_window_extent()
    assert box.x0 >= 0.0
    assert box.x1 <= drawn.bbox.x1


def test_the_residual_of_a_fit_is_that_of_the_data_without_baseline():
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 20.0, 2e-3)
    x = 4e-3 - 3e-3 * np.cos(6.0 * t)
    f = 2000.0 * x + 90e-3 * np.sin(6.0 * t) + 0.5 * t + rng.normal(0.0, 0.02, t.size)
    signals = Signals(t, x, f, np.full(t.size, 2e-3), "Position", ())
    evaluation = evaluate(signals, EstimateSettings())
    _, over_time, below = fit_figure("title", evaluation).axes
    measured, residual = (axes.get_lines()[0].get_ydata() for axes in (over_time, below))
    assert np.ptp(measured + evaluation.datum.f) == pytest.approx(np.ptp(f), rel=0.05)
    drift = 0.5 * 20.0 / np.sqrt(12.0)
    assert np.nanstd(residual) < 0.2 * drift
