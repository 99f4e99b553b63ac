"""Datagrams of a tick: nothing is lost or changed on the way, and nothing forged is accepted."""

from __future__ import annotations

import hmac
from dataclasses import replace
from hashlib import blake2s

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from teleop.control.admittance import Environment
from teleop.control.bilateral import BilateralLink
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.law import MasterMotion, Report
from teleop.control.feedback.settings import FeedbackSettings
from teleop.safety import Mode, Request
from teleop.settings.trial_settings import TrialSettings
from teleop.station.datagram import (
    SIZE,
    Datagram,
    is_signed,
    motion_values,
    pack,
    report_values,
    to_motion,
    to_report,
    unpack,
)
from teleop.trial.assembly import make_clock, make_controller, make_rig, make_sides

KEY = bytes(range(32))
NUMBERS = st.floats(allow_nan=False)
DATAGRAMS = st.builds(
    Datagram,
    st.sampled_from(Mode),
    st.integers(0, 3),
    st.integers(0, 255),
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**64 - 1),
    NUMBERS,
    NUMBERS,
    NUMBERS,
    st.tuples(*[NUMBERS] * 3) | st.tuples(*[NUMBERS] * 7),
)


@given(DATAGRAMS)
def test_what_is_received_is_what_was_sent(sent):
    data = pack(sent, KEY)
    assert len(data) == SIZE == 128
    assert is_signed(data, KEY)
    received = unpack(data)
    assert received[:-1] == sent[:-1]
    assert received.values[: len(sent.values)] == sent.values


@given(DATAGRAMS, st.integers(0, 8 * SIZE - 1))
def test_a_datagram_with_one_changed_bit_is_not_signed(sent, bit):
    data = bytearray(pack(sent, KEY))
    data[bit // 8] ^= 1 << bit % 8
    assert not is_signed(bytes(data), KEY)


def test_the_signature_is_the_keyed_blake2s_of_rfc_7693():
    data = pack(Datagram(Mode.IDLE, 0, 255, 1, 2, 3.0, 4.0, 5.0, (0.0,) * 3), KEY)
    expected = blake2s(data[:-16], digest_size=16, key=KEY).digest()
    assert hmac.compare_digest(data[-16:], expected)


@given(st.binary(max_size=200))
@example(b"TS\x01\x03\xff" + bytes(SIZE - 5))
def test_any_other_bytes_are_no_datagram(data):
    found = unpack(data)
    assert found is None or data[:4] == b"TS\x01\x03"


@given(st.tuples(*[NUMBERS] * 6), st.booleans())
def test_reports_and_motions_keep_their_values(numbers, glued):
    force, k, k3, b, energy, tip = numbers
    report = Report(force, Environment(k, k3, b, glued), energy, tip)
    sent = Datagram(Mode.ACTIVE, 0, 255, 1, 2, 3.0, 4.0, 5.0, report_values(report))
    assert to_report(unpack(pack(sent, KEY)).values) == report
    motion = MasterMotion(*numbers[:3])
    moved = sent._replace(values=motion_values(motion))
    assert to_motion(unpack(pack(moved, KEY)).values) == motion


def test_a_model_that_has_not_changed_stays_the_same_object():
    model = Environment(2000.0, 1e6, 3.0)
    values = (*report_values(Report(1.0, Environment(2000.0, 1e6, 3.0))), 0.0)
    assert to_report(values, model).model is model
    assert to_report(values, Environment(2001.0, 1e6, 3.0)).model is not model


class OverTheWire:
    """Channel without delay, through which only the bytes of datagrams pass."""

    def __init__(self, direction, write, read):
        self._direction, self._write, self._read = direction, write, read
        self.value = direction.value

    def __getattr__(self, name):
        return getattr(self._direction, name)

    def exchange(self, now, value):
        sent = Datagram(Mode.ACTIVE, 0, 255, 1, 2, now, 0.0, 0.0, self._write(value))
        data = pack(self._direction.exchange(now, sent), KEY)
        self.value = self._read(unpack(data).values, self.value)
        return self.value


@pytest.mark.parametrize("law", ["none", "position-force", "model-mediated"])
def test_both_sides_over_datagrams_move_as_in_one_process_to_the_bit(law):
    settings = TrialSettings(clock="virtual", duration=2.0, estimators=("rls",))
    feedback, channel = FeedbackSettings(law, 0.3), ChannelSettings()
    settings = replace(settings, feedback=feedback, channel=channel)
    found = []
    for wired in (False, True):
        link = BilateralLink(*make_sides(settings, 0.0), channel)
        if wired:
            link.reports = OverTheWire(
                link.reports, report_values, lambda v, last: to_report(v, last.model)
            )
            link.motions = OverTheWire(link.motions, motion_values, lambda v, last: to_motion(v))
        clock = make_clock(settings)
        with make_rig(settings, clock.now) as rig:
            controller = make_controller(settings, rig, clock)
            controller._link = link
            records = [controller.tick(clock.wait(), Request(arm=True)) for _ in range(1500)]
        found.append([(r.measurement, r.desired, r.link) for r in records])
    assert max(one[0].contact_force for one in found[0]) > 1.0
    assert repr(found[0]) == repr(found[1])
