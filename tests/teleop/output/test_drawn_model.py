"""Figure and table of the batch models name the same best model."""

from itertools import pairwise

import numpy as np
import pytest

from estimation.figure_style import figure_style
from teleop.evaluation.evaluate import Evaluation, evaluate
from teleop.evaluation.reading.signals import Signals, periods
from teleop.evaluation.settings import EstimateSettings
from teleop.output.fit_figures import fit_figure
from teleop.output.result_tables import print_models


@pytest.fixture(scope="module")
def preloaded() -> Evaluation:
    """Return a record whose best model has parameters that are not identifiable."""
    t = np.arange(4000) / 200.0
    x = 3e-3 + 1e-3 * np.sin(np.pi * t)
    f = 5e4 * x**1.5 + np.random.default_rng(0).normal(0.0, 0.003, len(t))
    return evaluate(Signals(t, x, f, periods(t), "position"), EstimateSettings())


def test_the_figure_says_that_the_drawn_model_is_not_the_first_of_the_table(
    preloaded: Evaluation,
) -> None:
    assert preloaded.models[0].name == "hunt-crossley"
    best = preloaded.batch_summary()["best_model"]
    assert best == "kelvin-voigt"
    (legend,) = fit_figure("title", preloaded).legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert "kelvin-voigt (hunt-crossley: not all parameters identifiable)" in texts


def test_the_legend_covers_no_panel(preloaded: Evaluation) -> None:
    figure = fit_figure("title", preloaded)
    figure.draw_without_rendering()
    (legend,) = figure.legends
    box = legend.get_window_extent()
    for axes in figure.axes:
        assert axes.get_legend() is None
        assert not box.overlaps(axes.get_window_extent())


def test_the_legend_of_a_narrow_figure_is_not_cut(preloaded: Evaluation) -> None:
    with figure_style("single"):
        figure = fit_figure("title", preloaded)
        figure.draw_without_rendering()
        (legend,) = figure.legends
        box = legend.get_window_extent()
        assert box.x0 >= 0.0
        assert box.x1 <= figure.bbox.x1
        labels = [axes.yaxis.label.get_window_extent() for axes in figure.axes]
    assert not any(one.overlaps(other) for one, other in pairwise(labels))


def test_the_table_says_which_model_is_drawn_and_which_force_is_taken_for_unloaded(
    preloaded: Evaluation, capsys: pytest.CaptureFixture[str]
) -> None:
    print_models(preloaded.summary())
    out = " ".join(capsys.readouterr().out.split())
    assert "kelvin-voigt: the best model whose parameters are all identifiable" in out
    assert "hunt-crossley: the force out of contact is not known" in out
    assert "relative to the datum (mean of the motion)" in out
