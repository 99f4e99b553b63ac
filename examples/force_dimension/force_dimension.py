"""One axis of a haptic device of Force Dimension, by the vendor's SDK (version 3.14 or later)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from ctypes import POINTER, c_char_p, c_double, c_int, c_int8
from typing import Annotated, Any, Literal

from pydantic import Field

from drivers.device import DeviceSettings, ForceDrive, LibraryDevice, Sample
from drivers.rig import RigError

FORCE_ON = 5  # DHD_STATUS_FORCE


class ForceDimensionSettings(DeviceSettings):
    kind: Literal["force_dimension"]
    library: str = "libdhd.so"
    index: Annotated[int, Field(ge=0, le=15)] = 0  # number of the device on this computer
    model: Annotated[str, Field(min_length=1)]  # as the SDK states it, for example omega.3
    axis: Literal["x", "y", "z"]
    max_force_n: Annotated[float, Field(gt=0)]
    watchdog_ms: Annotated[float, Field(gt=0, le=1000)] = 50.0


class ForceDimension(LibraryDevice, ForceDrive):
    """A drive that accepts a force along one axis. The calls of the SDK wait for the USB.

    Without a command for `watchdog_ms`, this driver switches the forces off. If the whole process
    has ended, only the device can do so.
    """

    Settings = ForceDimensionSettings

    def __init__(self, name: str, settings: ForceDimensionSettings) -> None:
        super().__init__(name, settings)
        self.drives = {"axis": self}
        self._sdk: Any
        self._id = -1
        self._position = [c_double() for _ in range(3)]
        self._wanted = False
        self._force = self._commanded = self._now = 0.0

    def signals(self) -> dict[str, str]:
        return {"position": "m"}

    def start(self, now: Callable[[], float]) -> None:
        s, self.error = self.settings, ""
        try:
            self._sdk = ctypes.CDLL(s.library)
            self._sdk.dhdGetPosition.argtypes = (POINTER(c_double),) * 3 + (c_int8,)
            self._sdk.dhdSetForce.argtypes = (c_double,) * 3 + (c_int8,)
            self._sdk.dhdGetSystemName.restype = self._sdk.dhdErrorGetLastStr.restype = c_char_p
        except (OSError, AttributeError) as error:
            raise RigError(f"{self.name}: {error}: expected the SDK as {s.library!r}") from error
        if (opened := self._sdk.dhdOpenID(s.index)) < 0:
            raise RigError(f"{self.name}: device {s.index}: {self._problem()}")
        self._id = opened
        if (model := (self._sdk.dhdGetSystemName(self._id) or b"").decode()) != s.model:
            raise RigError(f"{self.name}: model {model!r}, expected {s.model!r}")
        self.idle()
        self.update(now())

    def _problem(self) -> str:
        return str((self._sdk.dhdErrorGetLastStr() or b"unknown error").decode())

    def _call(self, name: str, *arguments: Any) -> bool:
        """Call a function; return whether it has succeeded, otherwise set `error`."""
        if getattr(self._sdk, name)(*arguments, self._id) >= 0:
            return True
        self.error = self.error or f"{name}: {self._problem()}"
        return False

    def update(self, now: float) -> None:
        self._now = now
        if self._id >= 0 and self._call("dhdGetPosition", *self._position):
            x = self._position["xyz".index(self.settings.axis)].value
            self.samples["position"] = Sample(x, now)
        if self._wanted and now - self._commanded > self.settings.watchdog_ms * 1e-3:
            self.error = self.error or "watchdog: no command arrived in time"
        if self._wanted and self.error:
            self._switch(False)

    def _switch(self, on: bool) -> bool:
        """Set the force 0, switch forces on or off; return whether the device confirms it."""
        status = (c_int * 32)()
        sent = self._call("dhdSetForce", 0.0, 0.0, 0.0) and self._call("dhdEnableForce", int(on))
        return sent and self._call("dhdGetStatus", status) and bool(status[FORCE_ON]) is on

    def enable(self) -> bool:
        if not self._wanted:
            self._wanted, self._commanded, self.error = True, self._now, ""
        return not self.error and self._switch(True)

    def command(self, force: float) -> float:
        most = 0.0 if self.error else self.settings.max_force_n
        self._force = min(max(force, -most), most)
        return self._force

    def transmit(self) -> None:
        if self._wanted and not self.error:
            self._commanded = self._now
            self._call("dhdSetForce", *(self._force * (a == self.settings.axis) for a in "xyz"))

    def idle(self) -> bool:
        self._wanted, self._force = False, 0.0
        return self._id < 0 or self._switch(False)

    def stop(self) -> None:
        if self._id >= 0:
            self._sdk.dhdClose(self._id)
        self._id = -1
