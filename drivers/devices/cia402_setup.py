"""Check and configure a CiA 402 drive with CANopen service data objects (SDO)."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from canopen import Network, ObjectDictionary, RemoteNode
from canopen.objectdictionary import (
    INTEGER8,
    INTEGER16,
    INTEGER32,
    UNSIGNED8,
    UNSIGNED16,
    UNSIGNED32,
    VISIBLE_STRING,
    ODRecord,
    ODVariable,
)
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.codecs.cia402 import MODES, RPDO1, TPDO1, TPDO2, Control
from drivers.devices.cia402_master import NODE
from drivers.devices.cia402_settings import Cia402Settings
from drivers.rig import RigError, reason
from drivers.transports.can_bus import CanBus
from drivers.transports.can_frame import CanFrame

logging.getLogger("canopen").addHandler(logging.NullHandler())

PROFILE = 402
"""Low word of object 1000h for a drive with the profile CiA 402."""
QUICK_STOP_IF_MASTER_LOST, DISABLE_IF_MASTER_LOST = 3, 2
"""Values of object 6007h for a quick stop, and for no torque, if the communication with the
controller is lost. In the torque mode, a drive cannot be expected to follow a quick stop ramp."""
MOST_TORQUE = 2000
"""Largest target torque of a drive without object 6072h, in thousandths of the rated torque. An
EPOS4 refuses a larger one."""
RAMP_THEN_DISABLE = 2
"""Value of object 605Ah: decelerate on the quick stop ramp, then enter `switch on disabled`."""
KEEP_NMT_STATE = 1
"""Value of object 1029h: after a communication error, keep the NMT state and continue to send."""
EVERY_SYNC = 1
"""Transmission type of a PDO that is sent or applied at every SYNC."""
VELOCITY_UNITS = {"counts_per_s": 0x00B50300, "rpm": 0x00B44700, "milli_rpm": 0xFDB44700}
"""Value of object 60A9h for each value of `velocity_unit`, CiA 402-2 and CiA 303-2."""
MAXON = 0x000000FB
"""Vendor id (object 1018h:01) of maxon.

The rated torque (object 6076h) of an EPOS4 is in millionths of a newton metre, and not in
thousandths as CiA 402 specifies. In a file that maxon published for an EPOS4 50/15, for example,
it is 512871, which is the nominal current 4760 mA times the torque constant 107746 uN m/A.
"""
TORQUE_UNITS = {"milli_nm": 1e-3, "micro_nm": 1e-6}
"""Unit of object 6076h [N m] for each value of `rated_torque_unit`."""
INVALID = 1 << 31
"""Bit of the COB-ID of a PDO. It is set if the PDO is not used."""
NO_OBJECT = (0x06020000, 0x06090011)
"""Abort codes for an object or a sub-index that does not exist."""
MODE_CHANGE = 0.5
"""Longest time for a change of the mode of operation [s]."""

VARIABLES = {
    0x1000: UNSIGNED32,
    0x1017: UNSIGNED16,
    0x6007: INTEGER16,
    0x6040: UNSIGNED16,
    0x6041: UNSIGNED16,
    0x605A: INTEGER16,
    0x6060: INTEGER8,
    0x6061: INTEGER8,
    0x6064: INTEGER32,
    0x606C: INTEGER32,
    0x6071: INTEGER16,
    0x6072: UNSIGNED16,
    0x6076: UNSIGNED32,
    0x6077: INTEGER16,
    0x607A: INTEGER32,
    0x60A9: UNSIGNED32,
    0x60FF: INTEGER32,
    0x6502: UNSIGNED32,
}
"""Data type of each object without sub-indices."""
TEXTS = (0x1008, 0x1009, 0x100A)
"""Objects that are texts: names of the device, versions of hardware and software."""
COMMUNICATION = {0: UNSIGNED8, 1: UNSIGNED32, 2: UNSIGNED8, 5: UNSIGNED16}
MAPPING = {0: UNSIGNED8, 1: UNSIGNED32, 2: UNSIGNED32}
RECORDS = {
    0x1016: {0: UNSIGNED8, 1: UNSIGNED32},
    0x1018: {0: UNSIGNED8, **dict.fromkeys(range(1, 5), UNSIGNED32)},
    0x1029: {0: UNSIGNED8, 1: UNSIGNED8},
    **dict.fromkeys((0x1400, 0x1800, 0x1801, 0x1802, 0x1803), COMMUNICATION),
    **dict.fromkeys((0x1600, 0x1A00, 0x1A01, 0x1A02, 0x1A03), MAPPING),
}
"""Data types of the sub-indices of each object with sub-indices.

PDO mappings are declared as records, because canopen cannot write mappings that are arrays.
"""


class Torques(NamedTuple):
    """Torques of a drive that were read from its objects."""

    rated: float
    """Rated torque [N m]; NaN if it is unknown."""
    most: int
    """Largest target torque, in thousandths of the rated torque."""


def object_dictionary() -> ObjectDictionary:
    """Return a table of the CANopen objects that this module uses, for the package `canopen`."""
    dictionary = ObjectDictionary()  # type: ignore[no-untyped-call]
    for index, kind in {**VARIABLES, **dict.fromkeys(TEXTS, VISIBLE_STRING)}.items():
        dictionary.add_object(variable(index, 0, kind))
    for index, kinds in RECORDS.items():
        record = ODRecord(f"{index:04X}h", index)
        for sub, kind in kinds.items():
            record.add_member(variable(index, sub, kind))
        dictionary.add_object(record)
    return dictionary


def variable(index: int, sub: int, kind: int) -> ODVariable:
    """Return the description of the object `index`, sub-index `sub`, with the data type `kind`."""
    entry = ODVariable(f"{index:04X}h:{sub:02X}", index, sub)
    entry.data_type = kind
    return entry


class DriveSetup:
    """Checks and configures one CiA 402 drive with CANopen service data objects (SDO).

    The package `canopen` implements the SDO protocol. A `CanBus` sends the frames.
    """

    def __init__(self, where: str, bus: CanBus, settings: Cia402Settings) -> None:
        self._where = where
        self._bus = bus
        self._settings = settings
        self._mode = MODES[settings.mode]
        self._network = BusNetwork(bus)
        self._node: Any = PumpedNode(settings.node_id, bus)
        self._network[settings.node_id] = self._node

    def receive(self, frame: CanFrame, time: float) -> None:
        """Process the CAN frame of an SDO answer that arrived at `time` [s]."""
        self._network.notify(frame.arbitration_id, bytearray(frame.data), time)

    def run(self) -> Torques:
        """Check and configure the drive; return its torques."""
        self._identify()
        self._monitor()
        self._choose_mode()
        self._map()
        rated = self._read_if_there(0x6076)
        if self._settings.mode != "cst":
            return Torques(rated * self._torque_unit if rated else math.nan, 0)
        if not rated:
            raise RigError(
                f"{self._where}: object 6076h:00 is {rated or 'missing'}: expected the rated "
                "torque, because mode is cst"
            )
        return Torques(rated * self._torque_unit, self._read_if_there(0x6072) or MOST_TORQUE)

    @property
    def _torque_unit(self) -> float:
        return TORQUE_UNITS[self._settings.rated_torque_unit]

    def objects(self) -> dict[str, str]:
        """Return the objects of the drive that this module knows, by index and sub-index.

        An object that the drive does not have is left out. If the drive refuses to state an object,
        its answer is returned.
        """
        places = [(index, 0) for index in (*TEXTS, *VARIABLES)]
        places += [(index, sub) for index, kinds in RECORDS.items() for sub in kinds]
        found = {}
        for index, sub in places:
            name = f"{index:04X}h:{sub:02X}"
            try:
                value = self._entry(index, sub).raw
            except SdoAbortedError as error:
                if error.code not in NO_OBJECT:
                    found[name] = f"refused: {reason(error)}"
            except SdoCommunicationError as error:
                raise RigError(f"{self._where}: reading object {name}: {reason(error)}") from error
            else:
                found[name] = value.strip("\0 ") if isinstance(value, str) else f"{value:#x}"
        return found

    def _identify(self) -> None:
        settings = self._settings
        vendor = self._read_if_there(0x1018, 1) or 0
        unit = "micro_nm" if vendor == MAXON else "milli_nm"
        if settings.rated_torque_unit != unit:
            whose = "of maxon" if vendor == MAXON else "that is not of maxon"
            raise RigError(
                f"{self._where}: rated_torque_unit {settings.rated_torque_unit} for a drive "
                f"{whose}, vendor id 0x{vendor:X}: with a wrong unit of its rated torque (object "
                f"6076h), the force would be wrong by a factor of 1000: expected {unit}"
            )
        self._expect(0x1000, 0, PROFILE, "profile 402 in its low word", mask=0xFFFF)
        mode, bit = self._mode, self._mode.number - 1
        self._expect(
            0x6502, 0, 1 << bit, f"bit {bit}, cyclic synchronous {mode.name} mode", mask=1 << bit
        )
        if settings.vendor_id is not None:
            self._expect(0x1018, 1, settings.vendor_id, f"vendor_id 0x{settings.vendor_id:X}")
        if settings.product_code is not None:
            self._expect(
                0x1018, 2, settings.product_code, f"product_code 0x{settings.product_code:X}"
            )
        self._set_velocity_unit()

    def _set_velocity_unit(self) -> None:
        """Set the velocity unit, if the drive has the object 60A9h and another value in it."""
        unit = VELOCITY_UNITS[self._settings.velocity_unit]
        found = self._read_if_there(0x60A9)
        if found in (0, None, unit):
            return
        try:
            self._write(0x60A9, 0, unit)
        except RigError as error:
            names = [name for name, value in VELOCITY_UNITS.items() if value == found]
            if not names:
                raise
            raise RigError(f"{error}: expected velocity_unit {names[0]}, as it is now") from error

    def _monitor(self) -> None:
        """Set the drive's heartbeat period, and its reaction if the controller's heartbeat ends."""
        watchdog = self._settings.watchdog_ms
        self._write(0x1017, 0, watchdog // 4)
        self._write(0x1016, 1, NODE << 16 | watchdog)
        self._write(0x1029, 1, KEEP_NMT_STATE, optional=True)
        torque = self._settings.mode == "cst"
        lost = DISABLE_IF_MASTER_LOST if torque else QUICK_STOP_IF_MASTER_LOST
        self._write(0x6007, 0, lost)
        self._write(0x605A, 0, RAMP_THEN_DISABLE, optional=True)

    def _choose_mode(self) -> None:
        mode, target, name = self._mode
        self._write(0x6040, 0, Control.QUICK_STOP)
        self._write(target, 0, self._read(0x6064) if self._settings.mode == "csp" else 0)
        self._write(0x6060, 0, mode)
        if not self._bus.wait_for(lambda: self._read(0x6061) == mode, MODE_CHANGE):
            self._expect(
                0x6061, 0, mode, f"mode {mode}, cyclic synchronous {name}, as 6060h was set"
            )

    def _map(self) -> None:
        node = self._settings.node_id
        self._write(0x1400, 1, RPDO1 + node | INVALID)
        self._write(0x1400, 5, self._settings.watchdog_ms, optional=True)
        self._save(self._node.rpdo[1], RPDO1 + node, 0x6040, self._mode.target)
        self._save(self._node.tpdo[1], TPDO1 + node, 0x6041, 0x6064)
        self._save(self._node.tpdo[2], TPDO2 + node, 0x606C, 0x6077)
        for other in (0x1802, 0x1803):
            if (identifier := self._read_if_there(other, 1)) is not None:
                self._write(other, 1, identifier | INVALID)

    def _save(self, pdo: Any, identifier: int, *objects: int) -> None:
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.cob_id, pdo.trans_type = identifier, EVERY_SYNC
        pdo.rtr_allowed = identifier == RPDO1 + self._settings.node_id
        pdo.enabled = True
        self._ask(f"mapping of {' and '.join(f'{i:04X}h' for i in objects)}", pdo.save)

    def _expect(
        self, index: int, sub: int, value: int, meaning: str, mask: int = 0xFFFFFFFF
    ) -> None:
        found = self._read(index, sub)
        if found & mask != value:
            raise RigError(
                f"{self._where}: object {index:04X}h:{sub:02X} is 0x{found:X}: expected {meaning}"
            )

    def _entry(self, index: int, sub: int) -> Any:
        entry = self._node.sdo[index]
        return entry[sub] if index in RECORDS else entry

    def _read(self, index: int, sub: int = 0) -> int:
        what = f"reading object {index:04X}h:{sub:02X}"
        return int(self._ask(what, lambda: self._entry(index, sub).raw))

    def _read_if_there(self, index: int, sub: int = 0) -> int | None:
        what = f"reading object {index:04X}h:{sub:02X}"
        found = self._ask(what, lambda: self._entry(index, sub).raw, optional=True)
        return None if found is None else int(found)

    def _write(self, index: int, sub: int, value: int, optional: bool = False) -> None:
        def write() -> None:
            self._entry(index, sub).raw = value

        self._ask(f"writing 0x{value:X} to object {index:04X}h:{sub:02X}", write, optional)

    def _ask(self, what: str, request: Callable[[], Any], optional: bool = False) -> Any:
        """Return the result of `request()`; None if the object is `optional` and does not exist.

        `what` describes the request in error messages, for example `reading object 1000h:00`.
        """
        try:
            return request()
        except SdoAbortedError as error:
            if optional and error.code in NO_OBJECT:
                return None
            raise RigError(f"{self._where}: {what} is refused: {reason(error)}") from error
        except SdoCommunicationError as error:
            raise RigError(f"{self._where}: {what}: {reason(error)}") from error


class BusNetwork(Network):
    """A network of the package `canopen` that sends its frames on a `CanBus`."""

    def __init__(self, bus: CanBus) -> None:
        super().__init__()
        self._carrier = bus

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send a CAN data frame with the identifier `can_id`. The argument `remote` is ignored."""
        self._carrier.send(can_id, bytes(data))


class PumpedNode(RemoteNode):
    """The drive, as a node of the package `canopen`. A `PumpedSdo` sends its SDO requests."""

    def __init__(self, node: int, bus: CanBus) -> None:
        self._carrier = bus
        super().__init__(node, object_dictionary())

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> SdoClient:
        """Return a new SDO client (sender of requests), and append it to `sdo_channels`.

        Requests have the CAN identifier `rx_cobid`. Answers have the CAN identifier `tx_cobid`.
        """
        client = PumpedSdo(self._carrier, rx_cobid, tx_cobid, self.object_dictionary)
        self.sdo_channels.append(client)
        return client


class PumpedSdo(SdoClient):
    """An SDO client of `canopen` (sender of requests) that waits by reading a `CanBus`."""

    RESPONSE_TIMEOUT = 1.0
    """Longest wait for an answer [s]."""

    def __init__(self, bus: CanBus, *arguments: Any) -> None:
        super().__init__(*arguments)  # type: ignore[no-untyped-call]
        self._carrier = bus

    def read_response(self) -> bytes:
        """Wait for the answer of the drive to an SDO request, and return its data."""
        if not self._carrier.wait_for(lambda: not self.responses.empty(), self.RESPONSE_TIMEOUT):
            raise SdoCommunicationError(f"no answer within {self.RESPONSE_TIMEOUT:g} s")
        answer: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return answer
