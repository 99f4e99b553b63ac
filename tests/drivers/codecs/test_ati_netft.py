from __future__ import annotations

import contextlib
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.codecs.ati_netft import (
    RESET_LATCH,
    START,
    STOP,
    decode,
    read_configuration,
    request,
    status_text,
)

# of a Gamma SI-330-30 with firmware 2.2.59, shortened
PAGE = b"""<?xml version="1.0"?><netft>
<runstat>0x00000000</runstat><runrate>7000</runrate>
<cfgnam>empty</cfgnam><cfgcalsel>0</cfgcalsel><cfgcalsn>FT27462</cfgcalsn>
<scfgfu>N</scfgfu><scfgtu>Nm</scfgtu>
<cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>
<cfgmr>330;330;990;30;30;30</cfgmr>
<comrdte>Enabled</comrdte><comrdtrate>100</comrdtrate><comrdtbsiz>1</comrdtbsiz>
<mfgdigsn>LOT2821</mfgdigsn><mfgdigver>2.2.59</mfgdigver>
</netft>"""


@pytest.mark.parametrize(
    ("command", "data"),
    [
        (START, "12 34 00 02 00 00 00 00"),
        (STOP, "12 34 00 00 00 00 00 00"),
        (RESET_LATCH, "12 34 00 41 00 00 00 00"),
    ],
)
def test_requests_are_those_of_the_manual(command, data):
    assert request(command) == bytes.fromhex(data)


def test_a_record_is_decoded_with_signs():
    head = bytes.fromhex("00000001 00000102 80020000")
    counts = (1, -1, 2**31 - 1, -(2**31), 0, -5)
    assert decode(head + struct.pack(">6i", *counts)) == (1, 0x102, 0x80020000, counts)


@pytest.mark.parametrize("length", [0, 35, 37, 72])
def test_a_record_of_another_length_is_refused(length):
    assert decode(bytes(length)) is None


@pytest.mark.parametrize(
    ("status", "product", "text"),
    [
        (0, "Net F/T", ""),
        (0x80020000, "Net F/T", "saturation or A/D error"),
        (0x80020004, "", "saturation or A/D error, internal temperature error"),
        (0x80010000, "Net F/T", "monitor condition latched"),
        (0x80000000, "Net F/T", "unknown error, status 0x80000000"),
        (0x80000004, "Ethernet Axia", "broken strain gage"),
        (0xC0000000, "Ethernet Axia", "force or torque out of range"),
    ],
)
def test_a_status_word_is_told_as_text(status, product, text):
    assert status_text(status, product) == text


def test_the_page_of_a_sensor_is_read():
    found = read_configuration(PAGE)
    assert found == ("", "FT27462", 1e6, 1e6, 100.0, True)


@pytest.mark.parametrize(
    ("force", "torque", "counts_per_n", "counts_per_nm"),
    [
        ("N", "N-m", 1e6, 1e6),
        ("kN", "kN-m", 1e3, 1e3),
        ("lbf", "lbf-in", 1e6 / 4.4482216152605, 1e6 / (4.4482216152605 * 0.0254)),
        ("klbf", "lbf-ft", 1e3 / 4.4482216152605, 1e6 / (4.4482216152605 * 0.3048)),
        ("kgf", "kgf-cm", 1e6 / 9.80665, 1e8 / 9.80665),
        ("gf", "Nmm", 1e9 / 9.80665, 1e9),
    ],
)
def test_scales_in_other_units_are_converted(force, torque, counts_per_n, counts_per_nm):
    page = PAGE.replace(b"<scfgfu>N<", f"<scfgfu>{force}<".encode())
    found = read_configuration(page.replace(b"<scfgtu>Nm<", f"<scfgtu>{torque}<".encode()))
    assert found.counts_per_n == pytest.approx(counts_per_n)
    assert found.counts_per_nm == pytest.approx(counts_per_nm)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        (b"<scfgfu>N<", b"<scfgfu>pond<", "scfgfu is 'pond': expected one of N, kN, lbf"),
        (b"<scfgtu>Nm</scfgtu>", b"", "scfgtu is None: expected one of Nm"),
        (b"<cfgcpf>1000000<", b"<cfgcpf>0<", "cfgcpf is '0': expected a positive number"),
        (b"<cfgcpt>1000000<", b"<cfgcpt>inf<", "cfgcpt is 'inf': expected a positive number"),
        (b"<cfgcpt>1000000<", b"<cfgcpt>many<", "cfgcpt is 'many': expected a number"),
        (b"</netft>", b"", "not the page of a Net F/T sensor"),
    ],
)
def test_a_page_without_a_known_scale_is_refused(old, new, problem):
    with pytest.raises(ValueError, match=problem):
        read_configuration(PAGE.replace(old, new))


def test_a_disabled_stream_is_seen():
    assert not read_configuration(PAGE.replace(b"Enabled", b"Disabled")).streams


@given(
    st.binary(max_size=40)
    | st.builds(
        lambda i, b: PAGE[:i] + b + PAGE[i + 3 :], st.integers(0, len(PAGE)), st.binary(max_size=4)
    )
)
def test_any_bytes_are_a_configuration_or_refused(data):
    with contextlib.suppress(ValueError):
        read_configuration(data)
    decode(data)
