"""Define signals, banks of estimators and tables for the benchmarks of the estimators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.table import Table

from estimation import METHODS, Axis, Bank, Gate, Grid, Preset, compiled, paper_preset

compiled.choice.is_compiled = lambda samples: True  # type: ignore[method-assign]
"""Compile `run` for any number of samples."""

RATE = 1000.0
"""Samples per second [Hz]."""
NOISE = 0.02
"""Standard deviation of the noise of the force [N]."""
B, K = 20.0, 2100.0
"""Damping [N s/m] and stiffness [N/m] of the Kelvin-Voigt plant."""
EXPONENT = 1.3
"""Exponent n of the Hunt-Crossley plant. At `DEPTH`, its b and k are `B` and `K`."""
DEPTH = 5e-3
"""Mean displacement [m]."""


def fine_preset() -> Preset:
    """Return the paper's preset for the soft cube, with a grid finer than the noise of k and b."""
    grid = Grid(b=Axis(-500.0, 500.0, 100_001), k=Axis(0.0, 40_000.0, 1_000_001))
    return replace(paper_preset("soft"), grid=grid)


def bank_of(names: Sequence[str], gated: bool = False) -> Bank:
    """Return a new bank of estimators, with the preset's gate or without one."""
    preset = fine_preset()
    gate = Gate(preset.gate) if gated and preset.gate else None
    return Bank({name: METHODS[name](preset) for name in names}, gate)


def hunt_crossley(name: str) -> bool:
    return name.startswith("hc_")


def excitation(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a persistently exciting displacement [m] and its exact derivative [m/s]."""
    x = DEPTH + 3e-3 * np.sin(8.0 * t) + 0.5e-3 * np.sin(31.0 * t)
    return x, 24e-3 * np.cos(8.0 * t) + 15.5e-3 * np.cos(31.0 * t)


def hunt_crossley_force(x: np.ndarray, v: np.ndarray, b: float, k: np.ndarray | float):
    """Return K x^n + B x^n v [N], with damping b and stiffness k at `DEPTH`."""
    relative = (x / DEPTH) ** EXPONENT
    return relative * (k * DEPTH + b * v)


def show(title: str, rows: Sequence[Sequence[str]], headings: Sequence[str]) -> None:
    table = Table(title=title, title_justify="left")
    for i, heading in enumerate(headings):
        table.add_column(heading, justify="right" if i else "left")
    for row in rows:
        table.add_row(*row)
    Console(markup=False, width=160).print(table)
