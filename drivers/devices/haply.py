"""Driver of a Haply Inverse3 by the Haply Inverse Service of this computer."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, FiniteFloat

from drivers.codecs import haply as codec
from drivers.device import DeviceSettings, ForceDrive, Sample, SerialDevice
from drivers.rig import RigError
from telepalpation import needs

if TYPE_CHECKING:
    from websockets.client import ClientProtocol

    from drivers.transports.stream_port import StreamPort

ANSWER = 2.0
"""Longest wait at the start for an answer [s]."""
MOST_OPEN = 4
"""Largest number of messages without an answer."""
LONGEST_MESSAGE = 1 << 18


class HaplySettings(DeviceSettings):
    """Settings of a Haply Inverse3 in the rig file."""

    kind: Literal["haply"]
    bus: str
    device_id: Annotated[str, Field(min_length=1, max_length=40)]
    """Id that the service gives the device, for example `049D`."""
    axis: Literal["x", "y", "z"]
    """Axis of the cursor that the drive uses. The force along the other axes is 0."""
    max_force_n: Annotated[FiniteFloat, Field(gt=0)]
    timeout_ms: Annotated[FiniteFloat, Field(gt=0, le=1000)] = 50.0
    """Longest time without an answer in operation [ms]."""
    model: str = ""
    """Type that the service states, for example `inverse3`; empty if it is not checked."""


class Haply(SerialDevice, ForceDrive):
    """One axis of a Haply Inverse3.

    The signals are `position` [m] and `velocity` [m/s] of the cursor along the axis. The service
    answers each message, in the order of the messages, with the state of the device. Each message
    sets the force. Out of operation, the force is 0. A stop is confirmed when a message with the
    force 0 was answered, and with it all messages before it.

    Without messages, the service returns the device to idle. It does not report this.
    """

    silent_without_commands = True
    reports_watchdog = False
    Settings = HaplySettings
    settings: HaplySettings

    def __init__(self, name: str, settings: HaplySettings) -> None:
        super().__init__(name, settings)
        self.drives = {"axis": self}
        self._timeout = settings.timeout_ms * 1e-3
        self._port: StreamPort | None = None
        self._protocol: ClientProtocol | None = None
        self._text = b""
        """Beginning of a message that arrives in several frames."""
        self._first: dict[str, dict[str, Any]] | None = None
        """Devices in the first message."""
        self._accepted = False
        """Whether the service has accepted the WebSocket connection."""
        self._sent = self._answered_messages = 0
        """Numbers of messages to the service, and of its answers."""
        self._zero_since = 0
        """Number of the first message of the latest messages without force."""
        self._wanted = self._transmitted = False
        self._force = 0.0
        self._heard = -math.inf
        """Time of the latest answer, or of the first message that waits for one [s]."""

    def signals(self) -> dict[str, str]:
        """Return the unit of each signal."""
        return {"position": "m", "velocity": "m/s"}

    def start(self, port: StreamPort) -> None:
        """Open the WebSocket connection, and check the identity of the device."""
        try:
            from websockets.client import ClientProtocol
            from websockets.uri import parse_uri
        except ImportError as error:
            raise RigError(needs(self.name, "websockets", "live")) from error
        self._port = port
        self._text, self._first, self._accepted = b"", None, False
        self._sent = self._answered_messages = self._zero_since = 0
        self._wanted, self._force, self.error = False, 0.0, ""
        self._protocol = ClientProtocol(parse_uri(f"ws://{port.port}/"), max_size=LONGEST_MESSAGE)
        self._protocol.send_request(self._protocol.connect())
        self._flush()
        who = f"{self.name}: {self.settings.device_id} on {port.name} ({port.port})"
        port.wait_for(lambda: self._first is not None or self.error, ANSWER)
        if self._first is None:
            instead = self.error or f"no list of devices in {ANSWER:g} s"
            raise RigError(f"{who}: {instead}: expected the Haply Inverse Service, version 3.5")
        device = self._first.get(self.settings.device_id)
        if device is None:
            found = ", ".join(sorted(self._first)[:8]) or "none"
            raise RigError(f"{who}: the service has the Inverse3 devices {found[:80]}")
        config = device.get("config")
        model = str(config.get("type", ""))[:40] if isinstance(config, dict) else ""
        if self.settings.model not in ("", model):
            raise RigError(f"{who}: type {model!r}, expected {self.settings.model[:40]!r}")
        try:
            problem = codec.state(device, self.settings.axis).problem
        except ValueError as error:
            raise RigError(f"{who}: {error}: expected position and velocity") from error
        if problem:
            raise RigError(f"{who}: {problem}: expected a calibrated device with power on")
        if not port.wait_for(lambda: self._answered_messages > 0 or self.error, ANSWER):
            raise RigError(f"{who}: no answer to a force of 0 N in {ANSWER:g} s")
        if self.error:
            raise RigError(f"{who}: {self.error}")

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes of the WebSocket connection."""
        protocol = self._protocol
        if protocol is None:
            return
        protocol.receive_data(data)
        for event in protocol.events_received():
            opcode = getattr(event, "opcode", None)
            if opcode is None:
                problem = protocol.handshake_exc
                self._accepted = problem is None
                if problem:
                    self._fail("refuses the WebSocket connection")
            elif opcode in (0, 1, 2):
                self._text += getattr(event, "data", b"")
                if getattr(event, "fin", True):
                    message, self._text = self._text, b""
                    self._process(message, now)
            elif opcode == 8:
                self._fail("the service has closed the connection")
        if protocol.parser_exc:
            self._fail("malformed WebSocket frame")
        elif self._accepted:
            self._flush()

    def _fail(self, problem: str) -> None:
        self.error = self.error or problem
        self._accepted = False

    def _process(self, message: bytes, now: float) -> None:
        """Process a message of the service."""
        try:
            devices = codec.devices(message.decode())
        except ValueError:
            self.rejected["malformed"] += 1
            return
        if self._first is None:
            self._first = devices
        else:
            self._answered_messages += 1
            self._heard = now
        device = devices.get(self.settings.device_id)
        if device is None:
            if self._wanted:
                self.error = self.error or "the service has no state of the device"
            self.rejected["no device"] += 1
            return
        try:
            state = codec.state(device, self.settings.axis)
        except ValueError:
            self.rejected["malformed"] += 1
            return
        self.samples["position"] = Sample(state.position, now)
        self.samples["velocity"] = Sample(state.velocity, now)
        if self._wanted:
            self.error = self.error or state.problem

    def update(self, now: float) -> None:
        """Detect missing answers. If no force was sent since the last tick, request the state."""
        silent = now - self._heard
        waits = self._sent > self._answered_messages
        if self._wanted and waits and not self.error and silent > self._timeout:
            self.error = f"no answer for {silent * 1e3:.0f} ms"
        if not self._transmitted and not self._wanted:
            self._send(0.0)
        self._transmitted = False

    def enable(self) -> bool:
        """Request operation without force; return whether the device is in operation."""
        if not self._wanted:
            assert self._port
            self._wanted, self._force, self.error = True, 0.0, ""
            self._zero_since, self._heard = self._sent + 1, self._port.now()
            if not self._accepted:
                self._fail("the service has closed the connection")
        return self.operates

    @property
    def operates(self) -> bool:
        """Whether the device follows commands: the first message of the operation was answered."""
        return self._wanted and not self.error and self._answered_messages >= self._zero_since

    def command(self, force: float) -> float:
        """Store the force [N], limited to the range; it is 0 out of operation."""
        most = self.settings.max_force_n
        self._force = min(max(force, -most), most) if self.operates else 0.0
        return self._force

    def transmit(self) -> None:
        """Send the force, if operation is requested."""
        if self._wanted:
            self._send(self._force if self.operates else 0.0)

    def idle(self) -> bool:
        """Send the force 0; return whether the service has answered such a message."""
        if not self._port or not self._protocol:
            return True
        if self._wanted:
            self._zero_since = self._sent + 1
        self._wanted, self._force = False, 0.0
        self._send(0.0, self._sent < self._zero_since)
        return self._sent >= self._zero_since and self._answered_messages >= self._zero_since

    def stop(self) -> None:
        """Do nothing: the connection ends with its port."""

    def _send(self, force: float, must: bool = False) -> None:
        """Send a message, if not too many messages have no answer yet, or if it must be sent."""
        if not self._accepted or self._first is None or not self._protocol:
            return
        if self._sent - self._answered_messages >= MOST_OPEN and not must:
            return
        self._transmitted = True
        if self._sent == self._answered_messages:
            assert self._port
            self._heard = self._port.now()
        self._sent += 1
        message = codec.command(self.settings.device_id, self.settings.axis, force)
        self._protocol.send_text(message.encode())
        self._flush()

    def _flush(self) -> None:
        """Send the bytes that the WebSocket protocol has stored, for example a pong."""
        assert self._port
        assert self._protocol
        data = b"".join(self._protocol.data_to_send())
        if data:
            self._port.write(data)
