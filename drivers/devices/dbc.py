"""Driver of a device that sends CAN frames without a request. A DBC file describes the frames."""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

import cantools
from cantools.database.can import Database, Message
from pydantic import Field, FiniteFloat, ValidationInfo, field_validator, model_validator

from drivers.device import CanDevice, DeviceSettings, Sample
from drivers.input_file import read_input
from drivers.rig import RigError, reason
from drivers.transports.can_adapter import EXTENDED

if TYPE_CHECKING:
    from drivers.transports.can_bus import CanBus
    from drivers.transports.can_frame import CanFrame


class DbcSettings(DeviceSettings):
    """Settings, in the rig file, of a device on a CAN bus whose frames a DBC file describes."""

    kind: Literal["dbc"]
    bus: str
    file: Path
    """Path of the DBC file, relative to the folder of the rig file."""
    messages: tuple[str, ...] = ()
    """Names of the messages that the device sends; if empty, all messages in the DBC file."""
    timeout_ms: Annotated[FiniteFloat, Field(gt=0, le=60_000)] = 1000.0
    """Longest wait for the first frames at the start [ms]."""

    @field_validator("file")
    @classmethod
    def _seen_from_the_rig_file(cls, file: Path, info: ValidationInfo) -> Path:
        return Path((info.context or {}).get("folder", "")) / file

    @model_validator(mode="after")
    def _has_its_messages(self) -> Self:
        self.read()
        return self

    def read(self) -> list[Message]:
        """Read the DBC file, and return the descriptions of the messages that the device sends."""
        try:
            logging.getLogger("cantools").setLevel(logging.ERROR)
            text = read_input(self.file).decode("cp1252", "replace").replace("\r\n", "\n")
            database = cantools.database.load_string(text, "dbc")
        except OSError as error:
            why = (error.strerror or str(error)).lower()
            raise ValueError(f"file {self.file}: {why}") from error
        except cantools.Error as error:
            raise ValueError(f"file {self.file}: not a DBC file: {reason(error)}") from error
        assert isinstance(database, Database)
        known = {message.name: message for message in database.messages}
        if not known:
            raise ValueError(f"file {self.file}: no message in it: expected at least one")
        for name in self.messages:
            if name not in known:
                raise ValueError(f"messages: {name!r}: expected some of {', '.join(known)}")
        used = [known[name] for name in dict.fromkeys(self.messages) or known]
        for message in used:
            for signal in message.signals:
                if not signal.scale:
                    raise ValueError(
                        f"file {self.file}: signal {message.name}.{signal.name} has scale 0: "
                        "expected another scale"
                    )
        return used


class DbcDevice(CanDevice):
    """A device on a CAN bus whose messages a DBC file describes.

    A message is a type of frame. Its name and its signals are given by the DBC file. The device has
    all signals of its messages, in the units of the DBC file. If several messages have a signal
    with the same name, these signals are named `Message.signal`. A frame contains a multiplexed
    signal only for certain values of its multiplexer field. Such a signal gets a new sample only
    from the frames that contain it. A frame is rejected if it is too short, or if the value of its
    multiplexer field is unknown.
    """

    Settings = DbcSettings
    settings: DbcSettings

    def __init__(self, name: str, settings: DbcSettings) -> None:
        messages = settings.read()
        self._messages = {identifier(message): message for message in messages}
        self._names = signal_names(messages)
        super().__init__(name, settings)
        self._heard: set[str] = set()

    def signals(self) -> dict[str, str]:
        """Return the unit that the DBC file gives for each signal, by the name of the signal."""
        return {
            self._names[message.name, signal.name]: signal.unit or ""
            for message in self._messages.values()
            for signal in message.signals
        }

    def identifiers(self) -> list[int]:
        """Return the CAN identifiers of the device's messages.

        If an identifier has 29 bits (extended frame), bit 31 of the returned number is set.
        """
        return list(self._messages)

    def start(self, bus: CanBus) -> None:
        """Wait for one frame of each message that is listed in the settings.

        If the settings list no message, wait for any frame of the device.
        """
        self._heard.clear()
        named = set(self.settings.messages)
        seconds = self.settings.timeout_ms * 1e-3
        if not bus.wait_for(lambda: self._heard and self._heard >= named, seconds):
            silent = [
                f"{message.name} ({message.frame_id:#x})"
                for message in self._messages.values()
                if message.name not in self._heard
            ]
            raise RigError(
                f"{self.name}: no frame of {', '.join(silent)} in {seconds:g} s on {bus.name} "
                f"({bus.channel}): expected those of {self.settings.file.name}"
            )

    def receive(self, frame: CanFrame, time: float) -> None:
        """Decode a frame, and store the values of its signals in `samples`."""
        message = self._messages[frame.arbitration_id | frame.is_extended_id * EXTENDED]
        if frame.is_remote_frame:
            self.rejected["remote"] += 1
            return
        if len(frame.data) < message.length:
            self.rejected["length"] += 1
            return
        try:
            values = message.decode(bytes(frame.data), decode_choices=False)
        except (cantools.Error, ValueError):
            self.rejected["multiplexer"] += 1
            return
        assert isinstance(values, dict)
        self._heard.add(message.name)
        for signal, value in values.items():
            number = float(value)  # type: ignore[arg-type]
            if math.isfinite(number):
                self.samples[self._names[message.name, signal]] = Sample(number, time)
            else:
                self.rejected["not finite"] += 1


def identifier(message: Message) -> int:
    """Return the CAN identifier of a message. If it has 29 bits, bit 31 of the result is set."""
    return message.frame_id | message.is_extended_frame * EXTENDED


def signal_names(messages: list[Message]) -> dict[tuple[str, str], str]:
    """Return a unique name for each signal of some messages of a DBC file.

    The result is a dictionary. Each key is a pair: the name of the message, and the name of the
    signal in the DBC file. Each value is the unique name of the signal. If only one message has a
    signal with this name, the unique name is the name of the signal. Otherwise the unique name is
    `Message.signal`.
    """
    count = Counter(signal.name for message in messages for signal in message.signals)

    def named() -> Iterator[tuple[tuple[str, str], str]]:
        for message in messages:
            for signal in message.signals:
                alone = count[signal.name] == 1
                name = signal.name if alone else f"{message.name}.{signal.name}"
                yield (message.name, signal.name), name

    return dict(named())
