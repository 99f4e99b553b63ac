"""Check the requests that the live page, a web page, sends to the server as small JSON objects."""

from __future__ import annotations

from typing import Any

from teleop.json_documents import loads

LONGEST_MESSAGE = 1024
"""Largest size of a message from the live page [bytes]."""
LARGEST = 1 << 53
"""Largest integer in a message. Each smaller integer is equal to a floating-point number."""
FIELDS: dict[str, dict[str, tuple[type, ...]]] = {
    "hello": {"token": (str,), "view": (str,)},
    "beat": {"seen": (int, float), "at": (int, float)},
    "stop": {},
    "end": {},
    "unlock": {},
    "start": {},
    "control": {},
    "release": {},
    "pointer": {"depth": (int, float), "grip": (bool,)},
    "choose": {},
    "next": {"prompt": (int,)},
    "repeat": {"prompt": (int,)},
    "skip": {"prompt": (int,)},
    "notes": {"text": (str,), "prompt": (int,)},
    "seek": {"t": (int, float)},
    "play": {"rate": (int, float)},
}
"""Fields of each kind of request, and the types of their values."""
ANSWERS = {"next", "repeat", "skip", "notes"}
"""Requests that answer a question, which the control process asks between two trials.

The field `prompt` is the number of the question. An answer to an earlier question is refused.
"""
CHOICES: dict[str, tuple[type, ...]] = {
    "condition": (str,),
    "specimen": (str,),
    "duration": (int, float),
    "feedback": (str,),
    "estimators": (list,),
}
"""Optional fields of the request `choose`."""
IN_CONTROL = {"end", "unlock", "start", "pointer", "choose", *ANSWERS}
"""Requests that only the client (connected live page) that has control may send."""


class BadRequest(ValueError):
    """Error: a request of the live page is not valid, or is not possible at present."""


def parse_request(message: str | bytes) -> dict[str, Any]:
    """Return the request in a message; raise BadRequest if it is not one of `FIELDS`."""
    if isinstance(message, bytes):
        raise BadRequest("expected text")
    try:
        request = loads(message)
    except ValueError as error:
        raise BadRequest("expected a JSON object") from error
    kind = request.get("type")
    fields = FIELDS.get(kind) if isinstance(kind, str) else None
    if fields is None:
        raise BadRequest("unknown type of request")
    if kind == "choose":
        fields = {name: types for name, types in CHOICES.items() if name in request}
        if not fields:
            raise BadRequest(f"choose: expected at least one of {', '.join(CHOICES)}")
    if set(request) != {"type", *fields}:
        raise BadRequest(f"{kind}: expected the fields {', '.join(fields) or 'none'}")
    for name, types in fields.items():
        value = request[name]
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            raise BadRequest(f"{kind}.{name}: expected a value of another type")
        if isinstance(value, int) and abs(value) > LARGEST:
            raise BadRequest(f"{kind}.{name}: expected a smaller number")
    return request
