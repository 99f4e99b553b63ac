"""Write the report of a fault in a trial: cause, measured values, stopping time, loop timing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from drivers import CHANNELS
from teleop.files import check_drawing, write_text
from teleop.recording.black_box import BEFORE
from teleop.recording.recording import Recording
from teleop.recording.timing import RunningTiming

LISTED = (*CHANNELS, "desired_slave_velocity", "applied_slave_velocity")
"""Columns whose values at the fault are listed in the report, if the recording has them."""


def write_fault_report(folder: Path, recording: Recording, fault: dict[str, Any]) -> None:
    """Write the report of a fault that stopped a trial as text. An existing file is overwritten."""
    write_text(folder / "cause.txt", fault_text(recording, fault), overwrite=True)


def draw_fault_report(folder: Path, recording: Recording, fault: dict[str, Any]) -> None:
    """Draw the channels of a fault that stopped a trial. An existing file is overwritten."""
    path = folder / "channels.svg"
    check_drawing(str(path))
    from teleop.output.figure_files import save
    from teleop.output.trial_figures import fault_figure

    save(fault_figure(recording, fault), path, overwrite=True)


def fault_text(recording: Recording, fault: dict[str, Any]) -> str:
    """Return the report of a fault as text: cause, measured values, stopping time, loop timing.

    The parameters are those of `write_fault_report`.
    """
    t = recording["time"]
    lines = [
        f"what      {fault['text']}",
        f"kind      {fault['fault']}",
        f"where     {fault['source']}",
        f"when      {fault['time']:.4f} s",
    ]
    lines += [
        f"{name:<9} {fault[name]:.6g}"
        for name in ("value", "limit", "since")
        if fault[name] is not None
    ]
    others = [event["text"] for event in recording.events if event["fault"] and event is not fault]
    lines += [f"also      {text}" for text in others]
    at = int((t <= fault["time"]).sum()) - 1
    if at >= 0:
        lines += ["", "channels at that tick"]
        lines += [
            f"  {name:<24} {recording[name][at]: .6g} {recording.units[name]}"
            for name in LISTED
            if name in recording.units
        ]
    lines += ["", f"software  {recording.session.get('software', 'not known')}"]
    stopped = stopping_time(recording, fault)
    lines += ["", "stop", f"  commanded speed zero after {stopped * 1e3:.1f} ms"]
    before = (t > fault["time"] - BEFORE) & (t <= fault["time"])
    if before.sum() > 1:
        rate = 1.0 / float(recording["dt"][before].mean())
        running = RunningTiming()
        running.add(recording.where(before))
        timing = running.summary(rate)
        late = timing["lateness_us"]
        lines += [
            "",
            f"loop in the {t[before][-1] - t[before][0]:.1f} s before",
            f"  {timing['mean_rate_hz']:.1f} Hz, {timing['overruns']} overruns, "
            f"{timing['skipped']} periods skipped",
            f"  longest time between two ticks: {timing['longest_gap_s'] * 1e3:.1f} ms",
            f"  lateness [us]: p50 {late['p50']:.1f}, p99 {late['p99']:.1f}, max {late['max']:.1f}",
            "  lateness: from the deadline of a tick to its start. Skipped periods have no tick:",
            "  the time between two ticks contains them, the lateness does not.",
        ]
    return "\n".join(lines) + "\n"


def stopping_time(recording: Recording, fault: dict[str, Any]) -> float:
    """Return the time from a fault until the commanded velocity of the slave remains zero [s].

    The result is NaN if this velocity is not zero at the end of the recording.
    """
    t, speed = recording["time"], abs(recording["commanded_slave_velocity"])
    moving = (t >= fault["time"]) & (speed > 0.0)
    if not moving.any():
        return 0.0
    last = int(moving.nonzero()[0][-1])
    return float(t[last + 1] - fault["time"]) if last + 1 < len(t) else math.nan
