"""Driver of a moteus motor controller on a CAN FD bus, with velocity or torque control."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field, FiniteFloat

from drivers.codecs import moteus as codec
from drivers.codecs.moteus import Mode, Register
from drivers.device import (
    CanDevice,
    DeviceSettings,
    ForceDrive,
    OnlyDrive,
    Sample,
    VelocityDrive,
)
from drivers.rig import RigError

if TYPE_CHECKING:
    from drivers.transports.can_bus import CanBus
    from drivers.transports.can_frame import CanFrame

HOST = 0
"""Node of the controller program on the bus."""
ANSWER = 1.0
"""Longest wait at the start for an answer [s]."""
SHORTEST_PAUSE = 0.8e-3
"""Shortest time between two requests without a command [s]."""
LONGEST_TEXT = 16


class MoteusSettings(DeviceSettings):
    """Settings of a moteus motor controller in the rig file."""

    kind: Literal["moteus"]
    bus: str
    node: Annotated[int, Field(ge=1, le=127)]
    """The configured `id.id`."""
    mode: Literal["velocity", "torque"]
    travel_mm_per_turn: Annotated[FiniteFloat, Field(gt=0)]
    """Displacement per turn of the output shaft [mm]."""
    max_velocity_mm_per_s: Annotated[FiniteFloat, Field(gt=0)]
    max_torque_nm: Annotated[FiniteFloat, Field(gt=0)]
    watchdog_ms: Annotated[FiniteFloat, Field(gt=0, le=1000)]
    """Watchdog time that is sent with every command [ms]."""
    serial_number: str = ""
    """Serial number that `moteus_tool --info` prints; empty if it is not checked."""
    model: str = ""
    """Model that `moteus_tool --info` prints; empty if it is not checked."""


class Moteus(CanDevice):
    """A moteus motor controller.

    The signals are `position` [m], `velocity` [m/s] and `force` [N], which is computed from the
    torque: 2 pi (torque) / (travel per turn). The controller only answers requests. Each command
    also requests the signals. Without commands, the signals are requested once per tick.

    The device has one drive, `axis`. With `mode = "velocity"`, it accepts velocities, and with
    `mode = "torque"`, it accepts forces. Every command contains the watchdog time. A controller
    whose watchdog has expired accepts no command before it was stopped. A stop is confirmed only by
    the reply to the request: it contains a register that no other request reads.
    """

    Settings = MoteusSettings
    settings: MoteusSettings
    needs_fd: ClassVar[bool] = True

    def __init__(self, name: str, settings: MoteusSettings) -> None:
        super().__init__(name, settings)
        kind = MoteusVelocity if settings.mode == "velocity" else MoteusForce
        self.axis: MoteusVelocity | MoteusForce = kind(self)
        self.drives = {"axis": self.axis}
        self.travel = settings.travel_mm_per_turn * 1e-3
        self.watchdog = settings.watchdog_ms * 1e-3
        self._bus: CanBus | None = None
        self._identity: dict[int, float] = {}
        self._mode = -1
        """Mode in the latest reply."""
        self._wanted = False
        """Whether operation is requested."""
        self._cleared = False
        """Whether a reply has confirmed the stop before operation."""
        self._idle = False
        """Whether a reply has confirmed the stop after operation."""
        self._ready = False
        """Whether the controller is in operation."""
        self._commanded = False
        """Whether a command was sent since the last tick."""
        self._heard = False
        self._asked = self._answer = -math.inf
        """Times of the latest request and of the latest tick with a reply [s]."""
        self._answered = False

    def signals(self) -> dict[str, str]:
        """Return the unit of each signal."""
        return {"position": "m", "velocity": "m/s", "force": "N"}

    def identifiers(self) -> Iterable[int]:
        """Return the identifiers of the replies, of 11 and of 29 bits."""
        reply = codec.identifier(self.settings.node, HOST)
        return [reply, reply | codec.EXTENDED] if reply < 1 << 11 else [reply | codec.EXTENDED]

    def start(self, bus: CanBus) -> None:
        """Take the controller out of operation, and check its identity and its register map."""
        self._bus = bus
        self._wanted = self._ready = self._idle = False
        self._identity, self.error = {}, ""
        who = f"{self.name}: node {self.settings.node} on {bus.name}"
        if not bus.wait_for(self._identified, ANSWER):
            raise RigError(f"{who}: no answer in {ANSWER:g} s: expected a moteus with power on")
        found = {register: int(value) for register, value in self._identity.items()}
        version = found[Register.MAP_VERSION]
        if version != codec.MAP_VERSION:
            firmware = codec.version_text(found[Register.FIRMWARE])
            raise RigError(
                f"{who}: register map version {version} (firmware {firmware}), expected "
                f"{codec.MAP_VERSION}"
            )
        serial = codec.serial_text(
            (found[Register.SERIAL], found[Register.SERIAL + 1], found[Register.SERIAL + 2])
        )
        for what, value, expected in (
            ("serial number", serial, self.settings.serial_number),
            ("model", f"{found[Register.MODEL]:x}", self.settings.model),
        ):
            if expected and value != expected:
                raise RigError(f"{who}: {what} {value}, expected {expected[:LONGEST_TEXT]}")
        if not bus.wait_for(lambda: self._idle or self.idle(), ANSWER):
            mode = codec.MODES.get(self._mode, self._mode)
            raise RigError(
                f"{who}: in mode {mode} for {ANSWER:g} s: expected stopped, as requested"
            )

    def about(self) -> dict[str, str]:
        """Return model, serial number, and versions of firmware and register map."""
        found = {register: int(value) for register, value in self._identity.items()}
        serial = (found[Register.SERIAL], found[Register.SERIAL + 1], found[Register.SERIAL + 2])
        return {
            "model": f"{found[Register.MODEL]:x}",
            "serial number": codec.serial_text(serial),
            "firmware": codec.version_text(found[Register.FIRMWARE]),
            "register map": str(found[Register.MAP_VERSION]),
        }

    def _identified(self) -> bool:
        """Request the identity; return whether it is known."""
        if Register.SERIAL in self._identity and Register.MAP_VERSION in self._identity:
            return True
        self._send(codec.padded(codec.IDENTIFY))
        return False

    def receive(self, frame: CanFrame, time: float) -> None:
        """Process a reply of the controller."""
        reply = None if frame.is_remote_frame else codec.decode(bytes(frame.data))
        if reply is None:
            self.rejected["malformed"] += 1
            return
        values = reply.values
        if Register.MODEL in values or Register.SERIAL in values:
            self._identity |= values
        if Register.MODEL in values:
            self._answered = True
        if reply.refused and self._wanted:
            self.error = self.error or f"refuses register 0x{reply.refused[0]:03x}"
        if Register.MODE not in values:
            return
        self._heard = True
        self._check(int(values[Register.MODE]), values)
        self._store(values, time)

    def _store(self, values: dict[int, float], time: float) -> None:
        force = math.tau / self.travel
        for signal, register, scale in (
            ("position", Register.POSITION, self.travel),
            ("velocity", Register.VELOCITY, self.travel),
            ("force", Register.TORQUE, force),
        ):
            value = values.get(register, math.nan)
            if math.isfinite(value):
                self.samples[signal] = Sample(scale * value, time)
            else:
                self.rejected["not finite"] += 1

    def _check(self, mode: int, values: dict[int, float]) -> None:
        """Check whether the controller is in the requested mode; in operation, set `error`."""
        self._mode = mode
        stopped = mode == Mode.STOPPED
        if not self._wanted:
            self._idle = stopped and (self._idle or Register.MAP_VERSION in values)
            return
        cleared = Register.FIRMWARE in values
        if cleared or not self._cleared:
            self._cleared = self._cleared or (cleared and stopped)
            return
        problem = codec.fault_text(mode, int(values.get(Register.FAULT, 0)))
        operates = mode == Mode.POSITION
        if not problem and self._ready and not operates:
            problem = f"in mode {codec.MODES.get(mode, mode)}: expected position"
        self.error = self.error or problem
        self._ready = operates

    def update(self, now: float) -> None:
        """Detect missing replies. If no command was sent since the last tick, request the signals.

        A request for the signals does not restart the watchdog.
        """
        if self._heard:
            self._heard, self._answer = False, now
        silent = now - self._answer
        if self._wanted and not self.error and silent > self.watchdog:
            self.error = f"no answer for {silent * 1e3:.0f} ms"
        if not self._commanded and now - self._asked >= SHORTEST_PAUSE and self._bus:
            self._asked = now
            self._send(codec.padded(codec.QUERY))
        self._commanded = False

    def ping(self) -> bool:
        """Request the model; return whether the request was sent."""
        self._answered = False
        self._send(codec.padded(codec.READ_MODEL))
        return True

    def answered(self) -> bool:
        """Return whether the answer to the last `ping` was received."""
        return self._answered

    def enable(self) -> bool:
        """Request operation; return whether the controller is in operation.

        The controller is first stopped, because only this clears faults and an expired watchdog.
        """
        if not self._wanted:
            self._wanted, self._cleared, self._ready, self._idle = True, False, False, False
            self.error = ""
            assert self._bus
            self._answer = self._bus.now()
        return self._ready and not self.error

    @property
    def operates(self) -> bool:
        """Whether the controller follows commands."""
        return self._ready and not self.error

    def transmit(self) -> None:
        """If operation is requested, send the command. It restarts the watchdog."""
        if self._wanted:
            self._commanded = True
            self._send(self.axis.frame() if self._cleared else codec.stop(codec.READ_FIRMWARE))

    def idle(self) -> bool:
        """Request the stop of the controller; return whether it is confirmed."""
        if not self._bus:
            return True
        if self._wanted:
            self._idle = False
        self._wanted = self._ready = False
        self.axis.reset()
        self._send(codec.stop(codec.READ_MAP_VERSION))
        return self._idle

    def _send(self, data: bytes) -> None:
        assert self._bus
        identifier = codec.identifier(HOST, self.settings.node, reply=True)
        self._bus.send(identifier, data, extended=True, fd=True, bitrate_switch=True)


class MoteusDrive(OnlyDrive):
    """The drive of a moteus. Its command is limited to `most`, and 0 out of operation."""

    _device: Moteus

    def __init__(self, device: Moteus, most: float) -> None:
        super().__init__(device)
        self._most = most
        self._value = 0.0

    def _store(self, value: float) -> float:
        self._value = min(max(value, -self._most), self._most) if self._device.operates else 0.0
        return self._value

    def reset(self) -> None:
        """Forget the command."""
        self._value = 0.0


class MoteusVelocity(MoteusDrive, VelocityDrive):
    """The drive of a moteus with velocity control."""

    def __init__(self, device: Moteus) -> None:
        super().__init__(device, device.settings.max_velocity_mm_per_s * 1e-3)

    def command(self, velocity: float) -> float:
        """Store the velocity [m/s], limited to the range; it is 0 out of operation."""
        return self._store(velocity)

    def frame(self) -> bytes:
        """Return the data of the command."""
        device = self._device
        return codec.velocity(
            self._value / device.travel, device.settings.max_torque_nm, device.watchdog
        )


class MoteusForce(MoteusDrive, ForceDrive):
    """The drive of a moteus with torque control."""

    def __init__(self, device: Moteus) -> None:
        self._lever = device.settings.travel_mm_per_turn * 1e-3 / math.tau
        """Torque per force [m]."""
        super().__init__(device, device.settings.max_torque_nm / self._lever)

    def command(self, force: float) -> float:
        """Store the force [N], limited to the range; it is 0 out of operation."""
        return self._store(force)

    def frame(self) -> bytes:
        """Return the data of the command."""
        device = self._device
        most = device.settings.max_torque_nm
        return codec.torque(self._value * self._lever, most, device.watchdog)
