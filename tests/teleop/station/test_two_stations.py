"""Two stations over a network in virtual time: what is felt, when they are armed and stopped."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_backend import CUBES, ForceMaster, OperatorModel, Setup
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.control.station_settings import StationSettings
from teleop.safety import Fault, Mode
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings
from teleop.station.datagram import CONSENT
from teleop.trial.run import run_trial

from .network import Faults, TwoStations

SETTINGS = TrialSettings(
    clock="virtual",
    duration=5.0,
    estimators=("rls",),
    feedback=FeedbackSettings("model-mediated"),
    operator_model=OperatorModel(aim_force=10.0),
    tightened_limits=TightenedLimits(soft_force=20.0, hard_force=40.0),
)
SETUP = replace(SETTINGS.setup, transmission=Setup(CUBES["soft"], 1e-3, 1e-3).transmission)
SETTINGS = replace(SETTINGS, custom_setup=SETUP)
PLAIN = replace(SETTINGS, feedback=FeedbackSettings())
MS = 1e-3


def armed(pair: TwoStations, moving: int = 0) -> TwoStations:
    """Run both stations until the master has been active for some ticks."""
    for _ in range(3000):
        if pair.master.controller.mode is Mode.ACTIVE:
            pair.run(moving)
            return pair
        pair.step()
    raise AssertionError((pair.master.station.waits_for, pair.slave.station.waits_for))


def moves(pair: TwoStations, ticks: int) -> bool:
    """Return whether a drive is commanded to move in the next ticks."""
    before = [len(one.recording) for one in (pair.master, pair.slave)]
    pair.run(ticks)
    moved = False
    for one, start in zip((pair.master, pair.slave), before, strict=True):
        for axis in ("master", "slave"):
            moved |= bool(np.any(one.recording[f"commanded_{axis}_velocity"][start:]))
    return moved


# What is felt


@pytest.mark.parametrize(
    "faults",
    [Faults(0.02, 0.02, 0.05, doubled=0.1), Faults(0.5)],
    ids=["bad", "far"],
)
def test_the_hand_feels_the_same_model_as_over_the_simulated_channel(faults):
    settings = replace(SETTINGS, duration=4.0 + 4.0 * faults.delay, rate=500.0)
    pair = TwoStations(settings, faults)
    pair.run(10_000)
    assert pair.master.faults == pair.slave.faults == []
    channel = ChannelSettings(faults.delay, faults.jitter, faults.loss)
    same = run_trial(replace(settings, channel=channel)).recording
    found = pair.master.recording
    felt = []
    for recording in (found, same):
        active = recording.where(recording["mode"] == Mode.ACTIVE)
        k, k3 = active["model_stiffness"][-1], active["model_stiffening"][-1]
        felt.append(k + 3.0 * k3 * 3e-3**2)
    assert felt[0] == pytest.approx(felt[1], rel=0.05)
    assert np.min(found["port_energy"]) > -6e-3


def test_the_slave_follows_the_master_after_the_delay_of_the_network():
    shallow = replace(PLAIN, depth=3 * MS, tightened_limits=TightenedLimits())
    pair = armed(TwoStations(shallow, Faults(0.05)), 1500)
    master, slave = pair.master.recording, pair.slave.recording
    x, y = master["master_position"], slave["slave_position"]
    late = y[-800:] - x[-800 - 52 : -52]
    assert np.max(x) > 2 * MS
    assert np.max(np.abs(late)) < 0.4 * MS


# The interval of the clock offset


@pytest.mark.parametrize(
    ("forth", "back"),
    [(Faults(0.001), Faults(0.021)), (Faults(0.03, 0.02, 0.3), Faults(0.001, 0.01))],
)
@pytest.mark.parametrize("error", [-90e-6, 90e-6])
def test_the_interval_contains_the_true_offset_of_the_clocks(forth, back, error):
    pair = TwoStations(PLAIN, forth, back, error=error)
    widths = []
    for n in range(1500):
        pair.step()
        if n < 200:
            continue
        master, slave = pair.master, pair.slave
        true = master.clock.now() - slave.clock.now()
        for station, offset in ((master.station, true), (slave.station, -true)):
            interval = station.peer.offset()
            # the clocks drift apart while the other end waits for its tick
            assert interval.low - 1e-6 <= offset <= interval.high + 1e-6
            widths.append(interval.width)
    assert widths[-1] < forth.delay + forth.jitter + back.delay + back.jitter + 0.01


# Arming


def test_the_slave_is_armed_first_and_then_the_master():
    pair = armed(TwoStations(PLAIN, Faults(0.02)))
    assert pair.slave.controller.mode is Mode.ACTIVE
    slave = pair.slave.recording
    assert np.sum(slave["mode"] == Mode.ACTIVE) >= 20
    assert not np.any(slave["commanded_slave_velocity"])


@pytest.mark.parametrize("absent", ["master", "slave"])
def test_nothing_is_armed_without_a_person_at_both_ends(absent):
    pair = TwoStations(PLAIN)
    getattr(pair, absent).switch.page.arms = False
    pair.run(2000)
    assert not pair.master.station.armed
    other = pair.slave if absent == "master" else pair.master
    assert absent in other.station.waits_for
    assert "person" in other.station.waits_for
    getattr(pair, absent).switch.page.arms = True
    armed(pair)


@pytest.mark.parametrize("ended", ["master", "slave"])
def test_a_station_ends_if_the_other_one_ended_before_it_was_armed(ended):
    for goodbye in (True, False):
        pair = TwoStations(PLAIN)
        pair.run(100)
        one, other = pair.master, pair.slave
        if ended == "slave":
            one, other = other, one
        if goodbye:
            one.station.finish()
        one.runs = False
        pair.run(10 if goodbye else 5100)
        assert not other.runs
        assert not other.station.armed
        text = "ended before" if goodbye else "has sent nothing for 5 s"
        assert f"the {ended} station {text}" in other.station.reason


def test_the_master_does_not_begin_before_the_slave_is_armed():
    pair = TwoStations(PLAIN)
    pair.slave.switch.page.arms = False
    pair.run(1000)
    assert pair.master.controller.mode is Mode.READY


def test_both_stations_wait_while_the_round_trip_is_longer_than_permitted():
    pair = TwoStations(PLAIN, Faults(0.03), longest=0.05)
    pair.run(2000)
    for one in (pair.master, pair.slave):
        assert not one.station.armed
        assert "a shorter round trip: 6" in one.station.waits_for
    pair.forth.delay = pair.back.delay = 0.02
    armed(pair)


def test_a_slave_whose_master_is_not_armed_stops_waiting(monkeypatch):
    monkeypatch.setattr("teleop.station.station.WAITING", 0.5)
    pair = TwoStations(PLAIN)
    pair.run(300)
    master = pair.master
    moving = (5 * MS, 0.1, 0.0)
    for _ in range(1200):  # the master stays ready, although its person has armed it
        master.clock.wait()
        master.station.read(True, False)
        master.station.peer.send(Mode.READY, CONSENT, moving, master.station.echo)
        pair.slave.step()
    assert pair.slave.station.armed
    assert not np.any(pair.slave.recording["desired_slave_velocity"])
    assert "not armed within 0.5 s" in pair.slave.station.reason
    assert pair.slave.controller.mode is Mode.IDLE


# Stops


@pytest.mark.parametrize("stopped", ["master", "slave"])
def test_a_stop_at_one_station_stops_both_without_a_fault(stopped):
    pair = armed(TwoStations(PLAIN, Faults(0.02)), 800)
    getattr(pair, stopped).switch.page.reason = "ended"
    pair.run(150)
    for one in (pair.master, pair.slave):
        assert one.controller.mode is Mode.IDLE
        assert one.faults == []
        assert not one.controller.stops
    assert not moves(pair, 300)


@pytest.mark.parametrize("stopped", ["master", "slave"])
def test_a_fault_at_one_station_stops_both_and_is_named_at_the_other(stopped):
    pair = armed(TwoStations(PLAIN, Faults(0.02)), 800)
    one = getattr(pair, stopped)
    other = pair.slave if stopped == "master" else pair.master
    one.switch.key.pressed = True
    pair.run(60)
    assert one.faults == [Fault.EMERGENCY_STOP]
    assert other.faults == [Fault.OTHER_STATION]
    text = next(event["text"] for event in other.recording.events if event["fault"])
    assert f"the {stopped} station has stopped: emergency stop" in text
    assert not moves(pair, 300)


@pytest.mark.parametrize("direction", ["forth", "back"])
def test_a_silent_network_stops_both_stations_within_the_stated_time(direction):
    pair = armed(TwoStations(PLAIN, Faults(0.02), Faults(0.02)), 800)
    getattr(pair, direction).cut = True
    silent = pair.slave if direction == "forth" else pair.master
    pair.run(20 + 100 + 20 + 45)
    assert silent.faults == [Fault.CHANNEL_SILENT]
    for one in (pair.master, pair.slave):
        assert one.controller.mode is Mode.FAULT
    pair.forth.cut = pair.back.cut = False
    assert not moves(pair, 300)


def test_the_slave_travels_little_after_the_last_datagram():
    pair = armed(TwoStations(PLAIN, Faults(0.01)), 0)
    while abs(pair.slave.recording["commanded_slave_velocity"][-1]) < 0.03:
        pair.run(10)
    pair.run(30)
    pair.forth.cut = True
    pair.run(11)  # those on their way
    slave = pair.slave.recording
    start, speed = slave["slave_position"][-1], abs(slave["commanded_slave_velocity"][-2])
    pair.run(150)
    moved = np.max(np.abs(pair.slave.recording["slave_position"] - start)[-150:])
    assert speed > 0.02
    assert moved < speed * 10 * MS + 0.1 * MS


def test_a_slave_that_is_behind_does_not_move_on_without_the_master():
    limits = TightenedLimits(max_velocity=0.01, soft_force=20.0, hard_force=40.0)
    slow = replace(PLAIN, duration=15.0, tightened_limits=limits)
    pair = armed(TwoStations(PLAIN, Faults(0.01), slave=slow), 500)
    slave = pair.slave
    while slave.recording["commanded_slave_velocity"][-1] < 0.0099:
        pair.run(10)
    pair.run(200)
    behind = pair.master.recording["master_position"][-1] - slave.recording["slave_position"][-1]
    assert behind > 3 * MS
    pair.forth.cut = True
    pair.run(11)
    start = slave.recording["slave_position"][-1]
    pair.run(85)
    assert slave.controller.mode is Mode.ACTIVE
    assert slave.recording["slave_position"][-1] - start < 0.01 * 10 * MS


def test_the_slave_retreats_by_the_stated_distance_before_it_stops():
    given = StationSettings("slave", retreat=5 * MS)
    slave = replace(PLAIN, duration=15.0, station=given)
    pair = armed(TwoStations(PLAIN, Faults(0.01), slave=slave), 1000)
    pair.forth.cut = pair.back.cut = True
    pair.run(100)
    before = pair.slave.recording["slave_position"][-1]
    pair.run(600)
    after = pair.slave.recording["slave_position"][-1]
    assert before - after == pytest.approx(5 * MS, abs=0.6 * MS)
    assert pair.slave.faults == [Fault.CHANNEL_SILENT]


def test_a_longer_delay_than_permitted_stops_both_stations():
    pair = armed(TwoStations(PLAIN, Faults(0.01), longest=0.05), 500)
    pair.forth.delay = 0.08
    pair.run(400)
    faults = {*pair.master.faults, *pair.slave.faults}
    assert Fault.CHANNEL_SLOW in faults
    assert faults <= {Fault.CHANNEL_SLOW, Fault.OTHER_STATION}
    assert pair.master.controller.mode is pair.slave.controller.mode is Mode.FAULT


def test_the_force_of_a_force_commanded_master_fades_after_a_silence():
    settings = replace(
        SETTINGS,
        force_master=ForceMaster(max_force=200.0),
        duration=6.0,
    )
    pair = armed(TwoStations(settings, Faults(0.01)), 0)
    while not (shown := pair.master.recording["displayed_force"][-1]) > 4.0:
        pair.run(5)
    pair.back.cut = True
    pair.run(10 + 98)
    kept = pair.master.recording["displayed_force"][-1]
    assert kept > 0.5 * shown
    pair.run(85)
    assert pair.master.controller.mode is Mode.ACTIVE
    assert pair.master.recording["displayed_force"][-1] < 0.3 * kept
    pair.run(30)
    assert pair.master.faults == [Fault.CHANNEL_SILENT]
    active = pair.master.recording["displayed_force"][pair.master.recording["mode"] == Mode.ACTIVE]
    assert np.max(np.abs(np.diff(active[-100:]))) < 0.05 * kept


def test_a_station_that_hangs_is_stopped_and_does_not_move_again():
    """As after SIGSTOP and SIGCONT of a process."""
    for name in ("master", "slave"):
        pair = armed(TwoStations(PLAIN, Faults(0.01)), 800)
        hung = getattr(pair, name)
        other = pair.slave if name == "master" else pair.master
        for _ in range(300):
            hung.clock.wait()
            other.step()
        assert other.faults == [Fault.CHANNEL_SILENT]
        assert not moves(pair, 300)
        assert hung.faults[0] in (Fault.OVERRUN, Fault.RIG_FAILURE, Fault.DRIVE_ERROR)


# What nobody but the other station may do


def test_a_flood_of_forged_datagrams_changes_nothing():
    pair = armed(TwoStations(SETTINGS, Faults(0.01, flood=64)), 200)
    for one in (pair.master, pair.slave):
        assert one.faults == []
        rejected = one.station.peer.rejected
        assert sum(rejected.values()) > 60 * one.station.peer.window.received
        assert one.station.peer.window.lost < 30  # those on their way


def test_the_slave_obeys_only_a_master_that_is_active():
    pair = armed(TwoStations(PLAIN), 900)
    assert moves(pair, 5)
    pair.master.switch.page.reason = "ended"
    pair.run(3)
    pair.run(20)
    assert not moves(pair, 500)


def test_recordings_have_the_columns_of_the_connection():
    pair = armed(TwoStations(PLAIN, Faults(0.02, loss=0.1)), 300)
    recording = pair.slave.recording
    true = pair.slave.clock.now() - pair.master.clock.now()
    assert recording["offset_low"][-1] < true < recording["offset_high"][-1]
    assert 0.04 < recording["round_trip"][-1] < 0.06
    lost = recording["lost_datagrams"][-1]
    assert lost == pytest.approx(0.1 * recording["received_datagram"][-1], rel=0.35)
    assert math.isnan(recording["master_force"][-1])
    assert recording["other_mode"][-1] == Mode.ACTIVE
