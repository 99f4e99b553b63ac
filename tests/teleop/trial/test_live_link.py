"""The connection of the control process to the live process."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
from teleop.recording.sinks import event_record

from teleop.errors import InputError
from teleop.json_documents import dumps
from teleop.live import shared_file
from teleop.safety import Event, Fault
from teleop.safety.events import FAULT
from teleop.streams.child_process import LIVE_PROCESS, ChildProcess
from teleop.streams.shared_file import SharedFile
from teleop.trial import live_link
from teleop.trial.live_link import EVENT_SIZE, LiveLink

NO_CHOICES = {"condition": [], "specimen": [], "duration": []}


@pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX")
@pytest.mark.parametrize("possible", [0, 1, 2])
def test_no_file_is_left_if_the_memory_is_full(monkeypatch, tmp_path, possible):
    def create(size):
        if len(list(tmp_path.iterdir())) == possible:
            raise OSError(28, "No space left on device")
        return complete(size)

    complete = SharedFile.create
    monkeypatch.setattr(shared_file, "MEMORY", Path(tmp_path))
    monkeypatch.setattr(SharedFile, "create", create)
    with pytest.raises(InputError, match="live page: cannot be started: no space left"):
        LiveLink(1000, "127.0.0.1", 0, True, False, NO_CHOICES)
    assert list(tmp_path.iterdir()) == []


def test_the_longest_event_fits_into_the_ring_of_events():
    text = 2000 * "\N{COLLISION SYMBOL}"  # a character outside the basic plane needs most bytes
    record = event_record(
        Event(-1e-300 / 3, FAULT, text, Fault.NOT_FOLLOWING, text, *3 * [-1e-300 / 3])
    )
    assert len(dumps(record)) <= EVENT_SIZE


@pytest.mark.real_time
@pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX")
def test_a_live_process_that_hangs_is_not_running(monkeypatch):
    monkeypatch.setattr(live_link, "WAITING_SILENCE", 1.0)
    link = LiveLink(1000, "127.0.0.1", 0, True, False, NO_CHOICES)
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
