"""The black box: the last moments before a fault and the first after it, kept at full rate."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path
from typing import Any

from teleop.files import unwritable, write_text
from teleop.output.figures import fault_figure, save
from teleop.recording.mcap_writer import McapFile
from teleop.recording.message import Layout
from teleop.recording.recording import Recording, from_messages
from teleop.recording.sinks import event_record
from teleop.recording.timing import loop_timing
from teleop.safety import Event

BEFORE, AFTER = 5.0, 1.0
"""Time kept before and after a fault [s]."""


class BlackBox:
    """Keeps the last ticks, whatever becomes of the recorder.

    Parameters
    ----------
    layout
        The ticks' message.
    rate
        Ticks a second [Hz].
    """

    def __init__(self, layout: Layout, rate: float) -> None:
        self._layout = layout
        self._messages: deque[bytes] = deque(maxlen=math.ceil((BEFORE + AFTER) * rate) + 1)
        self._events: list[Event] = []
        self.push = self._messages.append
        """Keep the message of one tick."""

    def event(self, event: Event) -> None:
        """Keep an event."""
        self._events.append(event)

    @property
    def fault(self) -> dict[str, Any] | None:
        """The event that tripped the supervisor, if any did."""
        return next((event_record(event) for event in self._events if event.fault), None)

    def recording(self, metadata: dict[str, dict[str, str]]) -> Recording:
        """What is in the box."""
        events = [event_record(event) for event in self._events]
        return from_messages(self._layout.definition, b"".join(self._messages), events, metadata)

    def write(self, folder: Path, metadata: dict[str, dict[str, str]], start: int) -> None:
        """Write the ticks, a drawing of the channels and an account of the cause.

        Parameters
        ----------
        folder
            Where to; made if it is not there.
        metadata
            Named records of text about the session.
        start
            Wall-clock time of the trial's beginning [ns].

        Raises
        ------
        InputError
            The folder cannot be written.
        """
        recording = self.recording(metadata)
        fault = fault_of(recording)
        assert fault
        layout = self._layout
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path = folder / "ticks.mcap"
            file = McapFile(path, layout.columns, layout.definition, metadata, overwrite=True)
            file.begin(start)
            for message, t in zip(self._messages, recording["time"].tolist(), strict=True):
                file.tick(message, t)
            for event in recording.events:
                file.event(event)
            file.close()
        except OSError as error:
            raise unwritable(folder, error) from error
        if file.error:
            raise unwritable(path, file.error)
        write_text(folder / "cause.txt", fault_text(recording, fault), overwrite=True)
        save(fault_figure(recording, fault), folder / "channels.svg", overwrite=True)


def fault_of(recording: Recording) -> dict[str, Any] | None:
    """The event that tripped the supervisor, if any did."""
    return next((event for event in recording.events if event["fault"]), None)


def moment(fault: dict[str, Any]) -> str:
    """When a fault was, for a sentence."""
    if fault["time"] < 0.0:
        return "before the drives were armed"
    return f"at {fault['time']:.3f} s"


def fault_text(recording: Recording, fault: dict[str, Any]) -> str:
    """What tripped, which limit, which value, since when, and the loop's timing then."""
    t = recording["time"]
    before = (t > fault["time"] - BEFORE) & (t <= fault["time"])
    at = int(before.sum()) - 1 + int((t <= fault["time"] - BEFORE).sum())
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
    if len(t) and at >= 0:
        lines += ["", "channels at that tick"]
        for name in (
            "master_force",
            "master_position",
            "slave_position",
            "contact_force",
            "slave_velocity",
            "desired_slave_velocity",
            "applied_slave_velocity",
        ):
            lines.append(f"  {name:<24} {recording[name][at]: .6g} {recording.units[name]}")
    stopped = stopping_time(recording, fault)
    lines += ["", "stop", f"  commanded speed zero after {stopped * 1e3:.1f} ms"]
    if before.sum() > 1:
        rate = 1.0 / float(recording["dt"][before].mean())
        columns = (recording[name][before] for name in ("dt", "lateness", "overrun"))
        timing = loop_timing(rate, *columns)
        late = timing["lateness_us"]
        lines += [
            "",
            f"loop in the {t[before][-1] - t[before][0]:.1f} s before",
            f"  {timing['mean_rate_hz']:.1f} Hz, {timing['overruns']} overruns, "
            f"{int(recording['skipped'][before].sum())} periods skipped",
            f"  lateness [us]: p50 {late['p50']:.1f}, p99 {late['p99']:.1f}, max {late['max']:.1f}",
        ]
    return "\n".join(lines) + "\n"


def stopping_time(recording: Recording, fault: dict[str, Any]) -> float:
    """Time from a fault until the slave's commanded speed is zero for good [s]; NaN for never."""
    t, speed = recording["time"], abs(recording["commanded_slave_velocity"])
    moving = (t >= fault["time"]) & (speed > 0.0)
    if not moving.any():
        return 0.0
    last = int(moving.nonzero()[0][-1])
    return float(t[last + 1] - fault["time"]) if last + 1 < len(t) else math.nan
