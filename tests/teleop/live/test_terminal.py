"""Output to a terminal that accepts none must not make the recorder lose a tick."""

from __future__ import annotations

import json
import os
from contextlib import suppress

import pytest

from teleop.live.terminal import Terminal
from teleop.recording.recording import load

from ...forked_command import run_command

termios = pytest.importorskip("termios")
RUN = ("run", "--clock", "virtual", "--duration", "2", "--json")


@pytest.fixture
def terminal():
    """Yield both ends of a terminal whose first end is not read."""
    ends = os.openpty()
    yield ends
    for end in ends:
        os.close(end)


def stop(end):
    """Stop a terminal's output, as Ctrl-S does."""
    termios.tcflow(end, termios.TCOOFF)


def fill(end):
    """Write to a terminal until it accepts no more."""
    os.set_blocking(end, False)
    with suppress(BlockingIOError):
        while True:
            os.write(end, b"x" * 4096)
    with suppress(BlockingIOError):
        while True:
            os.write(end, b"x")
    os.set_blocking(end, True)


@pytest.mark.parametrize("block", [stop, fill])
def test_a_terminal_that_accepts_no_output_loses_no_tick(tmp_path, terminal, block):
    path = tmp_path / "a.mcap"
    block(terminal[1])
    run = run_command(*RUN, "--record", path, stderr=terminal[1])
    summary = json.loads(run.stdout)
    assert run.returncode == 0
    assert summary["recording"]["problem"] is None
    recording = load(path)
    assert recording["time"][-1] >= 2.0
    assert len(recording) == 1 + round((recording["time"][-1] - recording["time"][0]) * 1e3)


def test_a_resumed_terminal_shows_the_messages_and_the_last_line(terminal):
    far, near = terminal
    stop(near)
    output = Terminal(near)
    for number in range(1000):
        output.draw(f"\rdrawing {number:04}")
    output.write("\rmessage\n")
    for number in range(1000):
        output.draw(f"\rlast {number:04}")
    output.close()
    termios.tcflow(near, termios.TCOON)
    shown = ""
    while "last 0999" not in shown:
        shown += os.read(far, 4096).decode()
    assert "\rmessage\r\n" in shown
    assert shown.endswith("\rlast 0999")
    assert len(shown) < 100


def test_output_is_written_before_close_returns(terminal):
    far, near = terminal
    output = Terminal(near)
    output.write("message\n")
    output.close()
    os.set_blocking(far, False)
    assert os.read(far, 4096) == b"message\r\n"
