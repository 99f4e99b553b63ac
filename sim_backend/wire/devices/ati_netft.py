"""Emulated Net F/T force-torque sensor of ATI Industrial Automation.

Source: Net F/T Installation and Operation Manual, 9620-05-NET FT. The sensor samples 7000 times per
second. It sends each n-th sample, such that the rate is the configured one or the next higher one.
Any request replaces the one before.
"""

from __future__ import annotations

import math
from struct import pack, unpack
from typing import TYPE_CHECKING

from sim_backend.wire.emulated_device import EmulatedDatagramDevice, Mount

if TYPE_CHECKING:
    from drivers.devices.ati_netft import AtiNetFtSettings

INTERNAL = 7000
"""Number of internal samples per second."""
RANGES = {"fx": 330.0, "fy": 330.0, "fz": 990.0, "mx": 30.0, "my": 30.0, "mz": 30.0}
"""Measuring ranges of a Gamma SI-330-30 [N, N m]."""
SATURATED = 0x80020000
"""Status word: the error bit, and the bit for a value outside of its measuring range."""
COUNTS = 1_000_000.0
"""Usual number of counts per N and per N m."""
BACKLOG = 35
"""Largest number of overdue records that are sent at once; older records are omitted."""
XML = """<?xml version="1.0"?><netft>
<prodname>Net F/T</prodname>
<runstat>0x00000000</runstat><runrate>7000</runrate>
<cfgnam>emulated</cfgnam><cfgcalsel>0</cfgcalsel><cfgcalsn>{serial}</cfgcalsn>
<cfgfu>2</cfgfu><scfgfu>N</scfgfu><cfgtu>3</cfgtu><scfgtu>Nm</scfgtu>
<cfgcpf>{force:g}</cfgcpf><cfgcpt>{torque:g}</cfgcpt>
<cfgmr>330;330;990;30;30;30</cfgmr>
<comrdte>Enabled</comrdte><comrdtrate>{rate}</comrdtrate><comrdtbsiz>1</comrdtbsiz>
<mfgdigver>2.2.59</mfgdigver>
</netft>
"""


class EmulatedAtiNetFt(EmulatedDatagramDevice):
    """A Net F/T sensor with the signals `fx`, `fy`, `fz`, `mx`, `my` and `mz`."""

    def __init__(self, name: str, settings: AtiNetFtSettings, mount: Mount) -> None:
        super().__init__(name, settings, mount)
        self._every = max(1, int(INTERNAL / min(mount.rate, INTERNAL)))
        """Number of internal samples per record."""
        force = settings.counts_per_n or COUNTS
        torque = settings.counts_per_nm or COUNTS
        self._scales = dict(zip(RANGES, [force] * 3 + [torque] * 3, strict=True))
        self._bias = dict.fromkeys(RANGES, 0.0)
        self._power_up = math.nan
        self._left = 0.0
        """Number of records that are still to be sent."""
        self._record = 0
        self._sample = 0
        """Internal number of the next sample that is sent."""
        self.pages = {
            "/netftapi2.xml": XML.format(
                serial=settings.serial or "FT00001",
                force=force,
                torque=torque,
                rate=INTERNAL // self._every,
            ).encode()
        }

    def _time(self, sample: int) -> float:
        return self._power_up + sample / INTERNAL

    def _switch_on(self, now: float) -> None:
        if math.isnan(self._power_up):
            self._power_up = now

    def receive(self, data: bytes, now: float) -> None:
        """Process a request. Datagrams that are no requests are ignored."""
        self._switch_on(now)
        if len(data) != 8:
            return
        header, command, count = unpack(">HHI", data)
        if header != 0x1234:
            return
        if command in (2, 3):
            self._left = count or math.inf
            self._record = 0
            self._sample = int((now - self._power_up) * INTERNAL) + 1
        elif command == 0:
            self._left = 0
        elif command == 0x42:
            self._bias = {signal: self.mount.sense(signal) for signal in RANGES}

    def due(self) -> float:
        """Return the time of the next record [s]. It is infinite if the sensor does not stream."""
        return self._time(self._sample) if self._left else math.inf

    def emit(self, now: float) -> list[bytes]:
        """Return the records that are due at time `now` [s]."""
        self._switch_on(now)
        oldest = int((now - self._power_up) * INTERNAL) - BACKLOG * self._every
        if self._left and self._sample < oldest:
            skipped = (oldest - self._sample) // self._every
            self._sample += skipped * self._every
            self._record += skipped
        records = []
        while self._left and self._time(self._sample) <= now:
            self._record += 1
            self._left -= 1
            records.append(self._encoded())
            self._sample += self._every
        return records

    def _encoded(self) -> bytes:
        status, counts = 0, []
        for signal, most in RANGES.items():
            value = self.mount.sense(signal)
            if not abs(value) <= most:
                status, value = SATURATED, math.copysign(most, value)
            counts.append(round((value - self._bias[signal]) * self._scales[signal]))
        numbers = self._record % 2**32, self._sample % 2**32
        return pack(">3I6i", *numbers, status, *counts)
