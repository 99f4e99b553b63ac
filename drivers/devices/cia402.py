"""Driver of a CANopen drive with the profile CiA 402, in a cyclic synchronous mode."""

from __future__ import annotations

import contextlib
import math
import struct
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from drivers.codecs.cia402 import (
    EMCY,
    HEARTBEAT,
    NMT,
    RPDO1,
    SDO_ANSWER,
    STATUS,
    TOWARDS_OPERATION,
    TPDO1,
    TPDO2,
    Control,
    DriveState,
    NmtCommand,
    NmtState,
    Units,
    command,
    emergency,
    nmt,
    state_of,
    statusword,
)
from drivers.device import (
    NO_SAMPLE,
    CanDevice,
    Drive,
    ForceDrive,
    OnlyDrive,
    PositionDrive,
    Sample,
    VelocityDrive,
)
from drivers.devices.cia402_master import CanopenMaster, master_of
from drivers.devices.cia402_settings import Cia402Settings
from drivers.rig import RigError
from drivers.transports.can_bus import CanBus
from drivers.transports.can_frame import CanFrame

if TYPE_CHECKING:
    from drivers.devices.cia402_setup import DriveSetup

BOOTING = 5.0
"""Longest time from a reset of the drive to its boot-up message [s]."""
STARTING = 1.0
"""Longest wait for the NMT state operational [s], and also for the first samples."""
RESETTING = 0.5
"""Longest time that the drive may take to reset a fault [s]."""
FAULTS = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
CONFIRMING = 2
"""Number of statuswords that confirm a stop. One can have been sent before the drive's reaction."""


class TorqueMode(OnlyDrive, ForceDrive):
    """The drive in the cyclic synchronous torque mode."""

    _device: Cia402

    def command(self, force: float) -> float:
        """Store the force [N]; return it rounded to a thousandth of the rated force [N]."""
        return self._device.command_force(force)


class PositionMode(OnlyDrive, PositionDrive):
    """The drive in the cyclic synchronous position mode."""

    _device: Cia402

    def command(self, position: float) -> float:
        """Store the position [m]; return it rounded to the resolution of the drive [m]."""
        return self._device.command_position(position)


class Cia402(CanDevice, VelocityDrive):
    """A CiA 402 drive with one axis on a CANopen bus (CiA 301 version 4.2, CiA 402-2 version 3.0).

    `start` configures the drive. After that, the controller sends SYNC frames. At each SYNC, the
    drive applies the latest command and takes its samples. If the controller's heartbeat or
    commands are missing for `watchdog_ms`, the drive stops on its quick stop ramp (object 6007h).
    If the drive reports an error, or leaves operation without a request, `error` describes the
    error. The drive then remains out of operation until it is enabled again.

    The setting `mode` chooses what the drive accepts. With `csv`, the drive `axis` is the device
    itself. With `cst`, the torque of the motor is switched off instead of a quick stop.
    """

    Settings = Cia402Settings
    settings: Cia402Settings

    def __init__(self, name: str, settings: Cia402Settings) -> None:
        super().__init__(name, settings)
        drives: dict[str, Drive] = {
            "csv": self,
            "csp": PositionMode(self),
            "cst": TorqueMode(self),
        }
        self.drives = {"axis": drives[settings.mode]}
        self._halt = Control.DISABLE_VOLTAGE if settings.mode == "cst" else Control.QUICK_STOP
        self._most_torque = 0
        self._position = 0
        """Latest position of the drive [counts]."""
        self._units = self._units_with(math.nan)
        self._watchdog = settings.watchdog_ms * 1e-3
        node = settings.node_id
        self._handlers = {
            EMCY + node: self._process_emergency,
            TPDO1 + node: self._process_status,
            TPDO2 + node: self._process_motion,
            HEARTBEAT + node: self._process_heartbeat,
        }
        self._bus: CanBus | None = None
        self._setup: DriveSetup | None = None
        self._master = CanopenMaster()
        self._running = False
        self._lost = ""
        self._heard = self._updated = -math.inf
        self._nmt: NmtState | None = None
        self._state: DriveState | None = None
        self._armed = self._enabled = self._answered = self._booted = False
        self._control, self._target = self._halt, 0
        self._resetting_until = math.inf
        self._stopped = 0
        """Number of statuswords without operation since the latest stop, or since operation."""

    def _units_with(self, rated_torque: float) -> Units:
        s = self.settings
        return Units(s.counts_per_turn, s.travel_mm_per_turn * 1e-3, s.velocity_unit, rated_torque)

    def signals(self) -> Mapping[str, str]:
        """Return the SI unit of each signal. `force` is the motor force along the axis."""
        return {"position": "m", "velocity": "m/s", "force": "N"}

    def identifiers(self) -> Iterable[int]:
        """Return the CAN identifiers of the frames that the drive sends."""
        return (*self._handlers, SDO_ANSWER + self.settings.node_id)

    def start(self, bus: CanBus) -> None:
        """Reset the CANopen communication of the drive, and configure the drive.

        The drive remains out of operation.
        """
        from drivers.devices.cia402_setup import DriveSetup

        node = self.settings.node_id
        where = f"{self.name}: node {node} on {bus.name}"
        self._bus, self._running, self._lost, self._nmt = bus, False, "", None
        self._armed = self._enabled = self._booted = False
        self._control = self._halt
        bus.send(NMT, nmt(NmtCommand.RESET_COMMUNICATION, node))
        if not bus.wait_for(lambda: self._booted, BOOTING):
            raise RigError(
                f"{where}: no boot-up message within {BOOTING:g} s of a reset: expected a CANopen "
                "drive with this node id at the bus's bit rate"
            )
        self._setup = DriveSetup(where, bus, self.settings)
        try:
            rated, self._most_torque = self._setup.run()
            self._units = self._units_with(rated)
        finally:
            self._setup = None
        bus.send(NMT, nmt(NmtCommand.START, node))
        if not bus.wait_for(lambda: self._nmt is NmtState.OPERATIONAL, STARTING):
            raise RigError(f"{where}: not operational within {STARTING:g} s of its start")
        self._master = master_of(bus)
        self._master.join(self.name, 0.25 * self._watchdog)
        self.samples = dict.fromkeys(self.samples, NO_SAMPLE)
        self._master.synchronise(bus)
        if not bus.wait_for(self._has_samples, STARTING):
            raise RigError(f"{where}: no TPDO1 and TPDO2 within {STARTING:g} s of a SYNC")
        self.error = ""
        self._running = True

    def about(self) -> dict[str, str]:
        """Return the objects of the drive that the driver knows, by index and sub-index."""
        from drivers.devices.cia402_setup import DriveSetup

        assert self._bus
        where = f"{self.name}: node {self.settings.node_id} on {self._bus.name}"
        self._setup = DriveSetup(where, self._bus, self.settings)
        try:
            return self._setup.objects()
        finally:
            self._setup = None

    def _has_samples(self) -> bool:
        return NO_SAMPLE not in (self.samples["position"], self.samples["velocity"])

    def receive(self, frame: CanFrame, time: float) -> None:
        """Process a CAN frame that the drive has sent. `time` is its time of arrival [s]."""
        if frame.is_remote_frame:
            self.rejected["remote"] += 1
        elif frame.arbitration_id == SDO_ANSWER + self.settings.node_id:
            if self._setup and len(frame.data) == 8:
                self._setup.receive(frame, time)
            else:
                self.rejected["SDO"] += 1
        else:
            try:
                self._handlers[frame.arbitration_id](bytes(frame.data), time)
            except struct.error:
                self.rejected["length"] += 1

    def _process_status(self, data: bytes, time: float) -> None:
        position, word = self._units.position(data), statusword(data)
        self._position = STATUS.unpack(data)[1]
        self.samples["position"] = Sample(position, self._sampled(time))
        self._answered = True
        state = state_of(word)
        if state is None:
            self.rejected["statusword"] += 1
            return
        before, self._state = self._state, state
        self._stopped = 0 if state is DriveState.OPERATION_ENABLED else self._stopped + 1
        if state in FAULTS and before not in (None, *FAULTS):
            self._fail(f"statusword 0x{word:04X}: {state.words}")
        elif self._enabled and state is not DriveState.OPERATION_ENABLED:
            self._fail(f"left operation by itself: statusword 0x{word:04X}, {state.words}")

    def _process_motion(self, data: bytes, time: float) -> None:
        velocity, force = self._units.velocity_and_force(data)
        sampled = self._sampled(time)
        self.samples["velocity"] = Sample(velocity, sampled)
        self.samples["force"] = Sample(force, sampled)

    def _sampled(self, arrival: float) -> float:
        """Return the time [s] at which the drive took the samples that a frame contains.

        This is the time of the latest SYNC, or `arrival` if the frame arrived before this SYNC.
        """
        synchronised = self._master.synchronised
        return synchronised if synchronised <= arrival else arrival

    def _process_emergency(self, data: bytes, time: float) -> None:
        if error := emergency(data):
            self._fail(error)

    def _process_heartbeat(self, data: bytes, time: float) -> None:
        try:
            (byte,) = data
            self._nmt = NmtState(byte)
        except ValueError:
            self.rejected["heartbeat"] += 1
            return
        self._heard = time
        boot_up = self._nmt is NmtState.BOOT_UP
        self._booted |= boot_up
        if boot_up:  # a drive that was reset is out of operation
            self._stopped = CONFIRMING
        if self._running and self._nmt is not NmtState.OPERATIONAL:
            left = f"left NMT operational: {self._nmt.words}"
            self._lost = self._lost or ("was reset during operation" if boot_up else left)
            self._fail(self._lost)

    def _fail(self, error: str) -> None:
        """Stop the drive until it is enabled again; set `error` if no error is stored yet."""
        if self._running:
            self.error = self.error or error
            self._enabled = False
            self._control = self._halt

    def update(self, now: float) -> None:
        """Check the drive's heartbeat. If the last SYNC is over 8 ms old, send another SYNC."""
        if not self._bus or not self._running:
            return
        self._master.keep_sampling(self._bus, now)
        if now - self._updated > 0.5 * self._watchdog:
            self._heard = now  # the bus was not read, so no heartbeat could be received
        self._updated = now
        if now - self._heard > self._watchdog:
            self._fail(f"no heartbeat for {self.settings.watchdog_ms} ms")
        if now > self._resetting_until and self._state is DriveState.FAULT:
            self._fail("the fault is not cleared by a reset")

    def ping(self) -> bool:
        """Send a SYNC, which requests samples of the drive; return False before `start` ends."""
        if self._bus and self._running:
            self._answered = False
            self._master.synchronise(self._bus)
        return self._running

    def answered(self) -> bool:
        """Return whether the drive has sent samples (the frame TPDO1) since the last `ping`."""
        return self._answered

    def rearm(self) -> None:
        """Clear the error, unless the drive has lost its configuration, for example by a reset."""
        self.error = self._lost

    def enable(self) -> bool:
        """Request one state change towards operation; return whether the drive is in operation.

        The first call after `idle` clears the error. A fault of the drive is reset.
        """
        assert self._bus
        if self._lost:
            raise RigError(f"{self.name}: {self._lost}: its set-up is lost, open the rig again")
        if not self._armed:
            self._armed, self._state, self.error = True, None, ""
            self._master.armed = True
            self._target = 0
            self._resetting_until = self._bus.now() + RESETTING
        if not self.error and not self._enabled:
            self._control = TOWARDS_OPERATION.get(self._state, self._halt)
            self._enabled = self._state is DriveState.OPERATION_ENABLED
        return self._enabled

    def command(self, velocity: float) -> float:
        """Store the velocity [m/s]; return it rounded to the resolution of the drive [m/s]."""
        self._target = self._units.target(velocity)
        return self._target * self._units.metres_per_second

    def command_position(self, position: float) -> float:
        """Store the position [m]; return it rounded to the resolution of the drive [m]."""
        self._target = self._units.target_position(position)
        return self._target * self._units.metres

    def command_force(self, force: float) -> float:
        """Store the force [N]; return it rounded and limited to the torque of the drive [N]."""
        if math.isnan(self._units.newtons):
            return 0.0
        self._target = self._units.target_torque(force, self._most_torque)
        return self._target * self._units.newtons

    def transmit(self) -> None:
        """Send the command, if this drive or another drive on the bus has been enabled before.

        If this is the last drive on the bus, the master then sends SYNC and, if due, its heartbeat.
        """
        if self._bus and self._running:
            if self._master.armed:
                self._send()
            self._master.end_tick(self.name, self._bus)

    def idle(self) -> bool:
        """Stop the drive on its quick stop ramp; return whether the drive has confirmed it.

        At standstill, the drive leaves operation. During the ramp, the drive does not follow
        commands, and counts as out of operation. In the mode `cst`, the torque is switched off
        instead. Each call sends the request.
        """
        if self._armed:
            self._stopped = 0
        self._armed = self._enabled = False
        self._control, self._target = self._halt, 0
        self._resetting_until = math.inf
        if not (self._bus and self._running):
            return True
        self._send()
        self._master.synchronise(self._bus)
        return self._stopped >= CONFIRMING

    def _send(self) -> None:
        assert self._bus
        mode = self.settings.mode
        rest = self._position if mode == "csp" else 0
        target = self._target if self._enabled else rest
        self._bus.send(RPDO1 + self.settings.node_id, command(self._control, target, mode))

    def stop(self) -> None:
        """Reset the CANopen communication of the drive.

        Without the reset, the drive would report an error when the controller's heartbeat ends.
        """
        if self._bus and self._running:
            with contextlib.suppress(RigError):
                self._bus.send(NMT, nmt(NmtCommand.RESET_COMMUNICATION, self.settings.node_id))
        self._bus, self._running = None, False
