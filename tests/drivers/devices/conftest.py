"""A force sensor and its driver on one port, in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest

from drivers.device import DeviceSettings, SerialDevice
from drivers.transports.serial_port import SerialPort
from sim_backend.wire.emulated_device import EmulatedSerialDevice, Mount

TICK = 1e-3


class SensorBench(SerialPort, Mount):
    """The port and the mount of the sensor; `garble` changes the bytes on the line."""

    def __init__(
        self,
        driver: type[SerialDevice],
        emulated: type[EmulatedSerialDevice],
        settings: DeviceSettings,
        loads: Mapping[str, float],
        port: str,
        baud: int,
    ) -> None:
        self.time = 100.0
        super().__init__("force", lambda: self.time, port, baud)
        self.loads = dict(loads)
        self.device = driver("tip", settings)  # type: ignore[call-arg]
        self.sensor = emulated("tip", settings, self)
        self.written: list[bytes] = []
        self.garble: Callable[[bytes], bytes] = bytes

    def sense(self, signal: str) -> float:
        return self.loads[signal]

    def drive(self, name: str, velocity: float) -> None:
        raise AssertionError

    brake = drive  # type: ignore[assignment]

    def write(self, data: bytes) -> None:
        self.written.append(data)
        self.sensor.receive(data, self.time)

    def run(self, seconds: float = TICK) -> None:
        """Advance the time, and pass on the received bytes with the mean time of arrival."""
        self.time += seconds
        data = self.garble(b"".join(self.sensor.emit(self.time)))
        self.received += len(data)
        if data:
            self.device.receive(data, self.time - 0.5 * seconds)

    def wait_for(self, condition: Callable[[], object], seconds: float) -> bool:
        end = self.time + seconds
        while not condition() and self.time <= end:
            self.run()
        return bool(condition())


@pytest.fixture
def sensor_bench() -> type[SensorBench]:
    """A force sensor and its driver on one port."""
    return SensorBench
