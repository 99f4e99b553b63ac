"""Driver of Dynamixel X servos (protocol 2.0) on a serial line that several servos share."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, FiniteFloat, field_validator, model_validator

from drivers.codecs import dynamixel as codec
from drivers.device import (
    DeviceSettings,
    ForceDrive,
    LineFrames,
    LineRequest,
    OnlyDrive,
    PositionDrive,
    Sample,
    SharedSerialDevice,
    VelocityDrive,
)
from drivers.rig import RigError

if TYPE_CHECKING:
    from drivers.transports.shared_line import SharedLine

ANSWER = 3e-3
"""Longest time from the end of a request until its answer has arrived [s]."""
STARTING = 1.0
"""Longest wait for the answer to a request at the start [s]."""
CONDITION_EVERY = 50
"""Number of requests for the motion after which the condition of the servo is requested."""
FIRST_REPEAT = 5e-3
"""Time after which a request to leave operation is repeated for the first time [s]."""
CONTROL_MODES = {"current": 0, "velocity": 1, "position": 4}
"""Value at the address `OPERATING_MODE` for each mode; positions are those of several turns."""
Positive = Annotated[FiniteFloat, Field(gt=0)]


class DynamixelSettings(DeviceSettings):
    """Settings of a Dynamixel X servo in the rig file."""

    kind: Literal["dynamixel"]
    bus: str
    id: Annotated[int, Field(ge=0, le=252)]
    model: str
    mode: Literal["velocity", "position", "current"]
    """What the servo accepts. `current`: forces."""
    travel_mm_per_turn: Positive
    """Displacement of the moving part per turn of the horn [mm]."""
    torque_constant_nm_per_a: Positive | None = None
    """Torque of the horn per current, only for the mode `current` and for the signal `force`."""
    watchdog_ms: Annotated[int, Field(ge=20, le=1000, multiple_of=20)] = 60
    """Bus watchdog, which the driver sets [ms]."""

    @field_validator("model")
    @classmethod
    def _is_known(cls, model: str) -> str:
        if model not in codec.MODELS:
            raise ValueError(f"expected one of {', '.join(codec.MODELS)}")
        return model

    @model_validator(mode="after")
    def _current_has_a_torque(self) -> Self:
        if self.mode == "current" and self.torque_constant_nm_per_a is None:
            raise ValueError("torque_constant_nm_per_a: missing: expected with the mode current")
        return self


class VelocityMode(OnlyDrive, VelocityDrive):
    """The servo in velocity control."""

    _device: Dynamixel

    def command(self, velocity: float) -> float:
        """Store the velocity [m/s]; return it with the resolution of the servo [m/s]."""
        return self._device.store(velocity)


class PositionMode(OnlyDrive, PositionDrive):
    """The servo in extended position control."""

    _device: Dynamixel

    def command(self, position: float) -> float:
        """Store the position [m]; return it with the resolution of the servo [m]."""
        return self._device.store(position)


class CurrentMode(OnlyDrive, ForceDrive):
    """The servo in current control."""

    _device: Dynamixel

    def command(self, force: float) -> float:
        """Store the force [N]; return it with the resolution of the servo [N]."""
        return self._device.store(force)


class Dynamixel(SharedSerialDevice):
    """A Dynamixel X servo.

    The signals are `position` [m], `velocity` [m/s] and, with the torque constant, `force` [N].
    When it has its turn, the driver sends the command and the request for the motion together. The
    command (Sync Write) is not answered.

    Each instruction resets the bus watchdog. Therefore nothing is requested from a servo in
    operation that gets no commands, until its watchdog must have acted. Until a stop is confirmed,
    only the request for it is sent, with pauses that increase to twice the watchdog time.
    """

    Settings = DynamixelSettings
    settings: DynamixelSettings
    silent_without_commands = True

    def __init__(self, name: str, settings: DynamixelSettings) -> None:
        super().__init__(name, settings)
        kinds = {"velocity": VelocityMode, "position": PositionMode, "current": CurrentMode}
        self.drives = {"axis": kinds[settings.mode](self)}
        travel = settings.travel_mm_per_turn * 1e-3
        model = codec.MODELS[settings.model]
        constant = settings.torque_constant_nm_per_a or math.nan
        self._metres = travel * codec.POSITION_UNIT
        self._metres_per_second = travel * codec.VELOCITY_UNIT
        self._newtons = math.tau * constant * model.current / travel
        self._watchdog = settings.watchdog_ms * 1e-3
        self._unit, self._goal, self._layout = {
            "velocity": (self._metres_per_second, codec.GOAL_VELOCITY, "<i"),
            "position": (self._metres, codec.GOAL_POSITION, "<i"),
            "current": (self._newtons, codec.GOAL_CURRENT, "<h"),
        }[settings.mode]
        self._most = (1 << 31) - 1
        """Largest command [units of the servo]."""
        self._line: SharedLine | None = None
        self._question: bytes | None = None
        """Request of `start`, whose answer is `_reply`."""
        self._reply: bytes | None = None
        self._asked = ""
        """What the request on the line asks for."""
        self._position = 0
        self._target = 0
        self._turn = 0
        self._wanted = self._ready = self._idle = self._answered = False
        self._transmitted = self._heard = self._repeat = -math.inf
        self._pause = FIRST_REPEAT

    @property
    def address(self) -> int:
        """Identifier of the servo."""
        return self.settings.id

    def signals(self) -> Mapping[str, str]:
        """Return the SI unit of each signal."""
        units = {"position": "m", "velocity": "m/s"}
        known = self.settings.torque_constant_nm_per_a is not None
        return units | ({"force": "N"} if known else {})

    @classmethod
    def split(cls, data: bytes) -> LineFrames:
        """Find the packets of all servos. Packets of this computer are ignored (echo)."""
        found = codec.find(data)
        frames = [(i, body) for i, body in found.packets if body[0] == codec.STATUS]
        return LineFrames(frames, found.rejected, found.rest)

    def start(self, line: SharedLine) -> None:
        """Switch the torque off, check the model, and set the operating mode."""
        self._line = line
        self._wanted = self._ready = self._idle = False
        self.error = ""
        s = self.settings
        where = f"{self.name}: servo {s.id} on {line.name} ({line.port})"
        check_latency(where, line.port)
        self._ask(where, codec.write(s.id, codec.TORQUE_ENABLE, b"\0"))
        number = int.from_bytes(self._ask(where, codec.read(s.id, 0, 2)), "little")
        model = codec.MODELS[s.model]
        if number != model.number:
            raise RigError(f"{where}: model number {number}: expected {model.number}, a {s.model}")
        mode = bytes((CONTROL_MODES[s.mode],))
        if self._ask(where, codec.read(s.id, codec.OPERATING_MODE, 1)) != mode:
            self._ask(where, codec.write(s.id, codec.OPERATING_MODE, mode))
        if s.mode == "current":
            limit = self._ask(where, codec.read(s.id, codec.CURRENT_LIMIT, 2))
            self._most = int.from_bytes(limit, "little")
        if not line.wait_for(lambda: self._idle, STARTING):
            raise RigError(f"{where}: the torque is not switched off within {STARTING:g} s")

    def _ask(self, where: str, request: bytes) -> bytes:
        """Send a request of `start` until it is answered; return the data of the answer."""
        assert self._line
        self._question, self._reply = request, None
        answered = self._line.wait_for(lambda: self._reply is not None, STARTING)
        self._question = None
        if not answered or self._reply is None:
            found = "".join(f", {n} rejected for {why}" for why, n in self.rejected.items())
            raise RigError(
                f"{where}: no answer{found}: expected a Dynamixel with this id at the baud rate of "
                "the bus"
            )
        if number := self._reply[0] & ~codec.ALERT:
            raise RigError(f"{where}: {codec.ERRORS.get(number, f'error {number}')}")
        return self._reply[1:]

    def request(self, now: float) -> LineRequest | None:
        """Return what is sent now: a command with the request for the motion, or another one."""
        identifier = self.settings.id
        if self._question:
            self._asked = "reply"
            return LineRequest(self._question, ANSWER)
        if not self._wanted and not self._idle:
            if now < self._repeat:
                return None
            self._repeat = now + self._pause
            self._pause = min(2.0 * self._pause, max(FIRST_REPEAT, 2.0 * self._watchdog))
            off = codec.silent_write(identifier, codec.TORQUE_ENABLE, b"\0")
            return self._request("condition", off)
        if not self._wanted:
            self._turn += 1
            return self._request("motion" if self._turn % CONDITION_EVERY else "condition")
        silent = now - self._transmitted
        if silent > 0.5 * self._watchdog:
            return self._request("condition") if silent > 2.0 * self._watchdog else None
        if not self._ready:
            return self._request("condition", self._entering())
        self._turn += 1
        goal = codec.silent_write(
            identifier, self._goal, struct.pack(self._layout, self._target if not self.error else 0)
        )
        if self.error and self.settings.mode == "position":
            goal = b""
        return self._request("motion" if self._turn % CONDITION_EVERY else "condition", goal)

    def _entering(self) -> bytes:
        """Return the writes that clear and set the watchdog, set a goal at rest, and switch on."""
        identifier = self.settings.id
        rest = self._position if self.settings.mode == "position" else 0
        steps = round(self._watchdog / codec.WATCHDOG_UNIT)
        return b"".join(
            codec.silent_write(identifier, address, data)
            for address, data in (
                (codec.BUS_WATCHDOG, b"\0"),
                (self._goal, struct.pack(self._layout, rest)),
                (codec.TORQUE_ENABLE, b"\1"),
                (self._goal, struct.pack(self._layout, rest)),
                (codec.BUS_WATCHDOG, bytes((steps,))),
            )
        )

    def _request(self, what: str, before: bytes = b"") -> LineRequest:
        self._asked = what
        place = codec.MOTION if what == "motion" else codec.CONDITION
        return LineRequest(before + codec.read(self.settings.id, *place), ANSWER)

    def receive(self, frame: bytes, time: float) -> None:
        """Process a packet of the servo: its instruction, error and data."""
        self._answered, self._heard = True, time
        if len(frame) < 2:
            self.rejected["length"] += 1
        elif self._asked == "reply":
            self._reply, self._question = frame[1:], None
        elif self._asked == "motion" and len(frame) == 2 + codec.MOTION[1]:
            self._store_motion(codec.motion(frame[2:]), time)
        elif self._asked == "condition" and len(frame) == 2 + codec.CONDITION[1]:
            self._check(codec.condition(frame[2:]))
        elif self._asked:
            self.rejected["length"] += 1

    def _store_motion(self, motion: codec.Motion, time: float) -> None:
        self._position = motion.position
        self.samples["position"] = Sample(motion.position * self._metres, time)
        self.samples["velocity"] = Sample(motion.velocity * self._metres_per_second, time)
        if "force" in self.samples:
            self.samples["force"] = Sample(motion.current * self._newtons, time)

    def _check(self, condition: codec.Condition) -> None:
        """Process the condition of the servo."""
        if not self._wanted:
            self._idle = not condition.torque
            return
        problem = ", ".join(
            text for bit, text in codec.HARDWARE_ERRORS.items() if condition.hardware >> bit & 1
        )
        if not problem and self._ready and condition.watchdog < 0:
            problem = "bus watchdog: no command arrived in time"
        if not problem and self._ready and not condition.torque:
            problem = "left operation by itself"
        if problem:
            self.error = self.error or problem
        elif condition.torque and condition.watchdog > 0:
            self._ready = True

    def update(self, now: float) -> None:
        """Detect missing answers of a servo that gets commands."""
        sending = now - self._transmitted <= 0.5 * self._watchdog
        if self._wanted and sending and now - self._heard > self._watchdog:
            self.error = self.error or f"no answer for {(now - self._heard) * 1e3:.0f} ms"

    def ping(self) -> bool:
        """Let the next request be answered; return False if the servo is not out of operation."""
        self._answered = False
        return self._idle

    def answered(self) -> bool:
        """Return whether the servo has answered since the last `ping`."""
        return self._answered

    def enable(self) -> bool:
        """Request operation without motion and force; return whether the servo is in operation."""
        assert self._line
        if not self._wanted:
            self._wanted, self._ready, self._idle, self.error = True, False, False, ""
            self._target = self._position if self.settings.mode == "position" else 0
            self._heard = self._transmitted = self._line.now()
        return self._ready and not self.error

    def store(self, value: float) -> float:
        """Store a command in SI units; return it as it will be sent."""
        counts = round(max(-self._most, min(self._most, value / self._unit)))
        if self._ready and not self.error:
            self._target = counts
            return counts * self._unit
        return value if self.settings.mode == "position" else 0.0

    def transmit(self) -> None:
        """Note that the loop is alive. The command is sent when the servo has its turn."""
        if self._wanted and self._line:
            self._transmitted = self._line.now()

    def idle(self) -> bool:
        """Request that the torque is switched off; return whether the servo has confirmed it."""
        if not self._line:
            return True
        if self._wanted:
            self._idle = False
            self._repeat, self._pause = -math.inf, FIRST_REPEAT
            self._asked = ""  # an answer to an earlier request confirms nothing
        self._wanted = self._ready = False
        return self._idle


def check_latency(where: str, port: str, folder: Path = Path("/sys/class/tty")) -> None:
    """Raise RigError if the adapter of a serial port delays received bytes by more than 1 ms."""
    name = Path(port).resolve().name
    try:
        latency = int((folder / name / "device" / "latency_timer").read_text())
    except (OSError, ValueError):
        return
    if latency > 1:
        raise RigError(
            f"{where}: latency_timer of {name} is {latency} ms: expected 1: "
            f"echo 1 | sudo tee {folder / name / 'device' / 'latency_timer'}"
        )
