"""Print tables of a rig: channels, drives, ports, zero offsets and lag."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from rich import box
from rich.console import Group
from rich.live import Live

from drivers.rig import UNITS as CHANNEL_UNITS
from estimation.quantities import SIGNALS, STIFFNESS
from teleop.control.tare import Tare
from teleop.output.console import TrimmedTable, fitting_tables, number, plain_console, small
from teleop.output.next_command import print_command
from teleop.output.trial_tables import print_rejected

if TYPE_CHECKING:
    from drivers.ports import Port

Row = Mapping[str, Any]
"""Result of the check of a channel or drive: values by the name of the field."""
SHOWN_IN = {one.si: one for one in SIGNALS.values()}
"""How a channel is shown, by its SI unit."""


def table(title: str, *headings: str) -> TrimmedTable:
    """Return an empty table: two columns of text, then numbers."""
    made = TrimmedTable(title=title, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold")
    for i, heading in enumerate(headings):
        made.add_column(heading, justify="left" if i < 2 else "right", no_wrap=True)
    return made


CHANNEL_HEADINGS = (
    "channel",
    "from",
    "rate [Hz]",
    "jitter [ms]",
    "age [ms]",
    "oldest [ms]",
    "mean",
    "noise rms",
    "at range end",
)
"""Headings of the table of the channels."""


def channel_tables(title: str, channels: Sequence[Row]) -> list[TrimmedTable | str]:
    """Return the table of the channels, divided if it is too wide for the terminal."""
    rows = []
    for c in channels:
        shown = SHOWN_IN[CHANNEL_UNITS[c["name"]]]
        rows.append(
            [
                c["name"],
                c["source"],
                number(c["rate_hz"], 1),
                number(c["jitter_s"] * 1e3, 2),
                number(c["age_s"] * 1e3, 2),
                number(c["oldest_s"] * 1e3, 1),
                f"{number(shown.shown(c['mean']), 3)} {shown.unit}",
                f"{small(shown.shown(c['noise']))} {shown.unit}",
                f"{c['saturated']:.0%}",
            ]
        )
    styles = ["red" if c["problem"] else "" for c in channels]
    return fitting_tables(title, CHANNEL_HEADINGS, rows, 2, styles)


@contextlib.contextmanager
def live_channels(stream: TextIO) -> Iterator[Callable[[Sequence[Row]], None]]:
    """Show the table of the channels in a terminal, and yield the function that updates it."""
    if not stream.isatty():
        yield lambda channels: None
        return
    with Live(console=plain_console(stream), transient=True, auto_refresh=False) as live:
        yield lambda channels: live.update(
            Group(*channel_tables("listening", channels)), refresh=True
        )


def print_check(check: Mapping[str, Any]) -> None:
    """Print the result of the check of a rig: channels, devices, drives and problems."""
    console = plain_console()
    for part in channel_tables(check["rig"], check["channels"]):
        console.print(part)
    for device, seconds in check["round_trip_s"].items():
        console.print(f"  {device}: answers after {seconds * 1e3:.2f} ms")
    print_rejected(console, check["rejected"])
    for drive in check["drives"]:
        parts = []
        if math.isfinite(drive["commanded_m"]):
            parts.append(f"commanded {drive['commanded_m'] * 1e3:.3f} mm and back")
        if math.isfinite(drive["moved_m"]):
            parts.append(f"moved {drive['moved_m'] * 1e3:.3f} mm ({drive['ratio']:.0%})")
        if math.isfinite(drive["watchdog_s"]):
            parts.append(f"stopped by its watchdog after {drive['watchdog_s'] * 1e3:.0f} ms")
        if parts:
            style = "red" if drive["problem"] else ""
            console.print(f"  {drive['name']} drive: {', '.join(parts)}", style=style)
        if drive["remark"]:
            console.print(f"  {drive['name']} drive: {drive['remark']}", style="yellow")
    for problem in check["problems"]:
        console.print(f"  {problem}", style="red")


def print_ports(ports: Sequence[Port]) -> None:
    """Print the serial ports and CAN buses of this machine, and how a rig file refers to them."""
    console = plain_console()
    if not ports:
        console.print("no serial port and no CAN bus found")
        return
    made = table("", "kind", "in a rig file", "what it is", "hardware")
    for port in ports:
        where = f'interface = "{port.interface}", channel' if port.interface else "port"
        made.add_row(port.kind, f'{where} = "{port.name}"', port.description, port.hardware)
    console.print(made)


def print_kinds(kinds: Sequence[Row]) -> None:
    """Print the kinds of devices of a rig file: one paragraph, or one line with its problem."""
    console = plain_console()
    for kind in kinds:
        head = f"{kind['name']} ({kind['package']} {kind['version']})"
        if kind["problem"]:
            console.print(f"{head}: cannot be used: {kind['problem']}", soft_wrap=True)
            continue
        buses = " or ".join(kind["buses"])
        emulated = "emulated" if kind["emulated"] else "not emulated"
        console.print(f"{head}: {f'{buses} bus' if buses else 'no bus'}, {emulated}")
        if kind["signals"] is None:
            console.print("  signals and drives as in its section of the rig file")
            continue
        signals = [f"{name} [{unit}]" for name, unit in kind["signals"].items()]
        console.print(f"  signals: {', '.join(signals)}")
        for name, accepted in kind["drives"].items():
            console.print(f"  drive {name}: accepts {accepted}")


def print_emulation(
    name: str,
    ports: Mapping[str, str],
    out: Path,
    palpation: Mapping[str, Any],
    has_slave: bool = True,
) -> None:
    """Print the ports of an emulated rig, and the command that starts a trial with this rig.

    The devices of an emulated rig are simulated. They communicate over ports with the same
    protocols as the real devices. `has_slave`: False for the master side of two
    stations.
    """
    console = plain_console()
    body = f"{palpation['specimen']} cube, depth {palpation['depth'].removesuffix('mm')} mm"
    console.print(f"{name}: emulated, {body}, Ctrl-C ends it")
    for bus, port in ports.items():
        console.print(f"  {bus}: {port}")
    console.print("  for another operator, cube or depth, type it and Enter: mimic medium 5mm")
    options = [word for name, value in palpation.items() for word in (f"--{name}", value)]
    if not has_slave:
        run = ["teleop", "station", "master", str(out), "--connect", "ADDRESS", "--key", "FILE"]
        print_command("  run against it", run)
        return
    any_condition = "" if "condition" in palpation else ", with any --condition"
    print_command(
        f"  run against it{any_condition}", ["teleop", "run", "--rig", str(out), *options]
    )


def print_lag(summary: Mapping[str, Any], out: Path | None = None) -> None:
    """Print the result of `ForceLag.summary`, with the true values for the simulated rig.

    `out` is the file with the values; None if none was written.
    """
    console = plain_console()
    low, high = summary["lag_low_s"] * 1e3, summary["lag_high_s"] * 1e3
    lost_low, lost_high = summary["lost_motion_low_m"] * 1e6, summary["lost_motion_high_m"] * 1e6
    share = ""
    if summary["separable"]:
        share = (
            f"\n  {summary['delay_share']:.0%} of it is a pure delay, 95 % interval "
            f"{summary['delay_share_low']:.0%} to {summary['delay_share_high']:.0%}"
        )
        lost = f"{summary['lost_motion_m'] * 1e6:.1f} um, 95 % interval "
    else:
        lost = "not known, "
    console.print(
        f"lag {summary['lag_s'] * 1e3:.3f} ms, 95 % interval {low:.3f} to {high:.3f} ms{share}\n"
        f"lost motion {lost}{lost_low:.1f} to {lost_high:.1f} um in either direction\n"
        f"spring {STIFFNESS.text(summary['k'])}, residual {summary['rms']:.2g} N rms"
    )
    if summary["compliance_m_per_n"] is not None:
        value, low, high = (
            summary[f"compliance{end}_m_per_n"] * 1e6 for end in ("", "_low", "_high")
        )
        console.print(
            f"compliance {value:.3f} um/N, 95 % interval {low:.3f} to {high:.3f} um/N "
            "(the spring in series)"
        )
    if not summary["separable"]:
        console.print(
            "lag and lost motion cannot be separated: all strokes have about the same speed. "
            "The lag is\nthat of a rig without lost motion. Record several frequencies or "
            "amplitudes."
        )
    if "true_lag_s" in summary:
        console.print(
            f"true lag (simulated) {summary['true_lag_s'] * 1e3:.3f} ms, "
            f"lost motion {summary['true_lost_motion_m'] * 1e6:.1f} um, "
            f"compliance {summary['true_compliance_m_per_n'] * 1e6:.3f} um/N"
        )
    command = ["teleop", "estimate", "FILE"]
    if out:
        print_command("correct the results with", [*command, "--transmission", str(out)])
    else:
        options = ["--force-lag", f"{summary['lag_s'] * 1e3:.4g}ms"]
        if summary["separable"]:
            options += ["--lost-motion", f"{summary['lost_motion_m'] * 1e6:.4g}um"]
        if summary["compliance_m_per_n"] is not None:
            options += ["--compliance", f"{summary['compliance_m_per_n'] * 1e6:.4g}um/N"]
        print_command("correct the results with", [*command, *options])


def print_tare(
    tare: Tare, master_noise: float, contact_noise: float, path: Path, rig: Path | None
) -> None:
    """Print the zero offsets of a rig, and the command that starts a trial with them."""
    on_rig = ["--rig", str(rig)] if rig else []
    needed = ["--specimen", "NAME", "--depth", "DEPTH"] if rig else []
    contact = tare.slave_position
    datum = f"{contact * 1e3:+.4f} mm" if contact else "at position 0, not measured (see --contact)"
    plain_console().print(
        f"master force zero {tare.master_force:+.4f} N, noise {master_noise:.3f} N rms\n"
        f"contact force zero {tare.contact_force:+.4f} N, noise {contact_noise:.3f} N rms\n"
        f"contact datum {datum}\n"
        f"stored in {path}, {tare.date}",
        soft_wrap=True,
    )
    print_command("apply it with", ["teleop", "run", *on_rig, "--tare", str(path), *needed])
