"""Sessions begin only between owners of the key, and an old session never begins again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from teleop.errors import InputError
from teleop.safety import Mode
from teleop.station.datagram import NO_FAULT, Datagram, pack
from teleop.station.handshake import CANDIDATES, MasterHandshake, SlaveHandshake, differences
from teleop.station.keys import read_key, write_key

KEY, OTHER = bytes(range(32)), bytes(range(1, 33))
OWN = {"law": "none"}


def tick(session, number=0):
    empty = Datagram(Mode.IDLE, 0, NO_FAULT, session.number, number, 0.0, 0.0, 0.0, (0.0,) * 3)
    return pack(empty, session.send_key)


def begun(key=KEY):
    """Return the sessions of master and slave, and all datagrams of their handshake."""
    master, slave = MasterHandshake(key, OWN), SlaveHandshake(key, OWN)
    welcome = slave.answer(master.hello)
    session = master.receive(welcome)
    first = tick(session)
    return session, slave.receive(first), [master.hello, welcome, first]


def test_both_stations_find_the_same_session_with_keys_for_each_direction():
    master, slave, _ = begun()
    assert master.number == slave.number
    assert master.send_key == slave.receive_key != master.receive_key == slave.send_key
    assert begun()[0].number != master.number


def test_a_station_learns_the_settings_of_the_other():
    master, slave = MasterHandshake(KEY, {"a": 1, "b": 2}), SlaveHandshake(KEY, {"a": 1, "b": 3})
    master.receive(slave.answer(master.hello))
    assert differences(slave.settings, master.settings) == ["b: here 2, at the other station 3"]


def test_nothing_begins_with_another_key():
    master, slave = MasterHandshake(KEY, OWN), SlaveHandshake(OTHER, OWN)
    assert slave.answer(master.hello) is None
    welcome = SlaveHandshake(KEY, OWN).answer(master.hello)
    assert MasterHandshake(OTHER, OWN).receive(welcome) is None


def test_datagrams_of_an_earlier_session_begin_no_other_one():
    _, _, old = begun()
    slave = SlaveHandshake(KEY, OWN)
    slave.answer(old[0])  # answered, but only the owner of the key can continue
    assert all(slave.receive(data) is None for data in old)
    master = MasterHandshake(KEY, OWN)
    assert all(master.receive(data) is None for data in old)


def test_reflected_datagrams_begin_nothing():
    master, slave = MasterHandshake(KEY, OWN), SlaveHandshake(KEY, OWN)
    assert master.receive(master.hello) is None
    welcome = slave.answer(master.hello)
    assert slave.answer(welcome) is None
    assert slave.receive(welcome) is None


def test_a_session_begins_although_others_ask_at_the_same_time():
    slave, master = SlaveHandshake(KEY, OWN), MasterHandshake(KEY, OWN)
    session = master.receive(slave.answer(master.hello))
    for _ in range(CANDIDATES - 1):
        slave.answer(MasterHandshake(KEY, OWN).hello)
    assert slave.receive(tick(session))
    slave.answer(MasterHandshake(KEY, OWN).hello)
    assert slave.receive(tick(session)) is None  # the memory is bounded


@given(st.data())
def test_changed_datagrams_of_the_handshake_are_refused(data):
    master, slave = MasterHandshake(KEY, OWN), SlaveHandshake(KEY, OWN)
    welcome = slave.answer(master.hello)
    for sent, receive in ((master.hello, slave.answer), (welcome, master.receive)):
        changed = bytearray(sent)
        changed[data.draw(st.integers(0, len(sent) - 1))] ^= 1 << data.draw(st.integers(0, 7))
        assert receive(bytes(changed)) is None
        assert receive(sent[: data.draw(st.integers(0, len(sent) - 1))]) is None


@given(st.binary(max_size=1500))
def test_any_other_bytes_are_refused(data):
    assert SlaveHandshake(KEY, OWN).answer(data) is None
    assert SlaveHandshake(KEY, OWN).receive(data) is None
    assert MasterHandshake(KEY, OWN).receive(data) is None


# Key files


def test_a_key_file_is_read_as_it_was_written_and_only_its_owner_can_read_it(tmp_path):
    first, second = tmp_path / "a.key", tmp_path / "b.key"
    write_key(first)
    write_key(second)
    assert first.stat().st_mode & 0o777 == 0o600
    assert len(read_key(first)) == 32
    assert read_key(first) != read_key(second)
    with pytest.raises(InputError, match="the file exists"):
        write_key(first)


@pytest.mark.parametrize("text", ["", "abc", "zz" * 32, "00" * 31, "00" * 33])
def test_a_file_that_is_no_key_is_refused(tmp_path, text):
    path = tmp_path / "station.key"
    path.write_text(text)
    path.chmod(0o600)
    with pytest.raises(InputError, match="64 hexadecimal digits"):
        read_key(path)


def test_a_key_that_others_can_read_is_refused(tmp_path):
    path = tmp_path / "station.key"
    write_key(path)
    path.chmod(0o640)
    with pytest.raises(InputError, match="chmod 600"):
        read_key(path)
