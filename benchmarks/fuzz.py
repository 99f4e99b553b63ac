"""Send malformed input to every parser of the drivers, which must neither raise nor hang.

    python benchmarks/fuzz.py                  # 10^6 inputs to each, about ten minutes
    python benchmarks/fuzz.py --inputs 1000

An input is a valid frame in which some bytes are changed, removed, duplicated or inserted. The
results of the parsers are not checked here, but in the tests. The printed time of the slowest input
shows whether a parser hangs.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import can

from drivers.codecs.ati_netft import read_configuration
from drivers.codecs.board import MessageReader
from drivers.codecs.bota import BotaParser
from drivers.codecs.ft300 import Ft300Parser
from drivers.device import DatagramDevice
from drivers.rig_file import read_rig_file
from drivers.transports.slcan import decode
from sim_backend.wire.slcan_adapter import SlcanAdapter

ROOT = Path(__file__).parents[1]
GOOD = {
    "ati_netft": bytes.fromhex("00000001 00000102 00000000") + bytes(range(24)),
    "netftapi2": b"<netft><scfgfu>N</scfgfu><scfgtu>Nm</scfgtu><cfgcpf>1000</cfgcpf>"
    b"<cfgcpt>1000</cfgcpt><comrdtrate>100</comrdtrate></netft>",
    "bota": bytes.fromhex(
        "aa00000000803f0000004000004040cdcccc3dcdcc4c3e9a99993ee80300000000c841dabb"
    ),
    "ft300": bytes.fromhex("204e640038ff2c010a00ecff1e00c826"),
    "moteus": bytes.fromhex("2404000a005000000170ff230d181400"),
    "slcan": b"t1818000102030405060708\r",
}


def malformed(good: bytes, chance: random.Random) -> bytes:
    """Return a malformed copy of a valid frame."""
    data = bytearray(good)
    for _ in range(chance.randrange(1, 5)):
        at = chance.randrange(len(data) + 1)
        kind = chance.randrange(5)
        if kind == 0:
            data[at : at + 1] = bytes([chance.randrange(256)])
        elif kind == 1:
            del data[at : at + chance.randrange(1, 4)]
        elif kind == 2:
            data[at:at] = data[at : at + chance.randrange(1, 9)]
        elif kind == 3:
            del data[at:]
        else:
            data[at:at] = chance.randbytes(chance.randrange(1, 9))
    return bytes(data)


def slcan_line(data: bytes) -> None:
    """Decode a line. Only ValueError is an allowed exception, because the bus counts it."""
    with contextlib.suppress(ValueError):
        decode(data.rstrip(b"\r"))


def page(data: bytes) -> None:
    """Read the page of a sensor. Only ValueError is an allowed exception."""
    with contextlib.suppress(ValueError):
        read_configuration(data)


def parsers() -> Iterator[tuple[str, bytes, Callable[[bytes], object]]]:
    """Yield every parser of bytes: its name, a valid frame, and the function that parses bytes."""
    from drivers.codecs import board

    yield "board", board.frame(board.HELLO, 1), MessageReader(Counter()).feed
    yield "bota", GOOD["bota"], BotaParser(Counter()).feed
    yield "ft300", GOOD["ft300"], Ft300Parser(Counter()).feed
    yield "netftapi2.xml", GOOD["netftapi2"], page
    yield "slcan line", GOOD["slcan"], slcan_line
    yield "slcan adapter", GOOD["slcan"], SlcanAdapter().receive


def devices() -> Iterator[tuple[str, bytes, Callable[[bytes], object]]]:
    """Yield every device of the example rigs that receives CAN frames or datagrams.

    For each device, yield its name, valid data, and a function that receives data.
    """
    for path in sorted((ROOT / "rigs").glob("*.toml")):
        for name, device in read_rig_file(path).make_devices().items():
            if isinstance(device, DatagramDevice):
                yield f"{path.stem}: {name}", GOOD["ati_netft"], partial(device.receive, time=0.0)
            if not hasattr(device, "identifiers"):
                continue
            identifiers = list(device.identifiers())
            chance = random.Random(name)

            def receive(data: bytes, device=device, identifiers=identifiers, chance=chance):
                identifier = chance.choice(identifiers)
                frame = can.Message(
                    arbitration_id=identifier & 0x1FFFFFFF,
                    is_extended_id=bool(identifier >> 31),
                    is_fd=device.needs_fd,
                    data=data[: 64 if device.needs_fd else 8],
                )
                device.receive(frame, 0.0)

            good = GOOD["moteus"] if device.needs_fd else bytes(range(8))
            yield f"{path.stem}: {name}", good, receive


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--inputs", type=int, default=1_000_000)
    given = parser.parse_args()
    print(f"{given.inputs} malformed inputs each")
    for name, good, receive in (*parsers(), *devices()):
        chance = random.Random(name)
        slowest = 0.0
        start = time.perf_counter()
        for _ in range(given.inputs):
            data = malformed(good, chance)
            before = time.perf_counter()
            receive(data)
            slowest = max(slowest, time.perf_counter() - before)
        total = time.perf_counter() - start
        print(f"  {name:40} nothing raised; slowest {slowest * 1e3:.1f} ms, {total:.0f} s in all")


if __name__ == "__main__":
    main()
