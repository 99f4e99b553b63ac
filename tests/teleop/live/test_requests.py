"""Which HTTP requests the server accepts, and which messages of the live page."""

from __future__ import annotations

import json

import pytest

from teleop.live.requests import FIELDS, BadRequest, parse_request
from teleop.live.security import Gate


def refusal(gate, host, origin):
    headers = {"Host": [host], "Origin": [origin]}
    return gate.refusal(headers.__getitem__, with_origin=True)


@pytest.mark.parametrize(
    ("name", "port", "host"),
    [
        ("MyPC", 8000, "mypc:8000"),  # browsers send names in lower-case letters
        ("MyPC", 80, "mypc"),  # and omit the port 80
        ("MyPC", 80, "mypc:80"),
        ("::1", 80, "[::1]"),
        ("127.0.0.1", 80, "localhost"),
    ],
)
def test_the_own_page_is_accepted_as_browsers_write_its_address(name, port, host):
    assert refusal(Gate(name, port), host, f"http://{host}") == ""


@pytest.mark.parametrize("host", ["mypc", "mypc:80", "other:8000"])
def test_another_port_or_name_is_refused(host):
    assert refusal(Gate("MyPC", 8000), host, f"http://{host}").startswith("Host")


@pytest.mark.parametrize("host", ["mypc", "mypc:80"])
def test_a_page_of_another_server_is_refused(host):
    assert refusal(Gate("MyPC", 80), host, "http://evil.example").startswith("Origin")


@pytest.mark.parametrize("value", [10**400, -(10**400), 1 << 60])
@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, name) for kind, fields in FIELDS.items() for name in fields if int in fields[name]],
)
def test_an_integer_that_is_not_exact_as_a_floating_point_number_is_refused(kind, name, value):
    others = {other: types[0]() for other, types in FIELDS[kind].items() if other != name}
    with pytest.raises(BadRequest, match=f"{kind}.{name}: expected a smaller number"):
        parse_request(json.dumps({"type": kind, **others, name: value}))
