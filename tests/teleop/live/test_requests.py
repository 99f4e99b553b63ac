"""Which HTTP requests the server accepts, and which messages of the live page."""

from __future__ import annotations

import json

import pytest

from teleop.errors import InputError
from teleop.live.requests import FIELDS, BadRequest, parse_request
from teleop.live.security import Gate, is_loopback, resolve

ADDRESSES = {"MyPC": "192.168.0.7", "::1": "::1", "127.0.0.1": "127.0.0.1", "127.1": "127.0.0.1"}
"""Network addresses of hosts."""


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
        ("127.1", 8000, "127.0.0.1:8000"),  # and an address in its usual form
    ],
)
def test_the_own_page_is_accepted_as_browsers_write_its_address(name, port, host):
    assert refusal(Gate(name, ADDRESSES[name], port), host, f"http://{host}") == ""


@pytest.mark.parametrize("host", ["mypc", "mypc:80", "other:8000"])
def test_another_port_or_name_is_refused(host):
    assert refusal(Gate("MyPC", ADDRESSES["MyPC"], 8000), host, f"http://{host}").startswith("Host")


@pytest.mark.parametrize("host", ["mypc", "mypc:80"])
def test_a_page_of_another_server_is_refused(host):
    assert refusal(Gate("MyPC", ADDRESSES["MyPC"], 80), host, "http://evil.example").startswith(
        "Origin"
    )


@pytest.mark.parametrize(
    "host",
    [
        *("", "*", "0", "0.0", "0x0", "00.0.0.0", "0.0.0.0", "::", "::0", "0000::", "0:0::0"),
        *("::ffff:0.0.0.0", "::ffff:0:0", "224.0.0.1", "ff02::1", "255.255.255.255"),
    ],
)
def test_a_host_that_stands_for_several_addresses_is_refused_however_it_is_written(host):
    with pytest.raises(InputError, match="expected one address"):
        resolve(host)


def test_a_name_with_the_address_of_all_interfaces_is_refused(monkeypatch):
    def named(*_, **__):
        return [(None, None, 0, "", (address, 0)) for address in ("127.0.0.1", "0.0.0.0")]

    monkeypatch.setattr("socket.getaddrinfo", named)
    with pytest.raises(InputError, match="host 'everything': expected one address"):
        resolve("everything")


def test_a_host_is_resolved_to_the_address_at_which_the_server_listens():
    hosts = ("127.0.0.1", "127.1", "0x7f.1", "::1", "192.0.2.1", "::ffff:127.0.0.1")
    found = [resolve(host) for host in hosts]
    assert found[:5] == ["127.0.0.1", "127.0.0.1", "127.0.0.1", "::1", "192.0.2.1"]
    assert [is_loopback(address) for address in found] == [True, True, True, True, False, True]


@pytest.mark.parametrize("value", [10**400, -(10**400), 1 << 60])
@pytest.mark.parametrize(
    ("kind", "name"),
    [(kind, name) for kind, fields in FIELDS.items() for name in fields if int in fields[name]],
)
def test_an_integer_that_is_not_exact_as_a_floating_point_number_is_refused(kind, name, value):
    others = {other: types[0]() for other, types in FIELDS[kind].items() if other != name}
    with pytest.raises(BadRequest, match=f"{kind}.{name}: expected a smaller number"):
        parse_request(json.dumps({"type": kind, **others, name: value}))


def test_a_choice_of_nothing_is_refused():
    with pytest.raises(BadRequest, match="expected at least one of condition, specimen"):
        parse_request('{"type": "choose"}')
