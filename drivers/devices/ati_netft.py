"""Driver of ATI's force-torque sensors with a network connection: Net F/T and Ethernet Axia."""

from __future__ import annotations

import contextlib
import http.client
import math
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from drivers.codecs.ati_netft import (
    INTERNAL_RATE,
    PAGE,
    RESET_LATCH,
    START,
    STOP,
    Configuration,
    Record,
    decode,
    read_configuration,
    request,
    status_text,
)
from drivers.device import NO_SAMPLE, DatagramDevice, DeviceSettings, Sample
from drivers.rig import RigError, reason
from drivers.transports.datagram_port import DatagramPort

SIGNALS = {"fx": "N", "fy": "N", "fz": "N", "mx": "N m", "my": "N m", "mz": "N m"}
HTTP_TIME = 2.0
"""Longest wait for the page of the sensor [s]."""
LARGEST_PAGE = 1 << 17
"""Largest number of bytes of the page that are read."""
FIRST_RECORD = 1.0
"""Longest wait for the first record [s]."""
SILENCE = 0.1
"""If no record arrives in this time [s], the stream is requested again."""
PERIODS = 5.0
"""The same in periods of the stream, for a sensor with a slow stream."""
LATE = round(INTERNAL_RATE)
"""Largest number of internal samples by which a record is late. They are one second."""
FASTEST = 2.0 * INTERNAL_RATE
"""If the internal sample number increases by more than at this rate [Hz], or decreases by more than
`LATE`, the sensor was restarted. No sensor samples so fast."""
WRAP = 1 << 32
TOLERANCE = 1e-6
"""Largest relative difference between a scale of the rig file and that of the sensor."""


class AtiNetFtSettings(DeviceSettings):
    """Settings of a Net F/T or Ethernet Axia sensor in the rig file."""

    kind: Literal["ati_netft"]
    bus: str
    http_port: Annotated[int, Field(ge=1, le=65_535)] = 80
    """TCP port of the sensor's web server."""
    serial: str = ""
    """Serial number of the sensor's calibration; empty if it is not checked."""
    counts_per_n: Annotated[FiniteFloat, Field(gt=0)] | None = None
    """Counts per N; None if only the sensor states it."""
    counts_per_nm: Annotated[FiniteFloat, Field(gt=0)] | None = None
    """Counts per N m; None if only the sensor states it."""


class AtiNetFt(DatagramDevice):
    """A force-torque sensor of ATI with a network connection.

    The signals are `fx`, `fy`, `fz` [N] and `mx`, `my`, `mz` [N m]. The time of a sample is the
    time of arrival of its record. Of several records, that with the newest internal sample number
    is used. Lost, repeated and overtaken records are counted in `rejected`. If the sensor reports
    an error, `error` gives its text, and the values are not used. After a restart of the sensor,
    which ends its software bias, `error` reports the restart until the rig is opened again. The
    driver sets no software bias, because `teleop rig tare` measures the zero offsets.
    """

    Settings = AtiNetFtSettings
    settings: AtiNetFtSettings

    def __init__(self, name: str, settings: AtiNetFtSettings) -> None:
        super().__init__(name, settings)
        self._port: DatagramPort | None = None
        self._product = ""
        self._scales: tuple[float, ...] = (math.nan,) * 6
        self._silence = SILENCE
        self._newest: Record | None = None
        self._valid: tuple[tuple[int, ...], float] | None = None
        """Counts of the newest record of this tick without an error, and its time [s]."""
        self._seen = self._asked = -math.inf
        self._status = 0
        self._records = False
        self._restarted = ""

    def signals(self) -> dict[str, str]:
        """Return the unit of each signal: forces and moments."""
        return SIGNALS

    def start(self, port: DatagramPort) -> None:
        """Check the calibration of the sensor, and start its stream of records."""
        found = self._configuration(port)
        self._product = found.product
        self._scales = (1.0 / found.counts_per_n,) * 3 + (1.0 / found.counts_per_nm,) * 3
        self._silence = max(SILENCE, PERIODS / found.rate if found.rate else 0.0)
        self.samples = dict.fromkeys(SIGNALS, NO_SAMPLE)
        self._newest = self._valid = None
        self._status, self._restarted, self.error = 0, "", ""
        self._port, self._seen = port, -math.inf
        self._ask(port.now())
        if not port.wait_for(lambda: self._newest, FIRST_RECORD):
            raise RigError(
                f"{self.name}: no record in {FIRST_RECORD:g} s on {port.name} (UDP port "
                f"{port.port}): expected a Net F/T sensor with RDT at this port"
            )
        self.rejected.clear()

    def about(self) -> dict[str, str]:
        """Return the product, and the scales [counts per N and per N m]."""
        scales = f"{1.0 / self._scales[0]:g}, {1.0 / self._scales[3]:g}"
        return {"product": self._product or "not stated", "counts per N and per N m": scales}

    def _configuration(self, port: DatagramPort) -> Configuration:
        """Return the configuration of the sensor, after a comparison with the rig file.

        If the sensor has no web server, the scales of the rig file are used.
        """
        wanted = self.settings
        where = f"{self.name}: http://{port.host}:{wanted.http_port}{PAGE}"
        try:
            found = read_configuration(read_page(port.host, wanted.http_port))
        except (OSError, http.client.HTTPException) as error:
            if wanted.counts_per_n and wanted.counts_per_nm and not wanted.serial:
                return Configuration(
                    "", "", wanted.counts_per_n, wanted.counts_per_nm, rate=0.0, streams=True
                )
            raise RigError(
                f"{where}: {reason(error)}: expected the web server of a Net F/T sensor, or "
                "counts_per_n and counts_per_nm in the rig file"
            ) from error
        except ValueError as error:
            raise RigError(f"{where}: {error}") from error
        if wanted.serial and found.serial != wanted.serial:
            raise RigError(f"{where}: serial number {found.serial!r}, expected {wanted.serial!r}")
        for entry in ("counts_per_n", "counts_per_nm"):
            stated, actual = getattr(wanted, entry), getattr(found, entry)
            if stated and not math.isclose(stated, actual, rel_tol=TOLERANCE):
                raise RigError(f"{where}: {entry} {actual:.9g}, expected {stated:.9g}")
        if not found.streams:
            raise RigError(f"{where}: RDT is disabled: expected enabled, on its page Communication")
        return found

    def _ask(self, now: float) -> None:
        assert self._port
        self._asked = now
        self._port.send(request(START))

    def receive(self, data: bytes, time: float) -> None:
        """Process a record of the sensor."""
        record = decode(data)
        if record is None:
            self.rejected["length"] += 1
            return
        before, self._newest = self._newest, record
        if before:
            ahead = (record.ft_sequence - before.ft_sequence) % WRAP
            if ahead == 0 or ahead >= WRAP - LATE:
                self._newest = before
                self.rejected["overtaken" if ahead else "repeated"] += 1
                return
            if ahead > LATE + FASTEST * (time - self._seen):
                self._restarted = "the sensor was restarted: open the rig again"
            elif record.rdt_sequence > before.rdt_sequence + 1:
                self.rejected["lost"] += record.rdt_sequence - before.rdt_sequence - 1
        self._seen, self._records = time, True
        self._status |= record.status
        if not record.status:
            self._valid = record.counts, time

    def update(self, now: float) -> None:
        """Use the newest valid record of a tick, and report the errors of all its records.

        If there is no record, request the stream again. The ages of the samples show that the
        sensor is silent.
        """
        if self._valid:
            counts, time = self._valid
            for signal, count, scale in zip(SIGNALS, counts, self._scales, strict=True):
                self.samples[signal] = Sample(scale * count, time)
            self._valid = None
        if self._records:
            self.error = self._restarted or status_text(self._status, self._product)
            self._status, self._records = 0, False
        elif self._port and now - max(self._seen, self._asked) > self._silence:
            with contextlib.suppress(RigError):
                self._ask(now)

    def rearm(self) -> None:
        """Clear the error, and the latch of the monitor conditions of the sensor."""
        super().rearm()
        if self._port:
            with contextlib.suppress(RigError):
                self._port.send(request(RESET_LATCH))

    def stop(self) -> None:
        """Stop the stream of records."""
        if self._port:
            with contextlib.suppress(RigError):
                self._port.send(request(STOP))
        self._port = None


def read_page(host: str, port: int) -> bytes:
    """Return the page with the configuration of the sensor, by HTTP."""
    connection = http.client.HTTPConnection(host, port, timeout=HTTP_TIME)
    try:
        connection.request("GET", PAGE)
        answer = connection.getresponse()
        if answer.status != http.client.OK:
            raise http.client.HTTPException(f"HTTP status {answer.status}")
        return answer.read(LARGEST_PAGE)
    finally:
        connection.close()
