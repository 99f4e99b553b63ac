"""Signals that end a program are counted, acknowledged or raised, and stay ignored."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from teleop import interruption
from teleop.interruption import CLEAN_UP, Interruption, handle_signals, stop_signals


@pytest.fixture
def passes(monkeypatch):
    """Advances the time [s]."""
    now = [0.0]
    monkeypatch.setattr(interruption.time, "monotonic", lambda: now[0])

    def wait(seconds):
        now[0] += seconds

    return wait


def send(name="SIGINT"):
    os.kill(os.getpid(), getattr(signal, name))


@pytest.mark.parametrize("name", [n for n in interruption.SIGNALS if hasattr(signal, n)])
def test_each_signal_interrupts_a_program_and_its_handler_is_restored(name):
    number = getattr(signal, name)
    before = signal.getsignal(number)
    with Interruption(), pytest.raises(KeyboardInterrupt):
        send(name)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("name", [n for n in interruption.SIGNALS if hasattr(signal, n)])
def test_a_signal_that_is_ignored_on_entry_stays_ignored(name):
    """`nohup` ignores SIGHUP, and `&` in a shell script ignores SIGINT."""
    number = getattr(signal, name)
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with Interruption() as interrupted, stop_signals() as stopped:
            send(name)
            assert signal.getsignal(number) is signal.SIG_IGN
        assert interrupted.count == 0
        assert not stopped()
    finally:
        signal.signal(number, before)


def test_a_second_signal_does_not_interrupt_the_clean_up_unless_it_hangs(passes):
    with Interruption():
        with pytest.raises(KeyboardInterrupt):
            send()
        send()
        passes(0.5 * CLEAN_UP)
        send()
        passes(0.6 * CLEAN_UP)
        with pytest.raises(KeyboardInterrupt):
            send()


def test_a_loop_that_acknowledges_signals_is_never_interrupted(passes):
    with Interruption() as interrupted:
        interrupted.timeout = 0.1
        for _ in range(5):
            send()
            interrupted.acknowledge()
            passes(1.0)
        assert interrupted.count == 5


def test_a_loop_that_hangs_is_interrupted_by_the_second_signal(passes):
    with Interruption() as interrupted:
        interrupted.timeout = 0.1
        send()
        passes(0.2)
        with pytest.raises(KeyboardInterrupt):
            send()


def test_in_another_thread_no_signal_is_handled():
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def run():
        with handle_signals(print):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert seen == [before]
