"""Emulated CiA 402 drive (servo drive on a CANopen bus), with quick stop and faults.

The drive moves only in the cyclic synchronous modes, in which the host sends the velocity, the
position or the torque periodically.
"""

from __future__ import annotations

import math
from enum import Enum

from drivers.devices.cia402_settings import Cia402Settings
from sim_backend.wire.devices.canopen_node import CanopenNode
from sim_backend.wire.devices.canopen_sdo import (
    UNSUPPORTED_ACCESS,
    VALUE_RANGE,
    Abort,
    Entry,
    ObjectDictionary,
)
from sim_backend.wire.emulated_device import Mount

AXIS = "axis"
RATED_TORQUE = 0.2
"""Rated torque of the motor [N m]."""
DECELERATION = 2.0
"""Deceleration during a quick stop [m/s^2]."""
CSP, CSV, CST = 8, 9, 10
PROFILE_VELOCITY = 3
COUNTS_PER_SECOND, RPM, MILLI_RPM = 0x00B50300, 0x00B44700, 0xFDB44700
MAXON = 0xFB
SERVO = 2.0 * math.pi * 4.0
"""Gain of the position controller [1/s]."""


class SimulatedState(Enum):
    """States of a CiA 402 drive.

    The value of a state is the bit pattern by which the statusword (object 6041h) reports it.
    """

    SWITCH_ON_DISABLED = 0b100_0000
    READY_TO_SWITCH_ON = 0b010_0001
    SWITCHED_ON = 0b010_0011
    OPERATION_ENABLED = 0b010_0111
    QUICK_STOP_ACTIVE = 0b000_0111
    FAULT_REACTION_ACTIVE = 0b000_1111
    FAULT = 0b000_1000


READY = (SimulatedState.READY_TO_SWITCH_ON, SimulatedState.SWITCHED_ON)
RAMPING = (SimulatedState.QUICK_STOP_ACTIVE, SimulatedState.FAULT_REACTION_ACTIVE)
VOLTAGE_ENABLED, REMOTE, FOLLOWS_COMMAND = 1 << 4, 1 << 9, 1 << 12


class EmulatedCia402(CanopenNode):
    """A CiA 402 drive (CANopen) whose motor follows velocity and torque without delay.

    A position is followed by a controller with feed-forward of the velocity.

    Attributes
    ----------
    state
        State of the drive, which the host changes with the controlword (object 6040h).
    """

    settings: Cia402Settings

    def __init__(self, name: str, settings: Cia402Settings, mount: Mount) -> None:
        self._counts_per_metre = settings.counts_per_turn / (settings.travel_mm_per_turn * 1e-3)
        self._turns_per_metre = 1e3 / settings.travel_mm_per_turn
        super().__init__(name, settings, mount, drive_objects(settings, self._counts_per_metre))
        self.state = SimulatedState.SWITCH_ON_DISABLED
        self._velocity = 0.0
        self._controlword = 0
        self._ran = math.inf
        self._target, self._target_time, self._target_velocity = 0, math.nan, 0.0

    def fault(self, code: int) -> None:
        """Change to the state fault, and send an error message.

        If the motor is powered, it is first decelerated to standstill. If the drive already has a
        fault, nothing changes.
        """
        if self.state not in (SimulatedState.FAULT, SimulatedState.FAULT_REACTION_ACTIVE):
            powered = self.state in (
                SimulatedState.OPERATION_ENABLED,
                SimulatedState.QUICK_STOP_ACTIVE,
            )
            self.state = SimulatedState.FAULT_REACTION_ACTIVE if powered else SimulatedState.FAULT
            self.emergency(code, 0x01)

    def reset(self) -> None:
        """Reset the drive to its state at power-up: switch-on disabled, and the motor at rest."""
        self.state, self._controlword = SimulatedState.SWITCH_ON_DISABLED, 0
        self._hold()

    def connection_lost(self) -> None:
        """React to a lost connection with the host, as the object 6007h requires.

        Its value (abort connection option code) means: 0 no reaction, 1 fault, 2 disable the
        voltage, 3 quick stop.
        """
        match self[0x6007, 0]:
            case 1:
                self.fault(0x8100)
            case 2:
                self._obey(0x00)
            case 3:
                self._obey(0x02)

    def check(self, index: int, sub: int, value: int) -> None:
        """Raise Abort if `value` may not be written to the object `index`.

        This is the case if the drive does not support the value, or not in its present state.
        """
        super().check(index, sub, value)
        allowed = {
            0x6007: (0, 1, 2, 3),
            0x605A: (0, 2, 6),
            0x6060: (0, PROFILE_VELOCITY, CSP, CSV, CST),
            0x60A9: (COUNTS_PER_SECOND, RPM, MILLI_RPM),
        }
        if index in allowed and value not in allowed[index]:
            raise Abort(VALUE_RANGE)
        if index == 0x60A9 and self.state is SimulatedState.OPERATION_ENABLED:
            raise Abort(UNSUPPORTED_ACCESS)

    def written(self, index: int) -> None:
        """If the object `index` is the controlword (6040h), change the state of the drive."""
        if index == 0x6040:
            self._obey(self[0x6040, 0])
        elif index == 0x607A:
            self._follow(self[0x607A, 0])

    def _follow(self, target: int) -> None:
        """Store a target position, and the velocity since the last one."""
        elapsed = self._now - self._target_time
        moved = (target - self._target) / self._counts_per_metre
        self._target_velocity = moved / elapsed if 0.0 < elapsed < 0.05 else 0.0
        self._target, self._target_time = target, self._now

    def _obey(self, controlword: int) -> None:
        """Change the state of the drive as the bits of the controlword command.

        Table 26 of CiA 402-2 defines the commands, and figure 3 the changes of the state.
        """
        rising = controlword & ~self._controlword
        self._controlword = controlword
        state = self.state
        if state is SimulatedState.FAULT and rising & 0x80:
            self.state = SimulatedState.SWITCH_ON_DISABLED
            self.emergency(0, 0)
        if state in (SimulatedState.FAULT, SimulatedState.FAULT_REACTION_ACTIVE):
            return
        switch_on, voltage, quick_stop_not, operate = (
            bool(controlword >> bit & 1) for bit in range(4)
        )
        if not voltage:
            self.state = SimulatedState.SWITCH_ON_DISABLED
        elif not quick_stop_not:
            if state is SimulatedState.OPERATION_ENABLED and self[0x605A, 0]:
                self.state = SimulatedState.QUICK_STOP_ACTIVE
            elif state in READY or state is SimulatedState.OPERATION_ENABLED:
                self.state = SimulatedState.SWITCH_ON_DISABLED
        elif not switch_on:
            if state is not SimulatedState.QUICK_STOP_ACTIVE:
                self.state = SimulatedState.READY_TO_SWITCH_ON
        elif state is SimulatedState.READY_TO_SWITCH_ON:
            self.state = SimulatedState.SWITCHED_ON
        elif state in (SimulatedState.SWITCHED_ON, SimulatedState.QUICK_STOP_ACTIVE) and operate:
            self.state = SimulatedState.OPERATION_ENABLED
        elif state is SimulatedState.OPERATION_ENABLED and not operate:
            self.state = SimulatedState.SWITCHED_ON

    def run(self, now: float) -> None:
        """Move the motor as its state requires, and update the objects with measured values."""
        elapsed = max(0.0, now - self._ran)
        self._ran = now
        if self.state is SimulatedState.OPERATION_ENABLED:
            self._operate()
        elif self.state in RAMPING and self[0x6060, 0] == CST:
            self._stopped()
        elif self.state in RAMPING:
            slower = abs(self._velocity) - self[0x6085, 0] / self._counts_per_metre * elapsed
            self._go(math.copysign(max(slower, 0.0), self._velocity))
            if self._velocity == 0.0:
                self._stopped()
        else:
            self._hold()
        self._measure()

    def _operate(self) -> None:
        """Follow the target of the mode of operation."""
        match self[0x6060, 0]:
            case 9:
                self._go(self[0x60FF, 0] / self._velocity_units)
            case 8:
                behind = self._target / self._counts_per_metre - self.mount.sense("position")
                stale = self._now - self._target_time > 5e-3
                self._go(SERVO * behind + (0.0 if stale else self._target_velocity))
            case 10:
                torque = 1e-3 * self[0x6071, 0] * RATED_TORQUE
                self.mount.push(AXIS, torque * 2.0 * math.pi * self._turns_per_metre)
            case _:
                self._go(0.0)

    def _stopped(self) -> None:
        if self.state is SimulatedState.FAULT_REACTION_ACTIVE:
            self.state = SimulatedState.FAULT
            self._hold()
        elif self[0x605A, 0] == 2:
            self.state = SimulatedState.SWITCH_ON_DISABLED
            self._hold()

    def _go(self, velocity: float) -> None:
        self._velocity = velocity
        self.mount.drive(AXIS, velocity)

    def _hold(self) -> None:
        self._velocity = 0.0
        self.mount.brake(AXIS)

    @property
    def _velocity_units(self) -> float:
        """Value of the object 60FFh (target velocity) that corresponds to 1 m/s of the axis."""
        if self[0x60A9, 0] in (RPM, MILLI_RPM):
            return (60.0 if self[0x60A9, 0] == RPM else 60e3) * self._turns_per_metre
        return self._counts_per_metre

    def _measure(self) -> None:
        status = self.state.value | VOLTAGE_ENABLED | REMOTE
        cyclic = self[0x6060, 0] in (CSP, CSV, CST)
        if self.state is SimulatedState.OPERATION_ENABLED and cyclic:
            status |= FOLLOWS_COMMAND
        force = self.mount.sense("force")
        torque = force / (2.0 * math.pi * self._turns_per_metre)
        measured = {
            0x6041: status,
            0x6061: self[0x6060, 0],
            0x6064: wrapped(self.mount.sense("position") * self._counts_per_metre, 32),
            0x606C: wrapped(self.mount.sense("velocity") * self._velocity_units, 32),
            0x6077: max(-32768, min(32767, round(1e3 * torque / RATED_TORQUE))),
        }
        for index, value in measured.items():
            self.objects[index, 0].value = value


def wrapped(value: float, bits: int) -> int:
    """Round `value`, and wrap it to the range of a signed integer with `bits` bits."""
    half = 1 << bits - 1
    return (round(value) + half) % (2 * half) - half


def drive_objects(settings: Cia402Settings, counts_per_metre: float) -> ObjectDictionary:
    """Return the CANopen objects of the drive with their values at power-up.

    Those are the objects of CiA 402, the identity of the device, and the settings of its PDOs.
    """
    units = {"counts_per_s": COUNTS_PER_SECOND, "rpm": RPM, "milli_rpm": MILLI_RPM}
    unit = units[settings.velocity_unit]
    maxon = settings.rated_torque_unit == "micro_nm"
    return {
        (0x1000, 0): Entry("I", 0x0002_0192),
        (0x1008, 0): Entry("s", b"emulated CiA 402 servo drive"),
        (0x1018, 0): Entry("B", 4),
        (0x1018, 1): Entry("I", settings.vendor_id or (MAXON if maxon else 0)),
        (0x1018, 2): Entry("I", settings.product_code or 0),
        (0x1018, 3): Entry("I", 1),
        (0x1018, 4): Entry("I", 1),
        (0x1400, 1): Entry("I", 0x200 + settings.node_id, writable=True),
        (0x1600, 0): Entry("B", 1, writable=True),
        (0x1600, 1): Entry("I", 0x6040_0010, writable=True),
        (0x1800, 1): Entry("I", 0x180 + settings.node_id, writable=True),
        (0x1A00, 0): Entry("B", 1, writable=True),
        (0x1A00, 1): Entry("I", 0x6041_0010, writable=True),
        (0x1802, 1): Entry("I", 0x380 + settings.node_id, writable=True),
        (0x1A02, 0): Entry("B", 2, writable=True),
        (0x1A02, 1): Entry("I", 0x6041_0010, writable=True),
        (0x1A02, 2): Entry("I", 0x6064_0020, writable=True),
        (0x6007, 0): Entry("h", 1, writable=True),
        (0x6040, 0): Entry("H", 0, writable=True, mappable=True),
        (0x6041, 0): Entry("H", 0, mappable=True),
        (0x605A, 0): Entry("h", 2, writable=True),
        (0x6060, 0): Entry("b", 0, writable=True, mappable=True),
        (0x6061, 0): Entry("b", 0, mappable=True),
        (0x6064, 0): Entry("i", 0, mappable=True),
        (0x606C, 0): Entry("i", 0, mappable=True),
        (0x6071, 0): Entry("h", 0, writable=True, mappable=True),
        (0x6076, 0): Entry("I", round(RATED_TORQUE * (1e6 if maxon else 1e3))),
        (0x6077, 0): Entry("h", 0, mappable=True),
        (0x607A, 0): Entry("i", 0, writable=True, mappable=True),
        (0x6085, 0): Entry("I", round(DECELERATION * counts_per_metre), writable=True),
        (0x60A9, 0): Entry("I", unit, writable=True),
        (0x60FF, 0): Entry("i", 0, writable=True, mappable=True),
        (0x6502, 0): Entry("I", sum(1 << mode - 1 for mode in (PROFILE_VELOCITY, CSP, CSV, CST))),
    }
