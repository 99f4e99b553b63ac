"""Driver of Robotiq's FT 300 force-torque sensor on a serial port."""

from __future__ import annotations

import contextlib
from typing import Literal

from drivers.codecs.ft300 import FRAME, START_STREAM, STOP_STREAM, Ft300Frame, Ft300Parser
from drivers.device import NO_SAMPLE, DeviceSettings, Sample, SerialDevice
from drivers.rig import RigError, new_tuple
from drivers.transports.stream_port import StreamPort

BAUD = 19200
"""Line rate of the sensor [bit/s]."""
STREAMING = 0.1
"""If no frame arrives in this time [s], the driver starts the data stream of the sensor."""
FIRST_FRAME = 1.0
"""Longest wait for the first frame [s]."""


class Ft300Settings(DeviceSettings):
    """Settings of an FT 300 force-torque sensor in the rig file."""

    kind: Literal["ft300"]
    bus: str


class Ft300(SerialDevice):
    """An FT 300 force-torque sensor, which sends 100 samples per second.

    The signals are `fx`, `fy`, `fz` [N] and `mx`, `my`, `mz` [N m]. The frames contain no time
    stamp. The time of a sample is the time of arrival minus the transmission time of a frame, which
    is 8.3 ms. The frames contain no status, so the sensor does not report saturation. Saturation is
    only detected from the measuring range that the rig file gives for each channel (measured
    quantity of the rig). The sensor measures up to 300 N and 30 N m.
    """

    Settings = Ft300Settings
    settings: Ft300Settings

    def __init__(self, name: str, settings: Ft300Settings) -> None:
        super().__init__(name, settings)
        self._parser = Ft300Parser(self.rejected)
        self._port: StreamPort | None = None
        self._line_time = 0.0

    def signals(self) -> dict[str, str]:
        """Return the SI unit of each signal: forces and moments."""
        return dict.fromkeys(("fx", "fy", "fz"), "N") | dict.fromkeys(("mx", "my", "mz"), "N m")

    def start(self, port: StreamPort) -> None:
        """Start the data stream of the sensor, unless frames already arrive."""
        self._port = port
        self._line_time = port.line_time(FRAME.size)
        self.samples = dict.fromkeys(self.signals(), NO_SAMPLE)
        if not port.wait_for(self._streams, STREAMING):
            port.write(START_STREAM)
            if not port.wait_for(self._streams, FIRST_FRAME - STREAMING):
                raise RigError(
                    f"{self.name}: {port.no_frame_message(FIRST_FRAME, 'an FT 300', BAUD)}"
                )
        self.rejected.clear()

    def _streams(self) -> bool:
        return self.samples["fx"] is not NO_SAMPLE

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the sensor. The newest frame sets the samples of all signals."""
        if frames := self._parser.feed(data):
            time = now - self._line_time
            for signal, value in zip(Ft300Frame._fields, frames[-1], strict=True):
                self.samples[signal] = new_tuple(Sample, (value, time))

    def stop(self) -> None:
        """Stop the data stream of the sensor. The sensor then accepts Modbus requests again."""
        if self._port:
            with contextlib.suppress(RigError):
                self._port.write(STOP_STREAM)
            self._port = None
