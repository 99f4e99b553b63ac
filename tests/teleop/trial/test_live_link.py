"""The connection of the control process to the live process."""

from __future__ import annotations

import os
import signal
import time

import pytest

from teleop.errors import InputError
from teleop.streams.child_process import LIVE_PROCESS, ChildProcess
from teleop.streams.shared_file import SharedFile
from teleop.trial import live_link
from teleop.trial.live_link import LiveLink

NO_CHOICES = {"condition": [], "specimen": [], "duration": []}


@pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX")
def test_without_memory_the_page_is_refused(monkeypatch):
    def create(size):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(SharedFile, "create", create)
    with pytest.raises(InputError, match="live page: cannot be started: no space left"):
        LiveLink("127.0.0.1", 0, True, False, NO_CHOICES)


@pytest.mark.real_time
@pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX")
def test_a_live_process_that_hangs_is_not_running(monkeypatch):
    monkeypatch.setattr(live_link, "WAITING_SILENCE", 0.5)
    monkeypatch.setattr("teleop.streams.child_process.END_TIME", 0.1)
    link = LiveLink("127.0.0.1", 0, True, False, NO_CHOICES)
    try:
        assert link.is_running
        os.kill(link.pid, signal.SIGSTOP)
        end = time.monotonic() + 10.0
        while link.is_running:
            assert time.monotonic() < end
            time.sleep(0.05)
    finally:
        link.end()


@pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX")
def test_a_live_process_that_serves_no_page_yet_ends_with_the_command_and_prints_nothing(capfd):
    process = ChildProcess(LIVE_PROCESS)
    process.end()
    assert not process.is_running
    process = ChildProcess(LIVE_PROCESS)
    process.ask_to_end()  # as if the command was killed
    assert process._process.wait(60.0) == 0
    process.end()
    assert capfd.readouterr() == ("", "")
