"""Print whether a computer can run the control loop, and what to change."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from teleop.output.console import plain_console

WORDS = {
    "yes": "this computer can run the loop",
    "with delays": "this computer can run the loop, with delays",
    "no": "this computer cannot run the loop",
}
STYLES = {"yes": "green", "with delays": "yellow", "no": "red"}


def print_machine_check(check: Mapping[str, Any]) -> None:
    """Print the document of `loop_document`: verdict, figures, reasons and what to change."""
    console = plain_console()
    rate, verdict = check["rate_hz"], check["verdict"]
    late, tick, others = check["lateness_us"], check["tick_us"], check["other_programs"]
    periods = check["ticks"] + check["skipped"]
    console.print(
        f"{rate:g} Hz: {WORDS[verdict]} (measured for {check['duration_s']:.3g} s)",
        style=STYLES[verdict],
    )
    console.print(f"  start of a tick: late by {percentiles(late)}")
    console.print(
        f"  duration of a tick: {percentiles(tick['busy'])}, of a period of {1e6 / rate:.0f} us"
    )
    if devices := tick.get("devices"):
        console.print(f"  of it to read the devices: {percentiles(devices)}")
    console.print(
        f"  missed: {check['skipped']} of {periods} periods; late by more than half a period: "
        f"{check['late_ticks']} ticks"
    )
    console.print(
        f"  longest time between two ticks: {check['longest_gap_s'] * 1e3:.1f} ms; the shortest "
        f"watchdog has {check['watchdog_s'] * 1e3:.0f} ms, which leaves "
        f"{check['margin_s'] * 1e3:.1f} ms"
    )
    if others["used"] is not None and math.isfinite(others["used"]):
        named = ", ".join(
            f"{one['name']} (process {one['process']}) {one['processors']:.2f}"
            for one in others["names"]
        )
        console.print(
            f"  other programs used {others['used']:.2f} of {others['processors']} processors"
            + (f": {named}" if named else "")
        )
    refused = [f"{name}: {why}" for name, why in check["realtime"].items() if why != "done"]
    console.print(f"  real-time settings: {'; '.join(refused) or 'all applied'}")
    for name, load in check.get("bus_load", {}).items():
        shown = "not known, its bit rate is not stated" if math.isnan(load) else f"{load:.0%}"
        console.print(f"  load of bus {name} at this rate: {shown}")
    for reason in check["reasons"]:
        console.print(f"  - {reason}", style=STYLES[verdict])
    if check["changes"]:
        console.print("what to change:")
    for change in check["changes"]:
        console.print(f"  - {change}")


def percentiles(times: Mapping[str, float]) -> str:
    """Return the percentiles of a time [us] as a text."""
    return (
        f"p50 {times['p50']:.1f}, p99 {times['p99']:.1f}, p99.9 {times['p99_9']:.1f}, "
        f"max {times['max']:.1f} us"
    )
