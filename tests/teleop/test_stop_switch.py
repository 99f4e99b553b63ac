"""What a person's signals and key become; in a terminal, tests/teleop/test_faults.py."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from teleop.safety import Fault
from teleop.stop_switch import StopSwitch


def test_one_signal_asks_for_a_stop_and_a_second_for_one_at_once():
    before = signal.getsignal(signal.SIGINT)
    with StopSwitch() as switch:
        assert switch.request(True).arm
        assert not switch.interrupted
        os.kill(os.getpid(), signal.SIGINT)
        first = switch.request(False)
        assert (first.stop, first.halt, first.arm) == ("Ctrl-C", False, False)
        os.kill(os.getpid(), signal.SIGINT)
        assert switch.request(False).halt
        assert switch.interrupted
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="needs SIGHUP")
@pytest.mark.parametrize(
    ("number", "reason"), [("SIGTERM", "asked to end"), ("SIGHUP", "the terminal was closed")]
)
def test_a_request_to_end_and_a_closed_terminal_say_so(number, reason):
    with StopSwitch() as switch:
        os.kill(os.getpid(), getattr(signal, number))
        assert switch.request(False).stop == reason


def test_the_end_of_the_trial_is_a_stop_that_nobody_asked_for():
    switch = StopSwitch()
    assert switch.request(False, "end of the trial").stop == "end of the trial"
    assert not switch.interrupted


def test_the_key_trips_the_emergency_stop():
    switch = StopSwitch()
    switch._pressed = True
    assert switch.request(False).trips[0].fault is Fault.EMERGENCY_STOP


def test_off_the_main_thread_no_signal_is_taken():
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def run():
        with StopSwitch():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert seen == [before]
