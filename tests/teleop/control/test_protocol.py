"""The slave performs the steps of a protocol by position and by contact force."""

from __future__ import annotations

import math
import random
from collections import deque

import numpy as np
import pytest

from drivers import Ages, Measurement
from teleop.control.admittance import Admittance, AdmittanceParameters
from teleop.control.conditions import IntendedMotion
from teleop.control.excitation_signals import Sine
from teleop.control.phases import Approach, Cyclic, Hold, Preload, Withdraw
from teleop.control.protocol import (
    LAG,
    Crossings,
    MassVelocity,
    Protocol,
    ProtocolSettings,
)
from teleop.settings.trial_settings import TrialSettings
from teleop.testing import check_trial
from teleop.trial.run import run_trial

DT = 1e-3
AGES = Ages._make([0.0] * len(Ages._fields))


def performed(phases, cube="soft", **settings):
    protocol = ProtocolSettings(tuple(phases))
    trial = run_trial(
        TrialSettings(
            protocol=protocol,
            duration=protocol.longest,
            cube=cube,
            clock="virtual",
            estimators=("rls",),
            **settings,
        )
    )
    assert trial.fault is None
    return trial


def held(trial, number):
    """The second half of a step: position and contact force."""
    part = np.flatnonzero(trial.recording["phase"] == number)
    late = part[len(part) // 2 :]
    return trial.recording["slave_position"][late], trial.recording["contact_force"][late]


@pytest.mark.parametrize(("cube", "force"), [("soft", 3.0), ("medium", 6.0), ("hard", 12.0)])
def test_a_force_is_held_on_any_cube_of_the_default_rig(cube, force):
    trial = performed([Approach(), Preload(force=force, ramp=0.5, hold=2.0)], cube, seed=40961)
    _, f = held(trial, 2)
    assert f.mean() == pytest.approx(force, rel=0.015)
    assert np.std(f) < 0.03
    assert trial.recording["contact_force"].max() < 1.15 * force


def test_the_tip_holds_a_depth_from_the_contact_point_despite_lost_motion():
    """The reference of the depth is the tip: 2 mm from the point of 0.2 N, which is at 0.1 mm."""
    trial = performed([Approach(), Preload(depth=2e-3, ramp=0.5, hold=2.0)], seed=40962)
    _, f = held(trial, 2)
    cube = trial.settings.setup.cube
    assert f.mean() == pytest.approx(cube.slow.force(2.1e-3, 0.0), rel=0.03)


def test_the_amplitude_of_a_sine_is_that_of_the_tip():
    phase = Cyclic(depth=3e-3, amplitude=1e-3, frequencies=(1.0,), cycles=3)
    trial = performed([Approach(), phase], seed=40963)
    _, f = held(trial, 2)
    stiffness = trial.settings.setup.cube.slow.stiffness(3.1e-3)
    assert 0.5 * np.ptp(f) == pytest.approx(1e-3 * stiffness, rel=0.05)


def test_a_protocol_ends_when_its_last_step_has_ended():
    trial = performed([Approach(), Hold(0.5), Withdraw(0.2)], seed=40964)
    assert trial.ending == ""
    assert trial.recording["time"][-1] < 0.8 * trial.settings.duration


def test_an_approach_without_contact_ends_the_trial_with_its_reason():
    trial = performed([Approach(force=8.0, max_depth=1e-3), Hold()], seed=40965)
    assert trial.ending.startswith("approach: the contact force has not reached 8 N at 0.")
    assert trial.ending in [event["text"] for event in trial.ticks.events]
    assert trial.summary()["ending"] == trial.ending


def test_a_protocol_follows_the_rules_of_conditions():
    check_trial(Protocol(ProtocolSettings((Approach(), Hold(1.0)))))


def slave(phases, force_of, seconds, start=0.0, depth=10e-3, noise=0.02):
    """Perform phases with an ideal drive on a body; return the protocol, times and positions."""
    protocol = Protocol(ProtocolSettings(tuple(phases)))
    parameters = AdmittanceParameters()
    protocol.prepare(IntendedMotion(Sine(1.0), depth, 0.0, 60.0, parameters, 1.0))
    mass, x, generator = Admittance(parameters), start, random.Random(11)
    positions = []
    for n in range(round(seconds / DT)):
        measured = force_of(x, n * DT) + generator.gauss(0.0, noise)
        measurement = Measurement(n * DT, 0.0, x, x, measured, 0.0, AGES)
        x += mass.step(protocol.drive_force(n * DT, measurement), DT) * DT
        positions.append(x)
        if protocol.finished:
            break
    return protocol, np.array(positions)


def force_loop(stiffer, lag):
    """Hold a force on a spring that becomes stiffer, behind a delay; return protocol and forces."""
    delayed = deque([2.0] * round(lag / DT), maxlen=max(round(lag / DT), 1))

    def force_at(x, t):
        k = 2000.0 * (stiffer if t > 3.0 else 1.0)
        return max(2000.0 * 1e-3 + k * (x - 1e-3), 0.0)

    def measured(x, t):
        oldest = delayed[0]
        delayed.append(force_at(x, t))
        return oldest

    phases = [Preload(force=5.0, ramp=0.5, hold=20.0)]
    protocol, x = slave(phases, measured, 12.0, start=1e-3, noise=0.01)
    return protocol, np.array([force_at(one, 12.0) for one in x.tolist()])


def test_the_force_loop_is_stable_with_its_longest_lag_and_twice_the_stiffness():
    protocol, forces = force_loop(2.0, LAG)
    assert not protocol.finished
    assert forces[-2000:] == pytest.approx(5.0, rel=0.02)


@pytest.mark.parametrize(("amplitude", "oscillates"), [(0.0, False), (0.05, False), (1.5, True)])
def test_an_oscillation_of_the_force_is_told_from_noise(amplitude, oscillates):
    crossings, noise = Crossings(), random.Random(3)
    found = [
        crossings.update(t, 5.0 + amplitude * math.sin(40.0 * t) + noise.gauss(0.0, 0.1), 5.0)
        for t in np.arange(0.0, 5.0, DT).tolist()
    ]
    assert any(found) == oscillates


def test_an_oscillation_ends_the_protocol(monkeypatch):
    monkeypatch.setattr(Crossings, "update", lambda *arguments: True)
    protocol, _ = force_loop(1.0, LAG)
    assert protocol.finished
    assert "oscillates" in protocol.ending


def test_the_virtual_mass_has_the_velocity_that_is_asked_for():
    parameters = AdmittanceParameters(0.7, 9.0, 30.0)
    mass, inverse = Admittance(parameters), MassVelocity(parameters)
    for n in range(500):
        wanted = 0.02 * math.sin(0.02 * n)
        assert mass.step(inverse.force(wanted, DT), DT) == pytest.approx(wanted, abs=1e-5)


@pytest.mark.parametrize("k", [500.0, 2000.0, 10000.0])
def test_the_travel_in_air_before_an_approach_does_not_change_the_felt_stiffness(k):
    phases = [Approach(speed=5e-3), Preload(force=2.0, ramp=0.5, hold=6.0)]
    protocol, x = slave(phases, lambda x, t: k * max(x, 0.0), 8.0, start=-4e-3)
    assert protocol.ending == "" or "step 3" in protocol.ending
    assert protocol._felt.stiffness == pytest.approx(k, rel=0.35)
    assert k * x.max() < 2.5
    assert k * x[-500:].mean() == pytest.approx(2.0, rel=0.05)


def test_a_body_that_gives_way_while_its_force_is_held_ends_the_protocol():
    phases = [Approach(), Preload(force=2.0, ramp=0.5, hold=10.0)]
    protocol, x = slave(phases, lambda x, t: 2000.0 * max(x, 0.0) if t < 3.0 else 0.0, 8.0)
    assert "the contact force was lost" in protocol.ending
    assert x[-1] < 9e-3


def test_a_force_that_is_not_reached_ends_the_protocol_at_the_depth_of_the_trial():
    phases = [Approach(), Preload(force=5.0, ramp=0.5, hold=60.0)]
    protocol, x = slave(phases, lambda x, t: 100.0 * max(x, 0.0), 60.0, depth=8e-3)
    assert "deeper than the depth of the trial, 8 mm" in protocol.ending
    assert x[-1] < 8.3e-3


def test_an_approach_against_a_force_of_the_wrong_sign_ends_the_protocol():
    protocol, x = slave([Approach(), Hold()], lambda x, t: -2000.0 * max(x, 0.0), 10.0)
    assert "the contact force is negative" in protocol.ending
    assert x[-1] < 1e-3


def test_a_second_approach_ends_at_its_depth_from_the_datum():
    phases = [Approach(), Withdraw(0.2, depth=-2e-3), Approach(max_depth=4e-3), Hold()]

    def body(x, t):
        return 2000.0 * max(x - 2e-3, 0.0) if t < 1.4 else 0.0

    protocol, x = slave(phases, body, 9.0)
    assert "approach: the contact force has not reached 0.2 N" in protocol.ending
    assert 3.8e-3 < x.max() < 4.1e-3


def test_a_protocol_is_not_continued_after_the_drives_were_armed_again():
    protocol, _ = slave([Approach(), Preload(depth=3e-3)], lambda x, t: 2000.0 * max(x, 0.0), 1.0)
    measurement = Measurement(0.0, 0.0, 1e-3, 1e-3, 2.0, 0.0, AGES)
    force = protocol.drive_force(0.0, measurement)
    assert math.isfinite(force)
    assert protocol.finished
    assert "armed again" in protocol.ending


def test_a_protocol_that_the_duration_cuts_says_so():
    protocol, _ = slave([Approach(), Hold(5.0)], lambda x, t: 2000.0 * max(x, 0.0), 1.0)
    assert protocol.ending == "the trial ended in step 2 of 2 of the protocol"
