"""A serial force-torque sensor of Bota Systems (Rokubi, SensONE, MegaONE)."""

from __future__ import annotations

import math
from typing import Literal

from drivers.codecs.bota import FRAME, RUN, THROTTLED, BotaFrame, BotaParser, fault
from drivers.device import DeviceSettings, Sample, SerialDevice
from drivers.device_clock import MICROSECOND, WRAP, DeviceClock
from drivers.rig import RigError
from drivers.transports.serial_port import SerialPort

BAUD = 460800
"""Line rate of the sensor as it is delivered [bit/s]."""
STREAMING = 0.25
"""A sensor that is not in configuration mode is heard within this time [s]."""
FIRST_FRAME = 1.0
"""Longest wait for it [s]."""
CLOCK_JUMP = 1.0
"""The sensor's clock does not get so far ahead of ours by itself [s]."""


class BotaSettings(DeviceSettings):
    """A sensor; its filter and with that its rate are what it was set up to."""

    kind: Literal["bota"]
    bus: str


class Bota(SerialDevice):
    """A sensor; signals `fx`, `fy`, `fz` [N], `mx`, `my`, `mz` [N m] and `temperature` [degC].

    Sample times are the sensor's own, mapped to our clock, less the time that a frame takes on
    the line. While the sensor says of its values that they are none, they are not taken and
    `error` tells why. A sensor that was started anew may have lost its zero: that error stays
    until the rig is opened anew.
    """

    Settings = BotaSettings
    settings: BotaSettings

    def __init__(self, name: str, settings: BotaSettings) -> None:
        super().__init__(name, settings)
        self._parser = BotaParser(self.rejected)
        self._clock = DeviceClock()
        self._line_time = 0.0
        self._started = False
        self._restarted = ""
        self._seen: tuple[int, float] | None = None
        """Time stamp of the latest frame [us], and when it came [s]."""

    def signals(self) -> dict[str, str]:
        """Forces, moments and the sensor's temperature."""
        forces = dict.fromkeys(("fx", "fy", "fz"), "N")
        return forces | dict.fromkeys(("mx", "my", "mz"), "N m") | {"temperature": "degC"}

    def start(self, port: SerialPort) -> None:
        """Wait for the sensor's frames; if it was left in configuration mode, end that.

        Raises
        ------
        RigError
            None comes.
        """
        self._line_time = port.line_time(FRAME.size)
        self._started, self._restarted, self._seen = False, "", None
        self._clock = DeviceClock()
        if not port.wait_for(lambda: self._seen, STREAMING):
            port.write(RUN)
            if not port.wait_for(lambda: self._seen, FIRST_FRAME - STREAMING):
                raise RigError(f"{self.name}: {port.no_frame(FIRST_FRAME, 'a Bota sensor', BAUD)}")
        self.rejected.clear()
        self._started = True

    def receive(self, data: bytes, now: float) -> None:
        """Take in frames; the samples are those of the newest that is a measurement."""
        frames = self._parser.feed(data)
        if not frames:
            return
        newest = frames[-1].timestamp_us
        self._watch_clock(newest, now)
        self._clock.observe(newest, now)
        status = 0
        for frame in frames:
            status |= frame.status
            if fault(frame.status):
                continue
            if frame.status & THROTTLED:
                self.rejected["throttled"] += 1
            elif not all(map(math.isfinite, frame)):
                self.rejected["not finite"] += 1
            else:
                self._take(frame)
        self.error = self._restarted or fault(status)

    def _take(self, frame: BotaFrame) -> None:
        time = self._clock.time(frame.timestamp_us) - self._line_time
        for signal in self.samples:
            self.samples[signal] = Sample(getattr(frame, signal), time)

    def _watch_clock(self, stamp: int, now: float) -> None:
        """Notice that the sensor was started anew: its clock jumps, backward at most times."""
        if self._seen:
            before, then = self._seen
            passed = (stamp - before) % WRAP * MICROSECOND
            if passed > now - then + CLOCK_JUMP:
                self._clock = DeviceClock()
                if self._started:
                    self._restarted = "the sensor was started anew: open the rig anew"
        self._seen = stamp, now
