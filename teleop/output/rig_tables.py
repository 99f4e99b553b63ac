"""What `teleop rig` prints."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from rich import box
from rich.live import Live
from rich.table import Table

from teleop.output.tables import number, plain_console, print_rejected, small

if TYPE_CHECKING:
    from drivers.ports import Port
    from teleop.rig.channel_check import ChannelReport
    from teleop.rig.drive_check import DriveReport

SHOWN_IN = {
    "master_force": ("N", 1.0),
    "contact_force": ("N", 1.0),
    "master_position": ("mm", 1e3),
    "slave_position": ("mm", 1e3),
    "slave_velocity": ("mm/s", 1e3),
}
"""Unit in which a channel is shown, and how many of it make the SI unit."""


def table(title: str, *headings: str) -> Table:
    """An empty table: the first two columns are text, the others numbers."""
    made = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, title_style="bold")
    for i, heading in enumerate(headings):
        made.add_column(heading, justify="left" if i < 2 else "right", no_wrap=True)
    return made


def channels_table(title: str, channels: Sequence[ChannelReport]) -> Table:
    """Every channel as it comes in."""
    made = table(
        title,
        "channel",
        "from",
        "Hz",
        "jitter",
        "age",
        "oldest [ms]",
        "mean",
        "noise",
        "",
        "at end",
    )
    for c in channels:
        unit, factor = SHOWN_IN[c.name]
        made.add_row(
            c.name,
            c.source,
            number(c.rate_hz, 1),
            number(c.jitter_s * 1e3, 2),
            number(c.age_s * 1e3, 2),
            number(c.oldest_s * 1e3, 1),
            number(c.mean * factor, 3),
            small(c.noise * factor),
            unit,
            f"{c.saturated:.0%}",
            style="red" if c.problem else "",
        )
    return made


@contextlib.contextmanager
def live_channels(stream: TextIO) -> Iterator[Callable[[list[ChannelReport]], None]]:
    """Draw the channels as they come in, where the stream is a terminal."""
    if not stream.isatty():
        yield lambda channels: None
        return
    with Live(console=plain_console(stream), transient=True, auto_refresh=False) as live:
        yield lambda channels: live.update(channels_table("listening", channels), refresh=True)


def print_check(
    name: str,
    channels: Sequence[ChannelReport],
    trips: Mapping[str, float],
    drives: Sequence[DriveReport],
    rejected: Mapping[str, Mapping[str, int]],
) -> None:
    """What the check of a rig came to."""
    from teleop.rig.channel_check import problems

    console = plain_console()
    console.print(channels_table(name, channels))
    for device, seconds in trips.items():
        console.print(f"  {device}: answers after {seconds * 1e3:.2f} ms")
    print_rejected(console, rejected)
    for drive in drives:
        parts = []
        if drive.commanded_m == drive.commanded_m:
            parts.append(f"commanded {drive.commanded_m * 1e3:.3f} mm and back")
        if drive.moved_m == drive.moved_m:
            parts.append(f"moved {drive.moved_m * 1e3:.3f} mm")
        if drive.watchdog_s == drive.watchdog_s:
            parts.append(f"stopped by its watchdog after {drive.watchdog_s * 1e3:.0f} ms")
        if parts:
            style = "red" if drive.problem else ""
            console.print(f"  {drive.name} drive: {', '.join(parts)}", style=style)
    for problem in problems(channels, drives):
        console.print(f"  {problem}", style="red")


def print_ports(ports: Sequence[Port]) -> None:
    """Ports and buses that were found."""
    console = plain_console()
    if not ports:
        console.print("no serial port and no CAN bus found")
        return
    made = table("", "kind", "in a rig file", "what it is", "hardware")
    for port in ports:
        where = f'interface = "{port.interface}", channel' if port.interface else "port"
        made.add_row(port.kind, f'{where} = "{port.name}"', port.description, port.hardware)
    console.print(made)


def print_emulation(
    name: str, ports: Mapping[str, str], out: Path, condition: str, cube: str
) -> None:
    """Where the emulated devices are, and how to run against them."""
    console = plain_console()
    console.print(f"{name}: emulated, {cube} cube, Ctrl-C ends it")
    for bus, port in ports.items():
        console.print(f"  {bus}: {port}")
    console.print(f"  run against it: teleop run --rig {out} --condition {condition} --cube {cube}")
