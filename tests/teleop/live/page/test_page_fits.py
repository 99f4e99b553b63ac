"""Lines of the estimators in the plot of force over displacement."""

from __future__ import annotations

import pytest

from .conftest import wait_for

LAW = """async ([further, p, x]) => {
  const { fittedForce } = await import('./fitted_force.js');
  const law = fittedForce(further);
  return law && law.force(p, x);
}"""
RECORD = """() => {
  const canvas = document.getElementById('xy'), made = CanvasRenderingContext2D.prototype;
  let path = [];
  window.paths = [];
  const { beginPath, lineTo, stroke } = made;
  made.beginPath = function () { if (this.canvas === canvas) path = []; beginPath.call(this); };
  made.lineTo = function (x, y) {
    if (this.canvas === canvas) path.push([x, y]);
    lineTo.call(this, x, y);
  };
  made.stroke = function () {
    if (this.canvas === canvas) window.paths.push([this.strokeStyle, path]);
    stroke.call(this);
  };
}"""


FORCES = [
    ([], {}, 10.0),
    (["k3"], {"k3": 4e6}, 10.5),
    (["f0"], {"f0": -2.0}, 8.0),
    (["K", "B", "n"], {"K": 4e4, "B": 70.0, "n": 2.0}, 1.0),
    (["tau"], {"tau": 0.1}, None),
    (["m"], {"m": 0.1}, None),
    (["k3", "m"], {"k3": 4e6, "m": 0.1}, None),
]
"""Further parameters of a model, their values, and the force at rest at 5 mm [N]."""


def test_a_line_is_the_force_of_the_model_at_rest(trial_feed, serve, open_page):
    page = open_page(serve(trial_feed()).url())
    for further, values, force in FORCES:
        found = page.evaluate(LAW, [further, {"k": 2000.0, **values}, 5e-3])
        assert found == (force if force is None else pytest.approx(force)), further


def lines(page):
    """Return the points of the line of each estimator, as the page draws it."""
    page.evaluate(RECORD)
    paths = wait_for(page, "window.paths.length > 4 && window.paths")
    colours = [
        page.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('--e{i}')")
        for i in range(2)
    ]
    return [
        next((path for colour, path in paths if colour == own.strip().lower()), None)
        for own in colours
    ]


def test_the_line_of_a_stiffening_model_is_curved(trial_feed, serve, open_page):
    values = {"rls_k3": 0.0, "me_k3": 2e7}
    feed = trial_feed(further=("k3",), values=values)
    page = open_page(serve(feed).url())
    wait_for(page, "teleop.rows() > 50")
    straight, curved = lines(page)

    def bend(path):
        (_, top), (_, middle), (_, bottom) = path[0], path[len(path) // 2], path[-1]
        return middle - 0.5 * (top + bottom)

    assert bend(straight) == pytest.approx(0.0, abs=0.1)
    assert bend(curved) > 5.0
    caption = page.locator("#xy-caption").inner_text().replace("\xa0", " ")
    assert caption.endswith("Lines: estimated force k x + k3 x³, without the damping part.")


def test_a_model_whose_force_depends_on_more_than_the_displacement_has_no_line(
    trial_feed, serve, open_page
):
    page = open_page(serve(trial_feed(further=("tau",))).url())
    wait_for(page, "teleop.rows() > 50")
    assert lines(page) == [None, None]
    caption = page.locator("#xy-caption").inner_text()
    assert caption.endswith(
        "No line for rls, me: the estimated force also depends on other quantities."
    )
