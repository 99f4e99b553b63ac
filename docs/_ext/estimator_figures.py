"""Draws the figure of each estimator: the directive `{estimator-figure} NAME`.

All figures have the same motion and noise, so that they can be compared: palpation by two sines
at 500 Hz, a stiffness that doubles at 4 s, and a hold from 7 to 9 s.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from estimation import identify

DT = 2e-3
"""Sample period [s]."""
STEP, HOLD = 4.0, (7.0, 9.0)
"""When the stiffness doubles, and when the motion rests [s]."""
K, B = 2000.0, 15.0
"""Stiffness before the step [N/m] and damping [N s/m]."""
HUNT_CROSSLEY = ("hc_double", "hc_log")


def motion() -> tuple[np.ndarray, np.ndarray]:
    """Time [s] and displacement [m], each of shape (n,)."""
    t = np.arange(0.0, 12.0, DT)
    swing = np.interp(t, (HOLD[0] - 0.3, HOLD[0], HOLD[1], HOLD[1] + 0.3), (1.0, 0.0, 0.0, 1.0))
    sines = 2.5e-3 * np.sin(2 * np.pi * t) + 1e-3 * np.sin(2 * np.pi * 2.6 * t)
    return t, 5e-3 + swing * sines


def body(name: str, t: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Force [N], and the k [N/m] and b [N s/m] that the estimator should find, each (n,)."""
    v = np.gradient(x, DT)
    factor = np.where(t < STEP, 1.0, 2.0)
    if name in HUNT_CROSSLEY:
        n = 1.5
        stiffness = factor * K / 5e-3 ** (n - 1.0)
        k, b = stiffness * x ** (n - 1.0), B * (x / 5e-3) ** n
    else:
        k, b = factor * K, np.full(t.size, B)
    return b * v + k * x, k, b


def draw(name: str, path: Path) -> None:
    """Draw the estimates of one method with their 95 % intervals."""
    t, x = motion()
    f, k, b = body(name, t, x)
    noise = np.random.default_rng(0).normal(0.0, 0.1, t.size)
    found = identify(np.round(x, 6), f + noise, DT, [name], bandwidth=20.0)
    e = found.estimates[name]
    figure, panels = plt.subplots(2, 1, figsize=(7.0, 3.6), sharex=True, layout="constrained")
    for axes, value, std, truth, limits, label in (
        (panels[0], e.k, e.k_std, k, (1000.0, 5500.0), "k [N/m]"),
        (panels[1], e.b, e.b_std, b, (-60.0, 90.0), "b [N s/m]"),
    ):
        axes.axvspan(*HOLD, color="0.92", lw=0)
        axes.plot(t, truth, "k--", lw=0.9, label="truth")
        axes.plot(t, value, lw=1.2, color="#0072B2", label=name)
        if np.isfinite(std).any():
            low, high = value - 1.96 * std, value + 1.96 * std
            low, high = np.clip((low, high), -1e6, 1e6)
            shade = {"color": "#0072B2", "alpha": 0.25, "lw": 0, "label": "95 % interval"}
            axes.fill_between(t, low, high, **shade)
        axes.set(ylim=limits, xlim=(0.0, 12.0), ylabel=label)
        axes.grid(alpha=0.25)
    panels[0].legend(ncols=3, frameon=False, fontsize="small", loc="upper left")
    panels[1].set_xlabel("time [s]; grey: no motion")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)


class EstimatorFigure(SphinxDirective):
    """`{estimator-figure} NAME`."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Draw the figure and show it."""
        name = self.arguments[0]
        uri = f"generated/figures/estimator-{name}.png"
        draw(name, Path(self.env.srcdir) / uri)
        alt = f"Stiffness and damping by {name}, with a step of the stiffness and a hold"
        return [nodes.figure("", nodes.image(uri=f"/{uri}", alt=alt), align="center")]


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("estimator-figure", EstimatorFigure)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
