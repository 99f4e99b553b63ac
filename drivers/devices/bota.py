"""Driver of force-torque sensors of Bota Systems with a serial port (Rokubi, SensONE, MegaONE)."""

from __future__ import annotations

import math
from typing import Literal

from drivers.codecs.bota import FRAME, INVALID, RUN, THROTTLED, BotaFrame, BotaParser, fault
from drivers.device import DeviceSettings, Sample, SerialDevice
from drivers.device_clock import MICROSECOND, WRAP, DeviceClock
from drivers.rig import RigError, new_tuple
from drivers.transports.stream_port import StreamPort

BAUD = 460800
"""Factory setting of the sensor's line rate [bit/s]."""
STREAMING = 0.25
"""If no frame arrives in this time, the sensor is assumed to be in the configuration mode [s]."""
FIRST_FRAME = 1.0
"""Longest wait for the first frame [s]."""
LOADS = dict.fromkeys(("fx", "fy", "fz"), "N") | dict.fromkeys(("mx", "my", "mz"), "N m")
"""Units of the forces and moments, in the order of a frame."""
CLOCK_JUMP = 1.0
"""If the sensor's clock jumps by more than this time [s], it is assumed to be restarted."""


class BotaSettings(DeviceSettings):
    """Settings of a force-torque sensor of Bota Systems in the rig file.

    The driver does not set the filter of the sensor. The user must set the filter on the sensor
    itself. The filter determines the sample rate.
    """

    kind: Literal["bota"]
    bus: str


class Bota(SerialDevice):
    """A force-torque sensor of Bota Systems.

    The signals are `fx`, `fy`, `fz` [N], `mx`, `my`, `mz` [N m] and `temperature` [degC]. The time
    of a sample is computed from the time stamp that the sensor sends. The time stamp is converted
    to the controller's clock, and the transmission time of a frame is subtracted. If the sensor
    reports that measurements are invalid, they are not used, and `error` gives the reason. A
    restart of the sensor may change its zero offsets. Therefore, after a restart, `error` reports
    the restart until the rig is opened again.
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
        """Time stamp [us] and time of arrival [s] of the latest frame."""

    def signals(self) -> dict[str, str]:
        """Return the unit of each signal: forces, moments and temperature."""
        return LOADS | {"temperature": "degC"}

    def start(self, port: StreamPort) -> None:
        """Wait for the first frame of the sensor.

        A sensor in configuration mode sends no frames. If no frame arrives, this method sends the
        command that ends the configuration mode, and waits again.
        """
        self._line_time = port.line_time(FRAME.size)
        self._started, self._restarted, self._seen = False, "", None
        self._clock = DeviceClock()
        if not port.wait_for(lambda: self._seen, STREAMING):
            port.write(RUN)
            if not port.wait_for(lambda: self._seen, FIRST_FRAME - STREAMING):
                raise RigError(
                    f"{self.name}: {port.no_frame_message(FIRST_FRAME, 'a Bota sensor', BAUD)}"
                )
        self.rejected.clear()
        self._started = True

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the sensor.

        The newest frame with valid measurements sets the samples of all signals.
        """
        frames = self._parser.feed(data)
        if not frames:
            return
        newest = frames[-1].timestamp_us
        self._watch_clock(newest, now)
        self._clock.observe(newest, now)
        status, valid = 0, None
        for frame in frames:
            status |= frame.status
            if frame.status & INVALID:
                continue
            if frame.status & THROTTLED:
                self.rejected["throttled"] += 1
            elif not all(map(math.isfinite, frame)):
                self.rejected["not finite"] += 1
            else:
                valid = frame
        if valid:
            self._store(valid)
        self.error = self._restarted or fault(status)

    def _store(self, frame: BotaFrame) -> None:
        _, *loads, stamp, temperature = frame
        time, samples = self._clock.time(stamp) - self._line_time, self.samples
        for signal, value in zip(LOADS, loads, strict=True):
            samples[signal] = new_tuple(Sample, (value, time))
        samples["temperature"] = new_tuple(Sample, (temperature, time))

    def _watch_clock(self, stamp: int, now: float) -> None:
        """Detect a restart of the sensor: a jump of its clock, whose time stamps are in us."""
        if self._seen:
            before, then = self._seen
            passed = (stamp - before) % WRAP * MICROSECOND
            if passed > now - then + CLOCK_JUMP:
                self._clock = DeviceClock()
                if self._started:
                    self._restarted = "the sensor was restarted: open the rig again"
        self._seen = stamp, now
