"""Driver of motors with the "MIT mode" on a CAN bus: Damiao DM, CubeMars AK and T-Motor AK."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from drivers.codecs import mit_motor as codec
from drivers.codecs.mit_motor import Ranges, State
from drivers.device import CanDevice, Drive, ForceDrive, ImpedanceDrive, OnlyDrive, Sample
from drivers.devices.mit_motor_settings import MitMotorSettings
from drivers.rig import RigError

if TYPE_CHECKING:
    from drivers.transports.can_bus import CanBus
    from drivers.transports.can_frame import CanFrame

ANSWER = 0.1
"""Longest wait for one answer at the start [s]."""
TRIES = 10
"""Number of requests at the start until an answer is considered missing."""
IDLE_PERIOD = 2e-3
"""Period of the requests for the state of a motor that is out of operation [s]."""
PAUSED = 5e-3
"""Time without a command after which a Damiao motor in operation is asked for its state [s]."""
FIRST_REPEAT = 5e-3
"""Time after which a request to leave operation is repeated for the first time [s]."""
CLEARING = 0.1
"""Longest time until an error is cleared [s]."""
LOST_AFTER = 50
"""Number of readings of the bus after which a missing answer is considered lost."""
ENTERED = 4
"""Number of answers after which a motor that does not report its state is in operation. Each
request for operation is followed by a command, and both are answered."""
WRAP = 1 << codec.POSITION_BITS


class TorqueMode(OnlyDrive, ForceDrive):
    """The motor as a drive that accepts a force."""

    _device: MitMotor

    def command(self, force: float) -> float:
        """Store the force [N]; return the force with the resolution of the frame [N]."""
        return self._device.set_force(force)


class ImpedanceMode(OnlyDrive, ImpedanceDrive):
    """The motor as a drive that closes a virtual coupling itself."""

    _device: MitMotor

    def rounded(self, stiffness: float, damping: float) -> tuple[float, float]:
        """Return the nearest gains that a frame can contain [N/m, N s/m]."""
        return self._device.rounded_gains(stiffness, damping)

    def command(
        self, position: float, velocity: float, stiffness: float, damping: float
    ) -> tuple[float, float]:
        """Store reference and gains; return position [m] and velocity [m/s] as in the frame."""
        return self._device.set_impedance(position, velocity, stiffness, damping)


class MitMotor(CanDevice):
    """A motor with the MIT mode.

    The signals are `position` [m], `velocity` [m/s] and `force` [N]. The motor answers each frame
    with its state. While the motor is out of operation, the driver requests the state
    periodically.

    A Damiao motor reports its ranges, its control mode and its CAN time-out, which is its watchdog.
    `start` refuses the motor if they differ from the rig file. The motors of CubeMars and T-Motor
    cannot be asked, and do not report whether they are in operation. For them, an answer to a
    request to leave operation confirms it.

    Frames with the identifier of the motor reset its watchdog. Therefore, until a stop is
    confirmed, the request for it is repeated with pauses that increase to twice the watchdog time.
    The request for the state of a Damiao motor has another identifier, and resets no watchdog.
    """

    Settings = MitMotorSettings
    settings: MitMotorSettings

    def __init__(self, name: str, settings: MitMotorSettings) -> None:
        super().__init__(name, settings)
        torque = settings.mode == "torque"
        drive: Drive = TorqueMode(self) if torque else ImpedanceMode(self)
        if settings.maker == "cubemars":
            drive.reports_watchdog = False
        self.drives = {"axis": drive}
        self._damiao = settings.maker == "damiao"
        self._ranges = settings.ranges
        self._radius = settings.travel_mm_per_turn * 1e-3 / math.tau
        """Displacement of the moving part per angle of the shaft [m/rad]."""
        self._watchdog = settings.watchdog_ms * 1e-3
        self._zero = codec.command(self._ranges, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._command = self._zero
        self._bus: CanBus | None = None
        self._turns = 0
        """Number of times that the position has passed the end of its range."""
        self._count: int | None = None
        self._status = 0
        self._unanswered: deque[tuple[int, int]] = deque()
        """Numbers of the frame and of the reading of the bus before it, per unanswered frame."""
        self._frames = self._readings = 0
        self._first = 0
        """Number of the first frame whose answer belongs to the latest request."""
        self._answers = 0
        """Number of answers to frames since the latest request."""
        self._register = -1
        self._value: float | None = None
        self._wanted = self._ready = self._idle = False
        self._heard = False
        """Whether an answer was received since the last tick."""
        self._now = self._heard_at = self._polled = self._sent = self._repeat = -math.inf
        self._patience = -math.inf
        """Time until which an error that is being cleared is no error [s]."""
        self._pause = FIRST_REPEAT
        self._answered = False

    def signals(self) -> Mapping[str, str]:
        """Return the SI unit of each signal. `force` is the force of the motor."""
        return {"position": "m", "velocity": "m/s", "force": "N"}

    def identifiers(self) -> Iterable[int]:
        """Return the CAN identifier of the answers of the motor."""
        return (self.settings.reply_id,)

    def start(self, bus: CanBus) -> None:
        """Take the motor out of operation. If it is a Damiao motor, check its registers."""
        self._bus = bus
        self._wanted = self._ready = self._idle = False
        self._count, self._turns = None, 0
        self._command, self.error = self._zero, ""
        s = self.settings
        where = f"{self.name}: motor {s.can_id} on {bus.name}"
        for _ in range(TRIES):
            if self._idle:
                break
            self._first, self._answers = self._frames, 0
            self._unanswered.clear()
            self._send(codec.EXIT)
            bus.wait_for(lambda: self._idle, ANSWER)
        if not self._idle:
            found = "".join(f", {n} rejected for {why}" for why, n in self.rejected.items())
            raise RigError(
                f"{where}: no answer with the identifier 0x{s.reply_id:X}{found}: expected a motor "
                f"{s.model} with this can_id and reply_id"
            )
        if self._damiao:
            self._check_registers(where)

    def _check_registers(self, where: str) -> None:
        s = self.settings
        mode = self._read(where, codec.CTRL_MODE)
        if mode != codec.MIT_MODE:
            raise RigError(f"{where}: register CTRL_MODE is {mode:g}: expected 1, the MIT mode")
        found = Ranges(
            *(self._read(where, register) for register in (codec.PMAX, codec.VMAX, codec.TMAX))
        )
        if any(
            not math.isclose(a, b, rel_tol=1e-4) for a, b in zip(found, self._ranges, strict=True)
        ):
            raise RigError(
                f"{where}: ranges {found.text} (PMAX, VMAX, TMAX): expected {self._ranges.text}, "
                f"as in the rig file for the model {s.model}"
            )
        timeout = self._read(where, codec.TIMEOUT)
        wanted = round(self._watchdog / codec.TIMEOUT_UNIT)
        if timeout != wanted:
            off = ", so that the motor has no watchdog" if timeout == 0 else ""
            raise RigError(
                f"{where}: register TIMEOUT is {timeout:g}{off}: expected {wanted} (units of 50 "
                f"us), as watchdog_ms = {s.watchdog_ms:g} in the rig file"
            )

    def _read(self, where: str, register: int) -> float:
        assert self._bus
        self._register, self._value = register, None
        try:
            for _ in range(TRIES):
                request = codec.read_register(self.settings.can_id, register)
                self._bus.send(codec.REGISTERS, request)
                if self._bus.wait_for(lambda: self._value is not None, ANSWER):
                    break
        finally:
            self._register = -1
        if self._value is None:
            raise RigError(
                f"{where}: register {codec.REGISTER_NAMES[register]} is not answered: expected a "
                "Damiao motor whose registers can be read"
            )
        return self._value

    def receive(self, frame: CanFrame, time: float) -> None:
        """Process an answer of the motor. `time` is its time of arrival [s]."""
        if frame.is_remote_frame:
            self.rejected["remote"] += 1
            return
        data = bytes(frame.data)
        if len(data) != codec.LENGTH:
            self.rejected["length"] += 1
            return
        if self._register >= 0:
            found = codec.register_value(self.settings.can_id, self._register, data)
            if found is not None:
                self._value = found
                return
        state = codec.state(self.settings.maker, self._ranges, data)
        if state.motor != self.settings.can_id:
            self.rejected["id"] += 1
            return
        self._answered = self._heard = True
        number = self._unanswered.popleft()[0] if self._unanswered else self._frames
        self._store(state, time)
        self._status = state.status
        if number >= self._first:
            self._check(state.status)

    def _store(self, state: State, time: float) -> None:
        """Store the samples. The position is continued beyond the ends of its range."""
        if self._count is not None:
            step = state.position - self._count
            self._turns -= round(step / WRAP)
        self._count = state.position
        angle = codec.value(
            state.position + self._turns * WRAP,
            -self._ranges.position,
            self._ranges.position,
            codec.POSITION_BITS,
        )
        self.samples["position"] = Sample(angle * self._radius, time)
        self.samples["velocity"] = Sample(state.velocity * self._radius, time)
        self.samples["force"] = Sample(state.torque / self._radius, time)

    def _check(self, status: int) -> None:
        """Process the status of an answer: whether the motor operates, and its error."""
        self._answers += 1
        operates = status == codec.ENABLED if self._damiao else self._answers >= ENTERED
        if not self._wanted:
            self._idle = not (self._damiao and operates)
            return
        if problem := self._problem(status):
            if self._ready or self._now > self._patience:
                self._fail(problem)
        elif operates:
            self._ready = True
        elif self._ready:
            self._fail("left operation by itself")
        if self._turns and self.settings.mode == "impedance":
            self._fail(f"the position is out of the range of +-{self._ranges.position:g} rad")

    def _problem(self, status: int) -> str:
        if self._damiao:
            if status <= codec.ENABLED:
                return ""
            return codec.DAMIAO_ERRORS.get(status, f"error 0x{status:X}")
        return codec.CUBEMARS_ERRORS.get(status, f"error {status}") if status else ""

    def _fail(self, problem: str) -> None:
        self.error = self.error or problem
        self._command = self._zero

    def update(self, now: float) -> None:
        """Detect missing answers, and request the state of a motor that gets no commands."""
        self._now = now
        self._readings += 1
        while self._unanswered and self._readings - self._unanswered[0][1] > LOST_AFTER:
            self._unanswered.popleft()
        if not self._bus:
            return
        if self._heard or not self._unanswered:
            self._heard, self._heard_at = False, now
        if self._wanted:
            if now - self._heard_at > self._watchdog:
                self._fail(f"no answer for {(now - self._heard_at) * 1e3:.0f} ms")
            if self._damiao and now - self._sent >= PAUSED:
                self._poll()
        elif self._damiao or self._idle:
            self._poll()

    def _poll(self) -> None:
        """Request the state, in a way that does not reset the watchdog of a motor in operation."""
        if self._now - self._polled < IDLE_PERIOD:
            return
        self._polled = self._now
        if self._damiao:
            self._transfer(codec.REGISTERS, codec.refresh(self.settings.can_id))
        else:
            self._send(codec.EXIT)

    def ping(self) -> bool:
        """Send a request for the state; return False if the motor is not out of operation."""
        if not self._idle:
            return False
        self._answered, self._polled = False, -math.inf
        self._poll()
        return True

    def answered(self) -> bool:
        """Return whether the motor has answered since the last `ping`."""
        return self._answered

    def enable(self) -> bool:
        """Request operation without force; return whether the motor is in operation."""
        if not self._wanted:
            self._wanted, self._idle, self._ready, self.error = True, False, False, ""
            self._command = self._zero
            self._first, self._answers = self._frames, 0
            self._heard_at, self._patience = self._now, self._now + CLEARING
        if not self._ready and not self.error:
            self._send(self._zero)
            if self._damiao and self._problem(self._status):
                self._send(codec.CLEAR)
            self._send(codec.ENTER)
        return self._ready and not self.error

    def set_force(self, force: float) -> float:
        """Store a force [N] for `transmit`; return it with the resolution of the frame [N]."""
        most = self._ranges.torque
        wanted = force * self._radius if self._operates else 0.0
        self._command = codec.command(self._ranges, 0.0, 0.0, 0.0, 0.0, wanted)
        return codec.rounded(wanted, -most, most, codec.OTHER_BITS) / self._radius

    def set_impedance(
        self, position: float, velocity: float, stiffness: float, damping: float
    ) -> tuple[float, float]:
        """Store a reference and gains for `transmit`; return the reference as in the frame."""
        r, ranges = self._radius, self._ranges
        square = r * r if self._operates else 0.0
        angle, rate = position / r, velocity / r
        self._command = codec.command(
            ranges, angle, rate, stiffness * square, damping * square, 0.0
        )
        return (
            codec.rounded(angle, -ranges.position, ranges.position, codec.POSITION_BITS) * r,
            codec.rounded(rate, -ranges.velocity, ranges.velocity, codec.OTHER_BITS) * r,
        )

    def rounded_gains(self, stiffness: float, damping: float) -> tuple[float, float]:
        """Return the nearest gains that a frame can contain [N/m, N s/m]."""
        square = self._radius**2
        return (
            codec.rounded(stiffness * square, 0.0, codec.MOST_STIFFNESS, codec.OTHER_BITS) / square,
            codec.rounded(damping * square, 0.0, codec.MOST_DAMPING, codec.OTHER_BITS) / square,
        )

    @property
    def _operates(self) -> bool:
        return self._ready and not self.error

    def transmit(self) -> None:
        """If operation is requested, send the command, which also resets the watchdog."""
        if self._wanted:
            self._send(self._command)

    def idle(self) -> bool:
        """Request that the motor leaves operation; return whether it has confirmed it.

        The first call, and calls after the confirmation, send the request at once. Until the
        confirmation, it is repeated with increasing pauses, because it resets the watchdog.
        """
        if not self._bus:
            return True
        if self._wanted:
            # A Damiao motor that was seen in operation reports the stop. Otherwise, an answer to
            # an earlier frame confirms nothing.
            if not (self._damiao and self._ready):
                self._first = self._frames
            self._answers = 0
            self._repeat, self._pause = -math.inf, FIRST_REPEAT
        self._wanted = self._ready = False
        self._command = self._zero
        now = self._bus.now()
        if self._idle or now >= self._repeat:
            self._send(codec.EXIT)
            self._repeat = now + self._pause
            self._pause = min(2.0 * self._pause, max(FIRST_REPEAT, 2.0 * self._watchdog))
        return self._idle

    def _send(self, data: bytes) -> None:
        self._sent = self._now
        self._transfer(self.settings.can_id, data)

    def _transfer(self, identifier: int, data: bytes) -> None:
        """Send a frame that the motor answers with its state."""
        assert self._bus
        self._unanswered.append((self._frames, self._readings))
        self._frames += 1
        self._bus.send(identifier, data)
