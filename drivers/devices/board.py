"""Driver of a microcontroller board with force and analogue inputs, encoders and two motor axes.

An axis accepts a velocity or a force.

The protocol is described in docs/serial-protocol.md. The code for the board is in drivers/firmware.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from drivers.codecs import board as codec
from drivers.codecs.board import BoardState, Configured, Identity, Input, MessageReader
from drivers.device import Drive, ForceDrive, Sample, SerialDevice, VelocityDrive
from drivers.device_clock import DeviceClock
from drivers.devices.board_settings import QUANTITIES, BoardSettings, gains
from drivers.rig import RigError, new_tuple
from drivers.transports.stream_port import StreamPort

PATIENCE = 4.0
"""Longest wait for an answer [s]. Many boards restart when their serial port is opened."""
ASKING = 0.25
"""If a request has no answer after this time [s], the request is repeated."""
WATCHDOG = "watchdog: no command arrived in time: the loop was late, or the line is disturbed"
STOPPED: dict[int, str] = {
    BoardState.WATCHDOG: WATCHDOG,
    BoardState.DRIVE_FAULT: "drive fault input",
}


class BoardAxis(Drive):
    """An axis of the board. `idle` stops all axes of the board."""

    def __init__(self, board: Board, index: int, scale: float) -> None:
        self.counts = 0
        """Velocity or force that the next `Board.transmit` sends [counts]."""
        self._board = board
        self._index = index
        self._scale = scale

    def enable(self) -> bool:
        """Request operation of this axis; return whether the board reports that it is enabled."""
        return self._board.enable_axis(self._index)

    def idle(self) -> bool:
        """Stop all axes of the board immediately; return whether the board has confirmed it."""
        return self._board.disable()

    def command(self, value: float) -> float:
        """Store a velocity [m/s] or force [N] for `transmit`; return it in whole counts."""
        self.counts = codec.to_counts(value, self._scale)
        return self.counts * self._scale


class Axis(BoardAxis, VelocityDrive):
    """An axis of the board that accepts velocities."""


class ForceAxis(BoardAxis, ForceDrive):
    """An axis of the board that accepts forces."""


class Board(SerialDevice):
    """A microcontroller board on a serial port.

    The signals are `force_0` [N], `position_0` [m], `velocity_0` [m/s], `analogue_0` [V] and so
    on. The drives are `axis_0` and `axis_1`. All values in a sample have the same time, which is
    the time stamp of the board, converted to the controller's clock.

    A reset of the board changes the zero of its positions. Therefore, after a reset, `error`
    reports the reset until the rig is opened again.
    """

    Settings = BoardSettings
    settings: BoardSettings

    def __init__(self, name: str, settings: BoardSettings) -> None:
        super().__init__(name, settings)
        self.axes = [
            ForceAxis(self, i, force)
            if (force := settings.force_scale(i))
            else Axis(self, i, settings.velocity_um_per_s_per_count[i] * 1e-6)
            for i in range(settings.axes)
        ]
        self.drives = {f"axis_{i}": axis for i, axis in enumerate(self.axes)}
        self.identity: Identity | None = None
        """IDENTITY message, the board's answer to the message HELLO; None before the answer."""
        self._port: StreamPort | None = None
        self._reader = MessageReader(self.rejected)
        self._clock = DeviceClock()
        self._configured: Configured | None = None
        self._started = False
        self._sequence = 0
        self._received: int | None = None
        self._uptime = 0
        self._wanted = False
        """Whether operation of an axis is requested."""
        self._asked = 0
        """Sequence number of the first frame that requested operation."""
        self._acknowledged = False
        """Whether the board accepted the frame `_asked`. If so, its state answers the request."""
        self._released = 0
        """Sequence number of the first frame that requested the end of operation."""
        self._disabled = False
        """Whether the board has confirmed that all axes are disabled."""
        self._pinged = 0
        self._ping_answered = False
        self._enabled = 0
        """Bit mask of the enabled axes."""
        self._running = False
        self._latched = ""
        self._reset = ""
        self._gains = list(gains(settings))

    def signals(self) -> dict[str, str]:
        """Return the SI unit of each signal, by name. Only signals with a scale are included."""
        return {
            f"{name}_{i}": unit
            for name, unit, _, key, _ in QUANTITIES
            for i in range(len(getattr(self.settings, key)))
        }

    def start(self, port: StreamPort) -> None:
        """Check the identity of the board, and configure it. The board then sends samples."""
        self._port, self._reader = port, MessageReader(self.rejected)
        self._started = False
        self.identity = self._configured = None
        where = f"{self.name}: board on {port.port}"
        if not self._ask(codec.HELLO, b"", lambda: self.identity):
            raise RigError(f"{where}: no answer in {PATIENCE:g} s: {self._instead()}")
        self._check_identity(where)
        s = self.settings
        payload = codec.configure(s.watchdog_ms, s.sample_rate_hz)
        if not self._ask(codec.CONFIGURE, payload, lambda: self._configured):
            raise RigError(f"{where}: no answer to the settings in {PATIENCE:g} s")
        got = self._configured
        assert got
        if (got.watchdog, got.sample_rate) != (s.watchdog_ms, s.sample_rate_hz):
            raise RigError(
                f"{where}: watchdog_ms {s.watchdog_ms}, sample_rate_hz {s.sample_rate_hz}: "
                f"the board can do {got.watchdog} ms and {got.sample_rate} Hz"
            )
        self._started = True

    def about(self) -> dict[str, str]:
        """Return what the board has stated in its answer to HELLO."""
        return {} if self.identity is None else {"identity": str(self.identity)}

    def _ask(self, kind: int, payload: bytes, answer: Callable[[], object]) -> bool:
        """Send a message repeatedly until `answer()` is true; return False after `PATIENCE`."""
        assert self._port
        for _ in range(round(PATIENCE / ASKING)):
            self._send(kind, payload)
            if self._port.wait_for(answer, ASKING):
                return True
        return False

    def _check_identity(self, where: str) -> None:
        """Raise RigError if the version is wrong, if inputs are missing, or if an axis differs."""
        board, s = self.identity, self.settings
        assert board
        if board.version not in (codec.VERSION, codec.FORCE_VERSION):
            raise RigError(
                f"{where}: protocol version {board.version}, expected {codec.VERSION} or "
                f"{codec.FORCE_VERSION}: see docs/serial-protocol.md"
            )
        numbers = (board.forces, board.encoders, board.axes, board.analogues)
        for (*_, key, _), has in zip(QUANTITIES, numbers, strict=True):
            if (wanted := len(getattr(s, key))) > has:
                raise RigError(f"{where}: {key} has {wanted} entries, expected at most {has}")
        for i in range(s.axes):
            by_force = bool(board.force_axes >> i & 1)
            if i >= board.axes:
                raise RigError(
                    f"{where}: axis_force_n_per_count has {s.axes} entries, expected at most "
                    f"{board.axes}"
                )
            if by_force != bool(s.force_scale(i)):
                accepts = "forces" if by_force else "velocities"
                expected = "a scale" if by_force else "0 or no scale"
                raise RigError(
                    f"{where}: axis_{i} accepts {accepts}: expected {expected} for it in "
                    "axis_force_n_per_count"
                )

    def _instead(self) -> str:
        """Return a text for an error message: what was received instead of the board's answer."""
        assert self._port
        if not self._port.received:
            return "expected a board with running firmware"
        rejected = ", ".join(f"{n} rejected for {why}" for why, n in self.rejected.items())
        return (
            f"{self._port.received} bytes received, {rejected or 'no frame'}: check the baud rate"
        )

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the board. The newest sample sets the values of all signals."""
        newest: codec.Sample | None = None
        for message in self._reader.feed(data):
            if isinstance(message, codec.Sample):
                if self._in_order(message):
                    self._update_state(message)
                    newest = message
            elif isinstance(message, Configured):
                self._configured = message
                self._received = message.sequence
            else:
                self._update_identity(message)
        if newest:
            time, counts = self._clock.observe(newest.time, now), newest.counts
            samples = self.samples
            for index, signal, gain in self._gains:
                samples[signal] = new_tuple(Sample, (gain * counts[index], time))

    def _in_order(self, sample: codec.Sample) -> bool:
        """Return whether a sample is newer than all previous samples; count missing samples."""
        if self._received is not None:
            ahead = signed(sample.sequence - self._received, 16)
            if ahead <= 0:
                self.rejected["late" if ahead else "repeated"] += 1
                return False
            if ahead > 1:
                self.rejected["lost"] += ahead - 1
            if self._started and signed(sample.time - self._uptime, 32) < 0:
                self._set_reset("its clock decreased")
        self._received = sample.sequence
        self._uptime = sample.time
        return True

    def _update_identity(self, board: Identity) -> None:
        """Process an IDENTITY message. Until `start` has ended, store it; later, detect a reset.

        After a reset, the boot number in the message is different, or the time is smaller.
        """
        if not self._started or self.identity is None:
            self.identity = board
        elif board.boot != self.identity.boot:
            self._set_reset(f"boot {self.identity.boot:#010x}, now {board.boot:#010x}")
        elif signed(board.time - self._uptime, 32) < 0:
            self._set_reset("its clock decreased")
        self._received = board.sequence
        self._uptime = board.time

    def _set_reset(self, sign: str) -> None:
        """Report in `error` that the board was reset. `sign` tells how the reset was detected."""
        self._disabled = True  # after a reset, the state of the board is idle
        self._reset = self._reset or f"the board was reset, open the rig again: {sign}"
        self.error = self._reset

    def _update_state(self, sample: codec.Sample) -> None:
        """Update the state and the error from the state of the board in a sample.

        While operation is requested, an error remains in `error` after its cause has ended.
        """
        stopped = sample.state == BoardState.EMERGENCY_STOP
        self.emergency_stop = stopped or bool(sample.inputs & Input.EMERGENCY_STOP)
        self._enabled = sample.axes if sample.state == BoardState.ENABLED else 0
        self._ping_answered |= signed(sample.acknowledged - self._pinged, 16) >= 0
        if sample.rejected:
            self.rejected["by the board"] = sample.rejected
        error = STOPPED[BoardState.DRIVE_FAULT] if sample.inputs & Input.DRIVE_FAULT else ""
        if self._wanted:
            self._acknowledged |= signed(sample.acknowledged - self._asked, 16) >= 0
            if self._acknowledged:
                if self._running and sample.state not in (
                    BoardState.ENABLED,
                    BoardState.EMERGENCY_STOP,
                ):
                    error = "the board left operation by itself"
                error = STOPPED.get(sample.state, error)
                self._running = self._running or sample.state == BoardState.ENABLED
            self._latched = self._latched or error
        elif sample.state == BoardState.ENABLED:
            self._disabled = False
        elif (
            sample.state != BoardState.IDLE or signed(sample.acknowledged - self._released, 16) >= 0
        ):
            # a stopped board, unlike an idle one, does not obey an earlier ENABLE that comes late
            self._disabled = True
        self.error = self._reset or self._latched or error

    def ping(self) -> bool:
        """Send DISABLE to measure the round-trip time; return whether DISABLE was sent.

        The message DISABLE stops all axes. It is therefore not sent while operation is requested.
        """
        if self._wanted:
            return False
        self._pinged, self._ping_answered = self._sequence, False
        self._send(codec.DISABLE)
        return True

    def answered(self) -> bool:
        """Return whether a sample has confirmed that the board received the last `ping`."""
        return self._ping_answered

    def enable_axis(self, index: int) -> bool:
        """Request operation of an axis; return whether the board reports that it is enabled."""
        if not self._wanted:
            self._wanted, self._disabled = True, False
            self._acknowledged = self._running = False
            self._asked = self._sequence
            self._latched = ""
            self.error = self._reset
        if self._acknowledged and self._enabled >> index & 1:
            return True
        self._send(codec.ENABLE, codec.enable(index))
        return False

    def rearm(self) -> None:
        """Clear the stored error. The error that reports a reset of the board is not cleared."""
        self._latched, self.error = "", self._reset

    def disable(self) -> bool:
        """Stop all axes immediately; return whether the board has confirmed that they stopped.

        Each call sends DISABLE, which does not reset the watchdog timer of the board.
        """
        if self._wanted:
            self._wanted, self._released = False, self._sequence
        for axis in self.axes:
            axis.counts = 0
        if not self._port:
            return True
        self._send(codec.DISABLE)
        return self._disabled

    def transmit(self) -> None:
        """If operation is requested, send the commands. This resets the board's watchdog."""
        if self._wanted:
            self._send(codec.COMMAND, codec.command(*[axis.counts for axis in self.axes]))

    def stop(self) -> None:
        """Send the message HELLO, so that the board stops sending samples."""
        if self._started:
            with contextlib.suppress(RigError):
                self._send(codec.HELLO)
        self._started = False

    def _send(self, kind: int, payload: bytes = b"") -> None:
        assert self._port
        self._port.write(codec.frame(kind, self._sequence, payload))
        self._sequence = (self._sequence + 1) & 0xFFFF


def signed(difference: int, bits: int) -> int:
    """Return a difference of two `bits`-bit counters as a signed number, without overflow."""
    half = 1 << bits - 1
    return (difference + half) % (2 * half) - half
