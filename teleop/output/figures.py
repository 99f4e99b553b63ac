"""The paper's Figure 3 for any run: stiffness over displacement, damping over velocity."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimation import Estimates
from estimation.compiled import Floats
from estimation.estimator import LEVEL_95
from estimation.redundancy import Ambiguity
from teleop.files import new_file
from teleop.printable import printable
from teleop.recording.recording import Recording

STYLES: dict[str, dict[str, Any]] = {
    "rls": {"color": "#0072B2", "linewidth": 2.4, "alpha": 0.55},
    "ai": {"color": "#D55E00", "linewidth": 1.2},
    "me": {"color": "#000000", "linewidth": 1.0, "linestyle": (0, (4, 2))},
}
"""Told apart where lines coincide, in print and by the colour-blind (Okabe and Ito)."""
PROFILE = "#8C8C8C"
LONGEST_TITLE = 120
"""Most characters of a title; a longer one leaves no room for the figure."""


def estimates_figure(
    title: str, t: Floats, x: Floats, v: Floats, estimates: Mapping[str, Estimates]
) -> Figure:
    """Estimated stiffness with the displacement profile, damping with the velocity profile.

    Parameters
    ----------
    title
        What was run.
    t, x, v
        Time [s], displacement [m], velocity [m/s], each of shape (n,).
    estimates
        The estimates by estimator.
    """
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    scale, prefix = (1e-6, "MN/m") if largest_k(estimates) >= 1e6 else (1e-3, "kN/m")
    for i, (name, series) in enumerate(estimates.items()):
        style = STYLES.get(name, {"color": colormaps["tab20"](i % 20), "linewidth": 1.0})
        upper.plot(t, series.k * scale, label=label(name), **style)
        lower.plot(t, series.b, **style)
    first = next(iter(estimates.values()))
    interval(upper, t, first.k * scale, first.k_std * scale)
    interval(lower, t, first.b, first.b_std)
    upper.set_title(plain(title), loc="left", fontsize=11)
    upper.set_ylabel(f"stiffness $\\hat k$ [{prefix}]")
    lower.set_ylabel("damping $\\hat b$ [N s/m]")
    lower.set_xlabel("time [s]")
    frame(upper, [series.k * scale for series in estimates.values()], from_zero=True)
    frame(lower, [series.b for series in estimates.values()], from_zero=False)
    profile(upper, t, x * 1e3, "displacement [mm]")
    profile(lower, t, v * 1e3, "velocity [mm/s]")
    figure.legend(
        *upper.get_legend_handles_labels(),
        loc="outside upper right",
        ncols=min(len(estimates), 6),
        fontsize="medium" if len(estimates) <= 6 else "x-small",
        frameon=False,
    )
    lower.set_xlim(t[0], t[-1])
    return figure


def fault_figure(recording: Recording, fault: Mapping[str, Any]) -> Figure:
    """The channels about a fault, and the command that followed it.

    Parameters
    ----------
    recording
        Ticks about the fault.
    fault
        The event.
    """
    t = recording["time"]
    part = (t > fault["time"] - 0.5) & (t < fault["time"] + 0.5)
    ms = (t[part] - fault["time"]) * 1e3
    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    rows = figure.subplots(4, 1, sharex=True)
    panels = (
        ("force [N]", 1.0, ("contact_force", "master_force")),
        ("position [mm]", 1e3, ("slave_position", "master_position")),
        (
            "velocity [mm/s]",
            1e3,
            ("slave_velocity", "desired_slave_velocity", "applied_slave_velocity"),
        ),
        ("lateness [ms]", 1e3, ("lateness",)),
    )
    colours = ("#0072B2", "#D55E00", "#000000")
    for axes, (label, scale, names) in zip(rows, panels, strict=True):
        for name, colour in zip(names, colours, strict=False):
            label_of = name.replace("_", " ")
            width = 2.2 if fault["source"] == name else 1.1
            axes.plot(ms, recording[name][part] * scale, color=colour, lw=width, label=label_of)
        axes.axvline(0.0, color="#CC0000", linewidth=1.0)
        axes.set_ylabel(label)
        axes.grid(alpha=0.25, linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="best", fontsize=8, framealpha=0.8, edgecolor="none")
    rows[0].set_title(plain(fault["text"]), loc="left", fontsize=11, color="#CC0000")
    rows[-1].set_xlabel(f"time since the fault at {fault['time']:.3f} s [ms]")
    return figure


def timing_figure(recording: Recording) -> Figure:
    """How late the ticks of a loop in real time began, and how long they took, as histograms.

    Parameters
    ----------
    recording
        Every tick.
    """
    figure = Figure(figsize=(8.0, 2.8), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    bins = np.logspace(-1.0, 5.0, 61)
    for panel, name, label in zip(
        axes, ("lateness", "busy_time"), ("late by [us]", "a tick takes [us]"), strict=True
    ):
        panel.hist(np.clip(recording[name] * 1e6, bins[0], bins[-1]), bins, color="#0072B2")
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_xlabel(label)
        panel.grid(alpha=0.25, linewidth=0.6)
        panel.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("ticks")
    return figure


def plain(text: str) -> str:
    """A text for a figure as it is, whatever characters a file's name has."""
    shown = printable(" ".join(text.split()))
    shown = shown if len(shown) <= LONGEST_TITLE else f"{shown[: LONGEST_TITLE - 4]} ..."
    return shown.replace("$", r"\$")


def ambiguity_figure(t: Floats, tied: Ambiguity, winner: Estimates) -> Figure:
    """The candidates that the data could not tell apart, as bands about the winner.

    Parameters
    ----------
    t
        Time of each look [s], shape (n,).
    tied
        The candidates that tied at each look.
    winner
        The multi-estimator's estimate at each look.
    """
    figure = Figure(figsize=(8.0, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    bands = (
        (upper, tied.k_low * 1e-3, tied.k_high * 1e-3, winner.k * 1e-3, "$\\hat k$ [kN/m]"),
        (lower, tied.b_low, tied.b_high, winner.b, "$\\hat b$ [N s/m]"),
    )
    for axes, low, high, best, label in bands:
        axes.fill_between(t, low, high, color="#0072B2", alpha=0.25, linewidth=0.0)
        axes.plot(t, best, color="#000000", linewidth=1.0)
        axes.set_ylabel(label)
        frame(axes, [low, high], from_zero=False, room=1.0)
    lower.set_xlabel("time [s]")
    lower.set_xlim(t[0], t[-1])
    return figure


def stiffness_figure(
    panels: Mapping[str, tuple[Floats, Mapping[str, Estimates]]], paper: Mapping[str, float]
) -> Figure:
    """Estimated stiffness of several trials, one above the other.

    Parameters
    ----------
    panels
        For each trial, by its title, time [s] and the estimates by estimator.
    paper
        The paper's average stiffness for each trial [N/m], drawn as a level.
    """
    figure = Figure(figsize=(8.0, 2.3 * len(panels) + 0.6), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True)
    for row, (title, (t, estimates)) in zip(axes, panels.items(), strict=True):
        for name, series in estimates.items():
            style: dict[str, Any] = STYLES.get(name, {})
            row.plot(t, series.k * 1e-3, label=name.upper(), **style)
        row.axhline(paper[title] * 1e-3, color=PROFILE, linewidth=0.9, label="paper, RLS average")
        row.set_title(title, loc="left", fontsize=10)
        row.set_ylabel("$\\hat k$ [kN/m]")
        frame(row, [series.k * 1e-3 for series in estimates.values()], from_zero=True, room=1.0)
        row.set_xlim(t[0], t[-1])
    axes[-1].set_xlabel("time [s]")
    figure.legend(
        *axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=4, frameon=False
    )
    return figure


def label(name: str) -> str:
    """An estimator's name as a legend has it."""
    return name.replace("_", " ").upper()


def interval(axes: Axes, t: Floats, values: Floats, std: Floats) -> None:
    """A shade over the 95 % interval, where there is one."""
    half = LEVEL_95 * std
    axes.fill_between(t, values - half, values + half, color="#0072B2", alpha=0.12, linewidth=0)


def largest_k(estimates: Mapping[str, Estimates]) -> float:
    """Largest of the estimators' median stiffnesses [N/m]."""
    return max(float(np.median(np.abs(series.k))) for series in estimates.values())


def frame(axes: Axes, series: list[Floats], from_zero: bool, room: float = 5.0) -> None:
    """Limits that show all but each estimator's wildest 4 % of samples, and room above them."""
    low = min(float(np.percentile(s, 2)) for s in series)
    high = max(float(np.percentile(s, 98)) for s in series)
    if from_zero:
        low = min(low, 0.0)
    margin = 0.08 * (high - low) or 1.0
    axes.set_ylim(low - margin, high + room * margin)
    axes.grid(alpha=0.25, linewidth=0.6)
    axes.spines["top"].set_visible(False)


def profile(axes: Axes, t: Floats, values: Floats, label: str) -> None:
    """The motion as a thin grey line on an axis of its own, behind the estimates."""
    twin = axes.twinx()
    twin.plot(t, values, color=PROFILE, linewidth=0.8, alpha=0.8)
    twin.set_ylabel(label, color=PROFILE)
    twin.tick_params(axis="y", colors=PROFILE)
    twin.spines["top"].set_visible(False)
    axes.set_zorder(twin.get_zorder() + 1)
    axes.patch.set_visible(False)


def save(figure: Figure, path: Path, overwrite: bool = False) -> None:
    """Write a figure; the format follows the file's ending.

    Parameters
    ----------
    figure
        What to write.
    path
        The file.
    overwrite
        Whether to overwrite a file of that name.

    Raises
    ------
    InputError
        The file cannot be written, or is there already.
    """
    with new_file(path, overwrite) as file:
        render(figure, file, dpi=150, format=path.suffix[1:].lower())


def render(figure: Figure, file: IO[Any], **options: Any) -> None:
    """Write a figure to a file; a character that the font does not have becomes a box."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(file, **options)
