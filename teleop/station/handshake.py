"""Begin a session: the two stations exchange random numbers, and compare their settings.

1. The master sends a HELLO with its random number (nonce) and its settings, until it is answered.
2. The slave answers with a WELCOME, with both nonces and its own settings.
3. Both derive the keys of the session from the key file and both nonces. The first datagram with a
   valid signature shows the slave that the master knows its nonce.

HELLO and WELCOME are signed with keys that are derived from the key file. An old HELLO that
somebody sends again gets an answer, but begins no session, because only the owner of the key can
continue. A session has the length of a run: a station that has a session accepts no other one.
"""

from __future__ import annotations

import json
import secrets
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any, NamedTuple

from teleop.names import SideName
from teleop.station.datagram import (
    HELLO,
    MAGIC,
    SIGNATURE,
    VERSION,
    WELCOME,
    is_signed,
    sign,
    unpack,
)
from teleop.station.keys import NONCE_SIZE, Session, derive, make_session

HEAD = 4
"""Size of the beginning of a datagram: letters, version and kind [bytes]."""
TEXT = HEAD + 2 * NONCE_SIZE
"""Where the settings begin in a datagram of the handshake."""
LARGEST = 1200
"""Largest size of a datagram of the handshake, which every network passes undivided [bytes]."""
CANDIDATES = 8
"""Number of answered HELLOs from which a session can begin. Older ones are forgotten."""
PURPOSES = {HELLO: "hello", WELCOME: "welcome"}

Document = Mapping[str, Any]
"""Settings of a station that the other one compares with its own."""


class Greeting(NamedTuple):
    """Content of a HELLO or a WELCOME."""

    nonces: bytes
    """Nonce of the master, and that of the slave, which is zero in a HELLO."""
    settings: Document


def write_greeting(kind: int, key: bytes, nonces: bytes, settings: Document) -> bytes:
    """Return the signed bytes of a HELLO or a WELCOME."""
    text = json.dumps(settings, separators=(",", ":")).encode()
    body = MAGIC + bytes((VERSION, kind)) + nonces + text
    if len(body) + SIGNATURE > LARGEST:
        raise ValueError(f"settings of {len(text)} bytes: expected fewer")
    return body + sign(body, derive(key, PURPOSES[kind]))


def read_greeting(kind: int, key: bytes, data: bytes) -> Greeting | None:
    """Return the content of a HELLO or a WELCOME; None if the bytes are none or not signed."""
    if not TEXT + SIGNATURE <= len(data) <= LARGEST:
        return None
    if data[:HEAD] != MAGIC + bytes((VERSION, kind)):
        return None
    if not is_signed(data, derive(key, PURPOSES[kind])):
        return None
    return Greeting(data[HEAD:TEXT], json.loads(data[TEXT:-SIGNATURE]))


class MasterHandshake:
    """Handshake of the master. `settings` are its settings, which the slave compares."""

    side: SideName = "master"

    def __init__(self, key: bytes, settings: Document) -> None:
        self._key = key
        self._nonce = secrets.token_bytes(NONCE_SIZE)
        self.hello = write_greeting(HELLO, key, self._nonce + bytes(NONCE_SIZE), settings)
        """Datagram that is sent until the slave answers."""
        self.settings: Document = {}
        """Settings of the slave, once `receive` has returned a session."""

    def receive(self, data: bytes) -> Session | None:
        """Return the session that a WELCOME begins; None for any other datagram."""
        welcome = read_greeting(WELCOME, self._key, data)
        if not welcome or welcome.nonces[:NONCE_SIZE] != self._nonce:
            return None
        self.settings = welcome.settings
        return make_session(self._key, welcome.nonces, self.side)


class SlaveHandshake:
    """Handshake of the slave. `settings` are its settings, which the master compares."""

    side: SideName = "slave"

    def __init__(self, key: bytes, settings: Document) -> None:
        self._key = key
        self._own = settings
        self._nonce = secrets.token_bytes(NONCE_SIZE)
        self._candidates: OrderedDict[int, tuple[Session, Document]] = OrderedDict()
        self.settings: Document = {}
        """Settings of the master of the latest HELLO, or of the session that has begun."""

    def answer(self, data: bytes) -> bytes | None:
        """Return the WELCOME that answers a HELLO; None for any other datagram."""
        hello = read_greeting(HELLO, self._key, data)
        if not hello:
            return None
        nonces = hello.nonces[:NONCE_SIZE] + self._nonce
        session = make_session(self._key, nonces, self.side)
        self._candidates[session.number] = session, hello.settings
        while len(self._candidates) > CANDIDATES:
            self._candidates.popitem(last=False)
        self.settings = hello.settings
        return write_greeting(WELCOME, self._key, nonces, self._own)

    def receive(self, data: bytes) -> Session | None:
        """Return the session that the first signed datagram of a tick begins, or None."""
        datagram = unpack(data)
        if not datagram or datagram.session not in self._candidates:
            return None
        session, settings = self._candidates[datagram.session]
        if not is_signed(data, session.receive_key):
            return None
        self.settings = settings
        return session


def differences(own: Document, others: Document) -> list[str]:
    """Return a text for each setting in which two stations differ."""
    names = [*own, *(name for name in others if name not in own)]
    return [
        f"{name}: here {own.get(name, 'not stated')}, at the other station "
        f"{others.get(name, 'not stated')}"
        for name in names
        if own.get(name) != others.get(name)
    ]
