"""The tare: measured at rest and without load, refused otherwise, stored, applied."""

from __future__ import annotations

import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import STANDSTILL, Command
from sim_backend import CUBES, Sensors, SimulatedRig
from teleop.cli import main
from teleop.control.clock import VirtualClock
from teleop.control.tare import Tare, read_tare, write_tare
from teleop.errors import InputError, SafetyStop
from teleop.recording.recording import load
from teleop.rig.touching import touch, touch_limits
from teleop.rig.zeroing import (
    LISTENING,
    REST,
    ForceZero,
    confirmed_zero,
    force_zero,
    full_scale,
    load_problem,
)
from teleop.safety import Fault, Limits
from teleop.safety.channels import ChannelLimits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_controller
from teleop.trial.run import run_trial

FILE = {"master_force": 0.5, "contact_force": -0.25, "slave_position": 1e-3, "date": "2026"}
"""A file of teleop 0.1, without the name of a rig."""
OFFSETS = Sensors(master_zero=1.5, contact_zero=-2.25, contact_position=3.7e-3)


def rig_of(sensors, clock, **options):
    rig = SimulatedRig(CUBES["soft"], clock.now, sensors=sensors, **options)
    rig.open()
    return rig


def test_the_force_zero_is_what_the_sensors_read_at_no_force():
    clock = VirtualClock(1000.0)
    zero = force_zero(rig_of(OFFSETS, clock), clock)
    assert zero.master == pytest.approx(1.5, abs=0.004)
    assert zero.contact == pytest.approx(-2.25, abs=0.004)
    assert zero.master_noise == pytest.approx(0.02, rel=0.1)
    assert zero.contact_noise == pytest.approx(0.02, rel=0.1)


class Relaxing(SimulatedRig):
    """A rig whose master force and slave position decay to zero."""

    force, travel, time_constant = 0.5, 0.0, 0.5

    def read(self):
        measurement = super().read()
        left = math.exp(-measurement.time / self.time_constant)
        return measurement._replace(
            master_force=measurement.master_force + self.force * left,
            slave_position=measurement.slave_position + self.travel * left,
        )


def relaxing(clock, **options):
    rig = Relaxing(CUBES["soft"], clock.now, sensors=OFFSETS)
    rig.open()
    vars(rig).update(options)
    return rig


@pytest.mark.parametrize("force", [0.15, 0.5, -5.0])
@pytest.mark.parametrize("travel", [0.0, 1e-3])
def test_the_zero_is_measured_after_the_rig_has_come_to_rest(force, travel):
    clock = VirtualClock(1000.0)
    zero = force_zero(relaxing(clock, force=force, travel=travel), clock)
    assert clock.now() > 2.0 * LISTENING - 0.01
    assert zero.master == pytest.approx(1.5, abs=0.02)
    assert zero.contact == pytest.approx(-2.25, abs=0.004)
    assert zero.position == pytest.approx(OFFSETS.contact_position, abs=REST)


def test_a_force_that_does_not_become_constant_is_refused():
    clock = VirtualClock(1000.0)
    with pytest.raises(InputError, match=r"master force changes by 0\.1\d+ N .* no hand on the"):
        force_zero(relaxing(clock, force=4.0, time_constant=20.0), clock)


@pytest.mark.parametrize("rate", [50.0, 100.0, 1000.0])
@pytest.mark.parametrize("noise", [0.0, 0.001, 0.02, 0.3])
def test_the_noise_of_a_sensor_is_not_taken_for_a_change(rate, noise):
    repeated = 0
    for seed in range(20):
        clock = VirtualClock(rate)
        force_zero(rig_of(Sensors(force_noise=noise), clock, seed=seed), clock)
        repeated += clock.now() > 1.5 * LISTENING
    assert repeated <= 1


@pytest.mark.parametrize("shape", ["ramp", "relaxation", "knock"])
def test_a_change_of_twice_the_noise_is_detected(shape):
    share = np.linspace(0.0, 1.0, 1000)
    change = {
        "ramp": share,
        "relaxation": np.exp(-5.0 * share),
        "knock": np.exp(-((share - 0.5) ** 2) / 0.01),
    }[shape]
    for seed in range(10):
        force = np.random.default_rng(seed).normal(0.0, 0.02, 1000)
        assert not load_problem("master", force)
        assert load_problem("master", force + 0.04 * change)
        assert load_problem("master", force - 0.04 * change)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
def test_a_load_that_disappears_is_detected(share):
    force = np.random.default_rng(1).normal(0.0, 0.02, 1000)
    force[: round(1000 * share)] -= 0.4
    assert "contact force changes by 0.4" in load_problem("contact", force)


def test_a_periodic_disturbance_is_not_taken_for_a_change():
    t = np.arange(1000) * 1e-3
    for frequency in (3.0, 8.0, 50.0, 60.0):
        for phase in np.linspace(0.0, 2.0 * np.pi, 8):
            assert not load_problem("master", 0.1 * np.sin(2.0 * np.pi * frequency * t + phase))


def test_a_moving_rig_is_refused():
    clock = VirtualClock(1000.0)
    rig = rig_of(Sensors(), clock, watchdog=60.0)
    rig.enable()
    rig.write(Command(0.0, 0.005))
    with pytest.raises(InputError, match=r"the slave moves by [45]\.\d+ mm"):
        force_zero(rig, clock)


@pytest.mark.parametrize(
    ("sensors", "word"),
    [
        (Sensors(contact_zero=40.0), r"contact force sensor reads 40\.0\d N: expected no load"),
        (Sensors(master_zero=-40.0), "master force sensor reads"),
        (Sensors(force_noise=2.0), r"force varies by (1\.[89]|2\.[01])\d N"),
    ],
)
def test_a_loaded_rig_is_refused(sensors, word):
    clock = VirtualClock(1000.0)
    with pytest.raises(InputError, match=word):
        force_zero(rig_of(sensors, clock), clock)


def limits_of(range_n, hard_force):
    limits = Limits()
    names = ("master_force", "contact_force")
    ranges = dict.fromkeys(names, ChannelLimits(-range_n, range_n))
    soft = min(limits.soft_force, hard_force)
    return replace(
        limits, soft_force=soft, hard_force=hard_force, channels=limits.channels | ranges
    )


def two_looks(first, second, confirms=True, range_n=500.0, hard_force=250.0):
    """Return the contact zero and the questions, for two readings of the contact force [N]."""
    readings, questions = [first, second], []

    def confirm(question):
        questions.append(question)
        return confirms

    def measure():
        return ForceZero(0.0, readings.pop(0), 0.02, 0.02, 0.0)

    zero = confirmed_zero(measure, limits_of(range_n, hard_force), confirm)
    return zero and zero.contact, questions


@pytest.mark.parametrize(("range_n", "hard_force"), [(500.0, 250.0), (250.0, 400.0)])
def test_an_offset_of_one_percent_of_range_and_force_limit_is_accepted_at_once(range_n, hard_force):
    limits = limits_of(range_n, hard_force)
    assert full_scale(limits, "master") == full_scale(limits, "contact") == 250.0
    assert two_looks(-2.4, None, range_n=range_n, hard_force=hard_force) == (-2.4, [])


def test_a_larger_offset_is_accepted_if_a_person_confirms_it_and_it_stays():
    zero, (question,) = two_looks(8.67, 8.65)
    assert zero == 8.65
    assert "contact force sensor reads 8.67 N, without load usually at most 2.5 N" in question
    assert two_looks(8.67, 0.3)[0] == 0.3  # the load was removed
    assert two_looks(8.67, None, confirms=False)[0] is None


def test_an_offset_that_changes_between_two_measurements_is_refused():
    with pytest.raises(InputError, match=r"reads 7\.90 N, and 8\.67 N before: expected the same"):
        two_looks(8.67, 7.9)


@pytest.mark.parametrize(
    ("first", "second"), [(1.1, None), (0.5, 1.1), (-1.1, None), (math.nan, 0)]
)
def test_an_offset_above_ten_percent_is_refused_whatever_a_person_confirms(first, second):
    with pytest.raises(InputError, match="expected no load, and a zero within 1 N, 10% of its"):
        two_looks(first, second, range_n=10.0)


@pytest.fixture
def pressed(monkeypatch, tmp_path):
    """Replace the rig of devices by one whose contact force is 8.67 N; return `rig tare` on it."""

    def make(file, now):
        return SimulatedRig(CUBES["soft"], now, sensors=Sensors(contact_zero=8.67))

    monkeypatch.setattr("drivers.wired_rig.WiredRig", make)
    monkeypatch.setattr("teleop.rig.zeroing.LISTENING", 0.1)
    monkeypatch.chdir(tmp_path)
    return "rig", "tare", "--rig", str(Path(__file__).parents[3] / "rigs" / "serial-board.toml")


def test_a_constant_load_is_not_stored_without_a_person_who_confirms_it(
    pressed, refused, monkeypatch, capsys
):
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    line = refused(*pressed)
    assert "nobody can confirm that no sensor is loaded (the contact force sensor reads" in line
    assert "expected --yes" in line
    monkeypatch.setattr("teleop.trial.arming.is_foreground", lambda: True)
    monkeypatch.setattr("teleop.trial.arming.discard_typed_ahead", lambda: None)
    monkeypatch.setattr("sys.stdin", io.StringIO("no\n"))
    assert main([*pressed]) == 130
    assert "no zero offsets were stored" in capsys.readouterr().err
    assert not Path("tare.json").exists()
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert main([*pressed]) == 0
    assert "Enter measures again" in capsys.readouterr().err
    assert read_tare(Path("tare.json")).contact_force == pytest.approx(8.67, abs=0.02)
    assert main([*pressed, "--yes", "--overwrite"]) == 0
    assert "accepted without a question" in capsys.readouterr().err


@pytest.mark.parametrize("cube", ["soft", "medium", "hard"])
def test_touch_finds_the_beginning_of_contact_and_retreats(cube, tmp_path):
    clock = VirtualClock(1000.0)
    zero = force_zero(rig_of(OFFSETS, clock), clock)
    path = tmp_path / "touch.mcap"
    found = touch(zero, None, cube, OFFSETS, 0, path)
    assert found == pytest.approx(OFFSETS.contact_position, abs=20e-6)
    recording = load(path)
    assert recording["contact_force"].max() < 5.0
    assert zero.position + recording["slave_position"][-1] < found - 0.5e-3
    assert recording["commanded_slave_velocity"][-1] == STANDSTILL.slave_velocity


def test_a_missing_contact_is_reported(monkeypatch):
    clock = VirtualClock(1000.0)
    zero = force_zero(rig_of(Sensors(), clock), clock)
    monkeypatch.setattr("teleop.rig.touching.REACH", 0.5e-3)
    with pytest.raises(InputError, match="no contact within the range"):
        touch(zero, None, "soft", Sensors(), 0)


def test_an_applied_tare_removes_the_offsets_of_a_rig():
    settings = {"clock": "virtual", "duration": 1.0, "condition": "autonomous"}
    plain = run_trial(TrialSettings(**settings)).recording
    tare = Tare(OFFSETS.master_zero, OFFSETS.contact_zero, OFFSETS.contact_position, "today")
    trial = run_trial(TrialSettings(**settings, sensors=OFFSETS, tare=tare))
    for name in ("master_force", "slave_position", "contact_force"):
        np.testing.assert_allclose(trial.recording[name], plain[name], atol=2e-6)
    assert trial.recording.settings["tare"]["date"] == "today"


def test_the_command_stores_a_dated_tare_that_run_accepts(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["rig", "tare", "--contact", "touch"]) == 0
    shown = capsys.readouterr().out
    assert "teleop run --tare tare.json" in shown
    assert len(re.findall(r"force zero \S+ N, noise 0\.0[12]\d N rms", shown)) == 2
    tare = read_tare(tmp_path / "tare.json")
    assert tare.date.startswith("20")
    assert abs(tare.slave_position) < 20e-6
    assert tare.rig == "simulated"
    run = ["run", "--clock", "virtual", "--duration", "0.2", "--record", "a.mcap", "--json"]
    assert main([*run, "--tare", "tare.json"]) == 0
    assert load(tmp_path / "a.mcap").settings["tare"] == json.loads(
        (tmp_path / "tare.json").read_text()
    )
    capsys.readouterr()
    assert main(["rig", "tare", "--contact", "1.5mm", "--overwrite", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["slave_position"] == 1.5e-3


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[]", ["expected a file of teleop rig tare"]),
        ("{", ["expected a file of teleop rig tare"]),
        ('{"master_force": "high", "date": 3}', ["master_force", "date"]),
        ('{"contact_force": NaN}', ["contact_force", "finite", "master_force: is missing"]),
        ('{"contact_farce": 1.0}', ["contact_farce"]),
        (json.dumps(FILE | {"contact_force": 20.0}), ["contact_force", "15"]),
        (json.dumps(FILE | {"master_force": -1e308}), ["master_force", "-15"]),
        (json.dumps(FILE | {"slave_position": 1.5}), ["slave_position", "1"]),
        (json.dumps(FILE | {"slave_position": math.inf}), ["slave_position", "finite"]),
        (json.dumps(FILE).replace("0.001", "9" * 5000), ["file"]),
        (json.dumps(FILE | {"contact_force": True}), ["contact_force"]),
        (json.dumps(FILE | {"contact_force": "1.0"}), ["contact_force"]),
        (json.dumps(FILE | {"rig": 3}), ["rig"]),
        (json.dumps(FILE | {"rig": "x" * 100_000}), ["rig"]),
        (json.dumps(FILE | {"rig": "another\x1b[2J"}), [r"'another\x1b[2J'", "'simulated'"]),
    ],
)
def test_an_invalid_tare_file_is_reported_with_all_its_errors_on_one_line(
    tmp_path, capsys, content, words
):
    path = tmp_path / "tare.json"
    path.write_text(content)
    assert main(["run", "--tare", str(path), "--no-record"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word in error


def test_an_invalid_contact_is_reported(capsys):
    assert main(["rig", "tare", "--contact", "5kg"]) == 2
    assert "keep, touch, or a position such as 1.5mm" in capsys.readouterr().err


def test_the_round_trip_of_a_tare_through_its_file_is_exact(tmp_path):
    tare = Tare(0.1 + 0.2, -1e-17, 1 / 3, "2026-11-21T04:00:00+00:00", "a rig")
    write_tare(tare, tmp_path / "t.json")
    assert read_tare(tmp_path / "t.json") == tare


def test_a_file_that_names_no_rig_is_accepted(tmp_path):
    path = tmp_path / "tare.json"
    path.write_text(json.dumps(FILE))
    tare = read_tare(path)
    assert tare == Tare(0.5, -0.25, 1e-3, "2026", rig="")
    assert TrialSettings(tare=tare).tare == tare


@pytest.mark.parametrize(
    ("tare", "words"),
    [
        (Tare(contact_force=20.0), "contact_force 20 N: expected a zero within 15 N"),
        (Tare(master_force=math.nan), "master_force nan N: expected a zero"),
        (Tare(slave_position=-math.inf), "slave_position -inf m: expected a zero"),
        (Tare(slave_position=0.7), "slave_position 0.7: expected a value in the range"),
        (
            Tare(rig="another"),
            "measured on the rig 'another': expected a tare of the rig 'simulated'",
        ),
    ],
)
def test_a_tare_that_does_not_fit_the_rig_is_refused(tare, words):
    with pytest.raises(InputError, match=words):
        TrialSettings(tare=tare)


def test_a_tare_shifts_the_ranges_of_the_sensors_and_no_other_limit():
    settings = TrialSettings(tare=Tare(1.5, -2.25, 3.7e-3))
    plain, tared = TrialSettings().limits, settings.limits
    for name, zero in settings.tare.zeros.items():
        raw = plain.channels[name]
        assert tared.channels[name] == replace(raw, low=raw.low - zero, high=raw.high - zero)
    assert replace(tared, channels=plain.channels) == plain


def test_a_sensor_beyond_its_range_trips_for_any_tare():
    clock = VirtualClock(1000.0)
    rig = SimulatedRig(CUBES["soft"], clock.now)
    high = TrialSettings().limits.channels["contact_force"].high
    settings = TrialSettings(clock="virtual", tare=Tare(contact_force=14.0))
    controller = make_controller(settings, rig, clock)
    rig.read = lambda read=rig.read: read()._replace(contact_force=high + 1.0)
    faults = [event.fault for event in controller.tick(clock.wait()).events]
    assert Fault.OUT_OF_RANGE in faults


def test_touching_stops_for_safety_at_the_rigs_own_force_limit_if_that_is_lower(monkeypatch):
    clock = VirtualClock(1000.0)
    zero = force_zero(rig_of(Sensors(), clock), clock)
    limits = touch_limits(replace(TrialSettings().raw_limits, soft_force=0.2, hard_force=0.3))
    monkeypatch.setattr("teleop.rig.touching.touch_limits", lambda _: limits)
    with pytest.raises(SafetyStop, match=r"force limit: contact force 0\.3"):
        touch(zero, None, "hard", Sensors(), 0)
