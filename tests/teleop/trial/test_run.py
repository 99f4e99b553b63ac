from __future__ import annotations

import functools
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from drivers import STANDSTILL
from drivers.rig_file import read_rig_file
from drivers.wired_rig import WiredRig
from estimation import force_error, rise_time
from sim_backend import (
    CUBES,
    DEPTH,
    TRANSMISSION,
    Changing,
    Cube,
    OperatorModel,
    Relaxing,
    Setup,
    SimulatedRig,
)
from sim_backend.faults import Disobedient, FaultyRig
from teleop.control.clock import VirtualClock
from teleop.control.conditions import CONDITIONS, Teleoperation
from teleop.control.tare import NO_TARE, Tare
from teleop.errors import InputError
from teleop.recording.recording import Recording, load
from teleop.recording.timing import PARTS, RunningTiming
from teleop.safety import Mode, Request
from teleop.safety.checks import REST
from teleop.settings.configuration import read_configuration
from teleop.settings.documents import to_document
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_clock
from teleop.trial.loop import Loop
from teleop.trial.loop_verdict import LoopTiming
from teleop.trial.other_programs import NOT_KNOWN
from teleop.trial.rehearsal import check_wire, rehearse
from teleop.trial.run import run_trial
from teleop.trial.stop_switch import StopSwitch

RIGS = Path(__file__).parents[3] / "rigs"
QUICK = TrialSettings(clock="virtual", duration=3.0)


@functools.cache
def palpation(condition="free", cube="soft"):
    """Return a trial that several tests evaluate, and none changes."""
    return run_trial(replace(QUICK, condition=condition, cube=cube))


@pytest.mark.parametrize("condition", ["free", "mimic", "autonomous"])
@pytest.mark.parametrize("cube", ["soft", "medium", "hard"])
def test_each_condition_palpates_each_cube_and_finds_its_stiffness(condition, cube):
    columns = palpation(condition, cube).columns
    assert 3000 <= len(columns["time"]) <= 3020
    depth = DEPTH[CONDITIONS[condition].moved_by][cube]
    assert 0.6 * depth < columns["slave_position"].max() < 1.4 * depth
    assert columns["slave_position"].min() > -0.05 * depth
    body = CUBES[cube]
    softest = 0.9 / (1.0 / body.k1 + TRANSMISSION.compliance)
    stiffest = 1.1 * (body.k1 + body.k3 * (1.4 * depth) ** 2)
    for name in ("rls_k", "ai_k", "me_k"):
        assert softest < np.median(columns[name][1500:]) < stiffest


@pytest.mark.parametrize("condition", ["free", "mimic", "autonomous"])
@pytest.mark.parametrize("cube", ["soft", "medium", "hard"])
def test_no_soft_limit_changes_the_papers_nine_trials(condition, cube):
    columns = palpation(condition, cube).columns
    moving = columns["mode"] == Mode.ACTIVE
    assert not columns["limited"][moving].any()
    np.testing.assert_array_equal(
        columns["desired_slave_velocity"][moving], columns["applied_slave_velocity"][moving]
    )


def test_autonomous_moves_without_an_operator_and_teleoperation_only_with_one():
    autonomous = palpation("autonomous").columns
    assert np.abs(autonomous["master_force"]).max() < 0.2
    assert np.abs(autonomous["drive_force"]).max() > 0.2
    free = palpation().columns
    moving = free["mode"] == Mode.ACTIVE
    moving[0] = False
    assert np.array_equal(free["drive_force"][moving], free["master_force"][moving])


@pytest.mark.parametrize("condition", ["free", "mimic", "autonomous"])
def test_the_same_seed_gives_exactly_the_same_run(condition):
    settings = replace(QUICK, condition=condition, duration=0.5, seed=7)
    first, second = run_trial(settings), run_trial(settings)
    other = run_trial(replace(settings, seed=8))
    for name, column in first.columns.items():
        assert np.array_equal(column, second.columns[name], equal_nan=True), name
    assert not np.array_equal(first.columns["contact_force"], other.columns["contact_force"])


def test_the_signal_and_the_ramps_are_those_of_the_settings():
    from teleop.control.excitation_signals import Chirp, Sine

    settings = replace(QUICK, condition="autonomous", signal=Sine(3.0))
    columns = run_trial(settings).columns
    spectrum = np.abs(np.fft.rfft(columns["slave_position"] - columns["slave_position"].mean()))
    assert (np.argmax(spectrum[3:]) + 3) / 3.0 == pytest.approx(3.0)
    assert abs(columns["slave_position"][-1]) < 0.05 * columns["slave_position"].max()
    chirped = run_trial(replace(settings, signal=Chirp(1.0, 4.0), duration=1.0)).columns
    positions = columns["slave_position"][: len(chirped["time"])]
    assert not np.allclose(chirped["slave_position"], positions, atol=1e-3)


def test_the_truth_is_the_secant_at_the_deepest():
    trial = palpation()
    depth = np.abs(trial.columns["slave_position"]).max()
    cube, compliance = CUBES["soft"], TRANSMISSION.compliance
    truth = trial.summary()["truth"]
    force = truth["k_deepest"] * depth
    assert force == pytest.approx(cube.force(depth - compliance * force, 0.0))
    assert truth["k_surface"] == pytest.approx(1.0 / (1.0 / cube.k1 + compliance))
    assert truth["lost_motion_m"] == TRANSMISSION.lost_motion


SOFT, HARD = Cube(2000.0, 1.6e6, 3.0, glued=False), Cube(16000.0, 0.0, 24.0, glued=False)


@functools.cache
def pokes_on(body, **operator):
    """Run a trial in which the slave leaves the body between the pokes."""
    operator_model = OperatorModel(**{"withdrawal": -0.2} | operator)
    setup = Setup(body, 2.66e-3, 6e-3, TRANSMISSION)
    return run_trial(
        replace(
            QUICK,
            duration=5.0,
            estimators=("rls",),
            custom_setup=setup,
            operator_model=operator_model,
        )
    )


def test_a_relaxing_body_has_less_force_on_the_way_out_and_two_true_stiffnesses():
    trial = pokes_on(Relaxing(SOFT, 1500.0, 0.4))
    assert trial.fault is None
    x, v, f = (trial.columns[n] for n in ("slave_position", "slave_velocity", "contact_force"))
    near = np.abs(x - 3e-3) < 0.5e-3
    way_in, way_out = f[near & (v > 0.01)], f[near & (v < -0.01)]
    assert way_out.mean() < 0.8 * way_in.mean()
    assert f.min() > -0.2
    truth = trial.summary()["truth"]
    compliance = TRANSMISSION.compliance
    assert truth["b"] == pytest.approx(3.0 + 1500.0 * 0.4)
    assert truth["k_surface"] == pytest.approx(1.0 / (1.0 / 2000.0 + compliance))
    fast = truth["further_laws"]["fast"]
    assert fast["b"] == 3.0
    assert fast["k_surface"] == pytest.approx(1.0 / (1.0 / 3500.0 + compliance))


def test_a_stiffer_specimen_at_the_next_contact_meets_the_limits_of_the_first():
    trial = pokes_on(Changing(SOFT, HARD, contact=3))
    assert trial.fault is None
    assert trial.settings.limits == pokes_on(SOFT).settings.limits
    t, x, f = (trial.columns[n] for n in ("time", "slave_position", "contact_force"))
    first, last = ((x > 0.5e-3) & part for part in (t < 2.0, t > 3.0))
    assert np.median(f[first] / x[first]) < 3000.0
    assert np.median(f[last] / x[last]) > 8000.0
    assert f.max() < trial.settings.limits.hard_force
    assert trial.summary()["truth"]["further_laws"]["changed"]["b"] == 24.0


def test_a_specimen_that_stiffens_while_it_is_indented_ends_in_a_named_stop():
    trial = pokes_on(Changing(SOFT, HARD, contact=2, delay=0.3))
    assert trial.fault is not None
    assert trial.fault["text"].startswith("force limit: contact force")
    assert trial.columns["time"][-1] < 4.0


def test_an_operator_who_aims_for_a_force_reaches_the_depth_if_nothing_is_felt():
    plain, aiming = pokes_on(SOFT), pokes_on(SOFT, aim_force=10.0, arm_stiffness=1500.0)
    deepest = [trial.columns["slave_position"].max() for trial in (plain, aiming)]
    assert deepest == pytest.approx([6e-3] * 2, rel=0.25)


def test_the_hand_of_a_stiffer_arm_follows_its_intention_with_more_force():
    settings = replace(QUICK, duration=1.5, estimators=("rls",))
    forces = [
        run_trial(replace(settings, operator_model=OperatorModel(arm_stiffness=k))).columns
        for k in (150.0, 400.0, 1500.0)
    ]
    soft, usual, stiff = (np.std(columns["master_force"]) for columns in forces)
    assert soft < usual < stiff


def test_position_coupling_keeps_the_slave_closer_to_the_master():
    from teleop.commands.trial_options import make_coupling

    lag = {}
    for name in ("velocity", "position"):
        settings = replace(QUICK, duration=1.5, cube="hard", estimators=("rls",))
        columns = run_trial(replace(settings, coupling=make_coupling(name))).columns
        lag[name] = np.abs(columns["master_position"] - columns["slave_position"]).mean()
    assert lag["position"] < lag["velocity"]


def test_real_time_runs_for_its_duration_and_reports_its_timing():
    for _ in range(4):
        trial = run_trial(TrialSettings(duration=0.5))
        if not trial.fault:  # otherwise the machine was busy: try again
            break
    assert trial.fault is None
    loop = trial.summary()["loop"]
    columns = trial.columns
    periods = len(columns["time"]) + columns["skipped"].sum()
    stalls = columns["skipped"].max() + 30  # the last tick of a busy machine may be late
    assert 500 - 30 <= periods <= 500 + stalls
    assert 1000.0 * columns["time"][-1] == pytest.approx(periods, abs=stalls)
    np.testing.assert_allclose(np.diff(columns["time"]), columns["dt"][1:], atol=1e-12)
    assert (
        loop["lateness_us"]["max"] >= loop["lateness_us"]["p99"] >= loop["lateness_us"]["p50"] >= 0
    )
    assert loop["overruns"] == trial.recording["overrun"].sum()


def test_summary_agrees_with_the_columns():
    trial = palpation()
    summary = trial.summary()
    c = trial.columns
    rls = summary["estimates"]["rls"]
    assert rls["b"] == pytest.approx(c["rls_b"].mean())
    assert rls["k"] == pytest.approx(c["rls_k"].mean())
    f_hat = c["rls_b"] * c["v"] + c["rls_k"] * c["x"]
    prior = c["rls_b"][:-1] * c["v"][1:]
    prior += c["rls_k"][:-1] * c["x"][1:]
    one_step = np.concatenate((c["f"][:1], c["f"][1:] - prior))
    assert rls["one_step_rms"] == pytest.approx(np.sqrt(np.mean(one_step**2)))
    assert rls["rise_time_s"] == rise_time(c["time"], c["rls_k"])
    late = np.linspace(0.0, 1e-3, 1001)
    period = np.full(1001, 1e-3)
    ticks = dict.fromkeys(("time", "dt", *PARTS), period) | {
        "lateness": late, "overrun": late > 0.9e-3, "skipped": late > 0.5e-3
    }  # fmt: skip
    running = RunningTiming()
    running.add(Recording(ticks, {}))
    timing = running.summary(1000.0)
    assert (timing["overruns"], timing["skipped"]) == (100, 500)
    assert timing["lateness_us"] == pytest.approx(
        {"p50": 500.0, "p99": 990.0, "p99_9": 999.0, "max": 1000.0}
    )
    assert rls["e_f"] == pytest.approx(force_error(c["f"], f_hat))
    assert summary["loop"]["mean_rate_hz"] == pytest.approx(1000.0)
    assert json.dumps(summary)


class Spy(SimulatedRig):
    """Counts the commands to the drives."""

    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        self.calls = []
        self.failing_at = None
        Spy.last = self

    def idle(self):
        confirmed = super().idle()
        self.calls.append("idle")
        assert self._applied == STANDSTILL
        return confirmed

    def enable(self):
        self.calls.append("enable")
        return super().enable()


@pytest.mark.usefixtures("undrawn")
def test_an_exception_in_a_tick_stops_the_rig_and_is_raised(monkeypatch, tmp_path):
    monkeypatch.setattr("teleop.trial.assembly.SimulatedRig", Spy)
    calls = []

    def fail(*arguments):
        calls.append(arguments)
        if len(calls) > 500:
            raise ZeroDivisionError("by design")
        return 0.0

    monkeypatch.setattr("teleop.control.conditions.Teleoperation.drive_force", fail)
    path = tmp_path / "run.mcap"
    with pytest.raises(ZeroDivisionError) as info:
        run_trial(QUICK, path)
    assert "drives were stopped" in info.value.__notes__[0]
    assert Spy.last.calls[0] == "enable"
    assert Spy.last.calls[-1] == "idle"
    recording = load(path)
    fault = recording.fault
    assert fault["text"].endswith("failure: ZeroDivisionError: by design")
    assert (path.with_suffix(".fault") / "cause.txt").read_text().startswith("what      ")
    after = recording["time"] > fault["time"] + 0.05
    assert after.sum() > 900
    assert not recording["commanded_slave_velocity"][after].any()


def test_a_stop_ramps_to_standstill_and_keeps_the_recording(monkeypatch):
    monkeypatch.setattr("teleop.trial.assembly.SimulatedRig", Spy)
    settings = replace(QUICK, condition="autonomous")
    asked = []

    def request(self, arm, skipped, end=""):
        asked.append(end)
        self.count = int(len(asked) >= 700)
        return Request(arm=arm, stop="Ctrl-C" if self.count else "")

    monkeypatch.setattr("teleop.trial.stop_switch.StopSwitch.request", request)
    trial = run_trial(settings)
    assert trial.interrupted
    assert trial.summary()["interrupted"]
    assert trial.fault is None
    speed = np.abs(trial.recording["commanded_slave_velocity"])
    acceleration = settings.limits.max_acceleration
    assert np.abs(np.diff(speed)).max() <= acceleration * 1e-3 * 1.001
    assert speed[-1] == 0.0
    assert len(speed) < 800
    assert Spy.last.calls == ["enable", "idle", "idle"]
    assert [event["text"] for event in trial.recording.events][-2:] == ["Ctrl-C", "at standstill"]


def test_a_rate_that_is_too_high_for_the_machine_is_refused_before_any_motion(monkeypatch):
    calm = np.zeros(1000)
    slow = LoopTiming.of_ticks(5000.0, calm, calm, calm + 400e-6, calm[:0], NOT_KNOWN)
    monkeypatch.setattr("teleop.trial.rehearsal.rehearse", lambda settings, seconds: slow)
    expected = (
        r"rate 5000 Hz: a tick takes 400 us .* more than 90% of the period of 200 us: "
        r"expected a rate of at most 2250 Hz, or fewer programs at the same time"
    )
    with pytest.raises(InputError, match=expected):
        run_trial(TrialSettings(rate=5000.0))


@pytest.mark.parametrize("tare", [NO_TARE, Tare(slave_position=12e-3, contact_force=5.0)])
def test_the_rehearsal_is_active_for_any_tare_and_limits(monkeypatch, tare):
    modes = set()

    class Spy(Loop):
        def step(self):
            goes_on = super().step()
            modes.add(self.controller.mode)
            return goes_on

    monkeypatch.setattr("teleop.trial.rehearsal.Loop", Spy)
    limits = replace(QUICK.raw_limits, soft_force=0.1, hard_force=0.2)
    measured = rehearse(replace(QUICK, tare=tare, custom_limits=limits), 0.1)
    assert 1e-6 < measured.work < 0.1
    assert Mode.ACTIVE in modes


def test_a_rehearsal_with_a_safety_stop_is_refused(monkeypatch):
    limits = replace(QUICK.raw_limits, soft_force=0.1, hard_force=0.2)
    monkeypatch.setattr("teleop.settings.trial_settings.simulated_rig_limits", lambda *_: limits)
    with pytest.raises(InputError, match="rehearsal on the simulated rig: stopped .* force limit"):
        rehearse(TrialSettings(condition="autonomous"), 1.0)


class SlowToRead(SimulatedRig):
    """A rig whose devices take 3 ms to read; every other call is an error."""

    def read(self):
        time.sleep(3e-3)
        return super().read()

    def enable(self):
        raise AssertionError

    write = enable


def test_a_rig_that_is_too_slow_to_read_is_refused_before_any_command():
    clock = VirtualClock(1000.0)
    rig = SlowToRead(CUBES["soft"], clock.now)
    with pytest.raises(InputError, match=r"\d+ us of it to read the devices\) .*: expected a"):
        check_wire(rig, clock, 50e-6)


def test_a_rig_that_is_read_in_time_is_accepted():
    clock = VirtualClock(50.0)
    check_wire(SimulatedRig(CUBES["soft"], clock.now), clock, 50e-6)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"condition": "telepathy"}, "free, mimic, autonomous"),
        ({"cube": "wood"}, "soft, medium, hard"),
        ({"clock": "sundial"}, "real, virtual"),
        ({"duration": 0.0}, "duration 0 s"),
        ({"duration": -1.0}, "duration -1 s"),
        ({"duration": float("nan")}, "duration nan"),
        ({"duration": float("inf")}, "duration inf"),
        ({"rate": 0.0}, "rate 0 Hz"),
        ({"rate": 1e6}, r"50 to 100000 Hz"),
        ({"bandwidth": 0.0}, "bandwidth must be positive"),
        ({"conditioning": "magic"}, "matched, svf, foaw, difference"),
    ],
)
def test_a_setting_out_of_range_is_refused(settings, word):
    with pytest.raises(InputError, match=word):
        TrialSettings(**settings)


@pytest.mark.parametrize("rate", [50.0, 100.0, 5000.0])
def test_other_rates_find_the_stiffness_too(rate):
    duration = 1.5 if rate > 1000.0 else 3.0
    trial = run_trial(replace(QUICK, rate=rate, duration=duration, estimators=("rls",)))
    k = np.median(trial.columns["rls_k"][len(trial.columns["time"]) // 2 :])
    assert k == pytest.approx(2100.0, rel=0.15)


def test_an_interrupt_while_the_estimates_are_completed_closes_the_recording(monkeypatch, tmp_path):
    def advance(self):
        if self._ticks.newest > 500:
            raise KeyboardInterrupt
        return False

    monkeypatch.setattr("teleop.streams.estimation.StreamEstimation.advance", advance)
    path = tmp_path / "run.mcap"
    with pytest.raises(KeyboardInterrupt):
        run_trial(replace(QUICK, duration=0.5), path)
    load(path)  # raises an error if the recording is not complete


def test_the_rate_comes_from_the_rig_file_wherever_it_is_not_given(tmp_path):
    text = (RIGS / "serial-board.toml").read_text()
    file = tmp_path / "slow.toml"
    file.write_text(text.replace("rate_hz = 1000\n", "rate_hz = 250\n", 1))
    rig = read_rig_file(file)
    configured = tmp_path / "trial.toml"
    configured.write_text('rig = "slow.toml"\n')
    on_rig = TrialSettings(rig=rig)
    for settings in (on_rig, replace(TrialSettings(), rig=rig), read_configuration(configured)):
        assert settings.loop_rate == make_clock(settings).rate == 250.0
    assert replace(on_rig, rate=500.0).loop_rate == 500.0
    assert to_document(on_rig)["loop_rate_hz"] == 250.0
    assert TrialSettings().loop_rate == 1000.0


class Opened(Exception):
    """The rig was opened."""


def test_a_hardware_rig_is_opened_only_if_a_person_has_armed_it(monkeypatch):
    def opened(rig):
        raise Opened

    monkeypatch.setattr("drivers.wired_rig.WiredRig.open", opened)
    monkeypatch.setattr("teleop.trial.run.check_rate", lambda settings, real: None)
    settings = TrialSettings(
        rig=read_rig_file(RIGS / "serial-board.toml"), specimen="liver", depth=3e-3
    )
    for own in (None, Teleoperation()):
        with pytest.raises(InputError, match=r"nobody has armed the drives: expected arm=True"):
            run_trial(settings, condition=own)
        with pytest.raises(Opened):
            run_trial(settings, condition=own, arm=True)
    with pytest.raises(InputError, match="nobody has armed"):
        run_trial(TrialSettings(), rig_maker=lambda now: WiredRig(settings.rig, now))


def test_an_own_condition_on_a_hardware_rig_needs_specimen_and_depth():
    settings = TrialSettings(rig=read_rig_file(RIGS / "serial-board.toml"))
    with pytest.raises(InputError, match=r"expected also a specimen .* and a depth"):
        run_trial(settings, condition=Teleoperation(), arm=True)


def test_a_hardware_rig_has_a_stop_key_by_default(monkeypatch):
    keys = []

    class Switch(StopSwitch):
        def __init__(self, key=False, explained=False):
            keys.append(key)
            super().__init__(key, explained)

    monkeypatch.setattr("teleop.trial.run.StopSwitch", Switch)
    with pytest.raises(InputError):
        run_trial(TrialSettings(rig=read_rig_file(RIGS / "serial-board.toml")))
    run_trial(TrialSettings(clock="virtual", duration=0.1, estimators=("rls",)))
    assert keys == [True, False]


@pytest.mark.parametrize("signals", [0, 1, 2], ids=["end", "Ctrl-C", "Ctrl-C twice"])
def test_a_drive_that_moves_on_after_the_end_of_a_trial_is_reported(signals):
    class Switch(StopSwitch):
        def request(self, arm, end=""):
            if signals and faulty and now() > 0.8:
                self.count, self.reason = signals, "Ctrl-C"
            return super().request(arm, end)

    faulty, clocks = [], []

    def now():
        return clocks[0]()

    class Obstinate(FaultyRig):
        def idle(self):
            if now() > 0.5:
                self.inject(Disobedient(-0.01, confirms=True))
            return super().idle()

    def make(clock):
        clocks.append(clock)
        faulty.append(Obstinate(SimulatedRig(CUBES["soft"], clock)))
        return faulty[0]

    with Switch() as switch:
        settings = TrialSettings(condition="autonomous", clock="virtual", duration=1.0)
        trial = run_trial(settings, switch=switch, rig_maker=make, arm=True)
    assert trial.fault["fault"] == "motion after a stop"
    assert "use the hardware emergency stop" in trial.stop_text


def test_a_trial_ends_when_the_slave_is_at_rest_after_the_stop():
    trial = run_trial(TrialSettings(condition="autonomous", clock="virtual", duration=1.0))
    assert trial.fault is None
    (end,) = [event for event in trial.recording.events if event["text"] == "at standstill"]
    rest = trial.recording["time"][-1] - end["time"]
    assert REST <= rest < 2.0 * REST
