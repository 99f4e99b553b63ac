"""Requests from signals and the stop key; tests in a terminal are in test_stop_key.py."""

from __future__ import annotations

import os
import signal

import pytest

from teleop.safety import Fault
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial
from teleop.trial.stop_switch import StopSwitch


@pytest.fixture
def running():
    """Return a switch whose loop has run its first tick."""
    with StopSwitch() as switch:
        assert switch.request(True).arm
        yield switch


def test_one_signal_requests_a_ramp_and_a_second_an_immediate_stop(running):
    assert not running.interrupted
    os.kill(os.getpid(), signal.SIGINT)
    first = running.request(False)
    assert (first.stop, first.halt, first.arm) == ("Ctrl-C", False, False)
    os.kill(os.getpid(), signal.SIGINT)
    assert running.request(False).halt
    assert running.interrupted


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs SIGHUP")
@pytest.mark.parametrize(
    ("number", "reason"),
    [
        ("SIGTERM", "asked to end"),
        ("SIGHUP", "the terminal was closed"),
        ("SIGQUIT", "Ctrl-\\"),
    ],
)
def test_other_signals_give_their_reason(running, number, reason):
    os.kill(os.getpid(), getattr(signal, number))
    assert running.request(False).stop == reason


def test_before_the_first_tick_a_signal_interrupts():
    with StopSwitch(), pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)


def test_the_end_of_the_trial_is_a_stop_without_a_request_of_a_person():
    switch = StopSwitch()
    assert switch.request(False, "end of the trial").stop == "end of the trial"
    assert not switch.interrupted


def test_the_key_trips_the_emergency_stop():
    switch = StopSwitch()
    switch.key.pressed = True
    assert switch.request(False).faults[0].fault is Fault.EMERGENCY_STOP


def test_the_loss_of_the_key_ramps_down_once_and_counts_as_interrupted():
    switch = StopSwitch(key=True)
    switch.key.lost = "the terminal of the stop key was lost"
    for _ in range(2):
        request = switch.request(False)
        assert (request.stop, request.halt) == ("the terminal of the stop key was lost", False)
    assert switch.interrupted


def test_the_instructions_name_the_key_only_if_there_is_one():
    switch = StopSwitch(key=True)
    switch.key.missing = ""
    assert "Enter or Space" in switch.instructions
    assert switch.hint == "Enter stops"
    switch.key.missing = "not available on this system"
    assert "no stop key: not available on this system" in switch.instructions
    assert "Enter" not in switch.instructions
    assert switch.hint == "Ctrl-C stops"


@pytest.mark.parametrize("explained", [True, False])
def test_the_instructions_are_printed_only_if_nobody_has_read_them(explained, capfd):
    settings = TrialSettings("mimic", clock="virtual", duration=0.2, estimators=("rls",))
    with StopSwitch(explained=explained) as switch:
        run_trial(settings, None, True, switch)
    text = capfd.readouterr().err
    assert ("teleop: Ctrl-C ramps the drives down and ends the trial" in text) == (not explained)
    assert "teleop: follow O with x" in text
