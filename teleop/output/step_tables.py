"""Print the results of the steps of a protocol."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from teleop.output.console import plain_console, print_table
from teleop.output.result_tables import with_half

Row = Mapping[str, Any]


def print_steps(steps: Sequence[Row]) -> None:
    """Print tables of the complex stiffness, the relaxation and the creep, and other results."""
    console = plain_console()
    for title, headings, rows in step_tables(steps):
        print_table(console, title, headings, rows, left=1 + (headings is HOLD_HEADINGS))
    for line in step_lines(steps):
        console.print(f"  {line}")


def step_tables(steps: Sequence[Row]) -> Iterator[tuple[str, Sequence[str], list[list[str]]]]:
    """Yield the title, the headings and the rows of each table."""
    dynamic = [one for one in steps if "dynamic" in one]
    if dynamic:
        yield TITLE_DYNAMIC, DYNAMIC_HEADINGS, [dynamic_cells(one) for one in dynamic]
    holds = [(one, kind) for one in steps for kind in ("relaxation", "creep") if kind in one]
    if holds:
        rows = [cells for one, kind in holds for cells in decay_cells(one, kind)]
        yield TITLE_HOLDS, HOLD_HEADINGS, rows


def step_lines(steps: Sequence[Row]) -> Iterator[str]:
    """Yield a line for each step with another result, or with a reason why there is none.

    The same reason of several steps is stated for the last of them.
    """
    by_reason: dict[str, list[Row]] = {}
    for one in steps:
        if line := other_line(one):
            by_reason.setdefault(line.partition(":")[0], []).append(one)
    for same in by_reason.values():
        *others, last = same
        numbers = ", ".join(str(one["step"] + 1) for one in others)
        also = f" (and {'step' if len(others) == 1 else 'steps'} {numbers})" if others else ""
        yield f"step {last['step'] + 1}{also}, {last['text']}: {other_line(last)}"


def dynamic_rows(steps: Sequence[Row]) -> list[dict[str, float]]:
    """Return the complex stiffness of all sines, for the figure over frequency."""
    rows = []
    for found in (one["dynamic"] for one in steps if "dynamic" in one):
        if found["loss"] is None:
            continue
        storage, loss = found["storage"], found["loss"]
        halves = found["storage_half"], found["loss_half"]
        rows.append(
            {
                "frequency_hz": found["frequency"],
                "storage_n_per_m": storage,
                "storage_interval_n_per_m": halves[0],
                "loss_n_per_m": loss,
                "loss_interval_n_per_m": halves[1],
                "tan_delta": loss / storage,
                "tan_delta_interval": math.hypot(halves[1], loss / storage * halves[0]) / storage,
            }
        )
    return rows


DYNAMIC_HEADINGS = [
    *("step", "frequency [Hz]", "amplitude [mm]", "k' [N/m]", "k'' [N/m]", "tan delta"),
]
TITLE_DYNAMIC = "complex stiffness in series with the transmission, ± 95 % interval"
TITLE_HOLDS = "relaxation and creep, time constants with 95 % intervals"
HOLD_HEADINGS = ["step", "hold", "tau [s]", "interval", "amplitude", "end"]


def dynamic_cells(one: Row) -> list[str]:
    """Return the cells of a sine."""
    found = one["dynamic"]
    storage, loss, tangent = (found[name] for name in ("storage", "loss", "loss_tangent"))
    return [
        str(one["step"] + 1),
        f"{found['frequency']:g}",
        f"{found['amplitude'] * 1e3:.3g}",
        "-" if storage is None else with_half(storage, found["storage_half"]),
        "-" if loss is None else with_half(loss, found["loss_half"]),
        "-" if tangent is None else f"{tangent:.3g}",
    ]


def decay_cells(one: Row, kind: str) -> list[list[str]]:
    """Return the rows of a hold, one for each time constant."""
    found = one[kind]
    scale, unit = (1.0, "N") if kind == "relaxation" else (1e3, "mm")
    held = f"{one['held'] * 1e3:.3g} mm" if kind == "relaxation" else f"{one['held']:.3g} N"
    first = [str(one["step"] + 1), f"{kind} at {held}"]
    end = f"{found['end'] * scale:.4g} {unit}"
    if not found["parts"] or found["reason"]:
        return [[*first, "-", "", "", "" if found["reason"] and found["parts"] else end]]
    rows = []
    for part in found["parts"]:
        amplitude = f"{part['amplitude'] * scale:.3g} {unit}"
        interval = f"{part['low']:.3g} to {part['high']:.3g}"
        rows.append([*first, f"{part['tau']:.3g}", interval, amplitude, end])
        first, end = ["", ""], ""
    return rows


def other_line(one: Row) -> str:
    """Return a line about a step: its result of another kind, or why a value is not determined."""
    for part in ("dynamic", "relaxation", "creep"):
        if one.get(part) and one[part]["reason"]:
            return str(one[part]["reason"])
    if "reason" in one:
        return str(one["reason"])
    if "result" not in one:
        return ""
    result, texts = one["result"], []
    for name, unit in (("k", "N/m"), ("b", "N s/m")):
        if result[name] is not None:
            half = 0.5 * (result[f"{name}_high"] - result[f"{name}_low"])
            texts.append(f"{name} = {with_half(result[name], half)} {unit}")
    return ", ".join(texts) or "; ".join(result["reasons"][:1])
