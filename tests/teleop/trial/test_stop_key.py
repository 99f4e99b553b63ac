"""The emergency-stop key in a real terminal: the keys, and the modes of the terminal.

`test_faults.py` tests the terminal after a run that was stopped with Enter, Ctrl-C or SIGHUP.
"""

from __future__ import annotations

import os
import queue
import re
import select
import signal
import sys
import time
from pathlib import Path

import pytest

from teleop.recording.recording import load
from teleop.trial.stop_switch import StopKey, StopSwitch, is_foreground

from ...forked_command import run_command

pytest.importorskip("termios", reason="needs a POSIX terminal")
import pty
import termios

SHELL = """
import os, signal, sys
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
number = getattr(signal, os.environ.get("IGNORED", ""), None)
if number:
    signal.signal(number, signal.SIG_IGN)
child = os.fork()
if not child:
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpid())
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.execv(sys.executable, [sys.executable, "-m", "teleop", "run", *sys.argv[1:]])
while True:
    _, status = os.waitpid(child, os.WUNTRACED)
    if not os.WIFSTOPPED(status):
        break
    os.tcsetpgrp(0, os.getpid())
    os.write(3, b"suspended")
    if os.read(4, 1) == b"f":
        os.tcsetpgrp(0, child)
    os.kill(child, signal.SIGCONT)
os.write(3, b"ended")
os._exit(os.waitstatus_to_exitcode(status) % 256)
"""
"""A shell with job control: the run is its foreground job."""
MOVING = rb"\[Enter stops\] +active +\d+\.\d of"


class Run:
    """A run in virtual time, the foreground job of a new terminal."""

    def __init__(self, folder, *arguments, ignored="", duration="3600"):
        events, sender = os.pipe()
        commands, self.commands = os.pipe()
        pid, self.terminal = pty.fork()
        if pid == 0:
            os.chdir(folder)
            os.dup2(sender, 13)
            os.dup2(commands, 4)
            os.dup2(13, 3)
            os.environ["IGNORED"] = ignored
            end = ["--clock", "virtual", "--duration", duration]
            os.execv(sys.executable, [sys.executable, "-c", SHELL, *end, *arguments])
        os.close(sender)
        os.close(commands)
        self.pid, self.events, self.text = pid, events, b""

    def is_cooked(self):
        """Return whether the terminal passes whole lines and echoes."""
        wanted = termios.ICANON | termios.ECHO
        return termios.tcgetattr(self.terminal)[3] & wanted == wanted

    def read(self):
        try:
            chunk = os.read(self.terminal, 4096)
        except OSError:
            chunk = b""
        self.text += chunk
        return chunk

    def wait_until(self, pattern):
        self.text = b""
        while not re.search(pattern, self.text):
            assert self.read(), self.text

    def type(self, keys):
        os.write(self.terminal, keys)

    def event(self):
        """Return the next event of the shell, and read the terminal meanwhile."""
        while True:
            ready, _, _ = select.select([self.events, self.terminal], [], [])
            if self.events in ready:
                return os.read(self.events, 100)
            assert self.read(), self.text

    def end(self):
        """The exit code."""
        assert self.event() == b"ended"
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


@pytest.fixture
def run(tmp_path):
    """Starts a run and waits, by default until it moves."""
    runs = []

    def start(*arguments, until=MOVING, **options):
        runs.append(Run(tmp_path, *(arguments or ["--no-record"]), **options))
        runs[-1].wait_until(until)
        assert until != MOVING or not runs[-1].is_cooked()
        return runs[-1]

    yield start
    for made in runs:
        try:
            os.kill(made.pid, signal.SIGKILL)
            os.waitpid(made.pid, 0)
        except (ProcessLookupError, ChildProcessError):
            pass
        os.close(made.events)
        os.close(made.commands)


class Terminal:
    """The person's end of a terminal from which this process reads."""

    def __init__(self, monkeypatch):
        self.descriptor, follower = pty.openpty()
        self.stdin = os.fdopen(follower)
        self.read = queue.SimpleQueue()
        read = os.read

        def recorded(descriptor, size):
            data = read(descriptor, size)
            if descriptor == follower:
                self.read.put(data)
            return data

        monkeypatch.setattr(os, "read", recorded)
        monkeypatch.setattr("sys.stdin", self.stdin)
        monkeypatch.setattr("teleop.trial.stop_switch.is_foreground", lambda: True)

    def type(self, keys):
        """Type keys, and wait until this process has read them."""
        os.write(self.descriptor, keys)
        missing = len(keys)
        while missing:
            missing -= len(self.read.get(timeout=60.0))

    def has(self, modes):
        """Return whether all of these local modes are set."""
        return termios.tcgetattr(self.descriptor)[3] & modes == modes

    def close(self):
        self.stdin.close()
        os.close(self.descriptor)


@pytest.fixture
def terminal(monkeypatch):
    made = Terminal(monkeypatch)
    yield made
    monkeypatch.undo()
    made.close()


OTHER_KEYS = b"\x04x\x1b[A\x04\x04"
"""Ctrl-D, a letter, a key of several codes, and Ctrl-D twice."""


def wait_until_pressed(key):
    until = time.monotonic() + 60.0
    while not key.pressed:
        assert time.monotonic() < until
        time.sleep(1e-3)


@pytest.mark.parametrize("keys", [b"\r", b"\n", b" ", b"abc \n"])
def test_enter_and_space_are_the_stop_key(terminal, keys):
    with StopKey() as key:
        terminal.type(keys)
        wait_until_pressed(key)


def test_ctrl_d_and_other_keys_are_not_the_stop_key(terminal):
    with StopKey() as key:
        terminal.type(OTHER_KEYS)
    assert not key.pressed


def test_ctrl_d_and_other_keys_do_not_end_the_stop_key(terminal):
    with StopKey() as key:
        terminal.type(OTHER_KEYS)
        terminal.type(b" ")
        wait_until_pressed(key)


def test_keys_are_read_at_once_and_without_echo_and_ctrl_c_has_its_effect(terminal):
    with StopKey():
        assert not terminal.has(termios.ICANON)
        assert not terminal.has(termios.ECHO)
        assert terminal.has(termios.ISIG)
    assert terminal.has(termios.ICANON | termios.ECHO | termios.ISIG)


def test_the_terminal_is_restored_while_the_run_is_suspended(run):
    going = run()
    going.type(b"\x1a")
    assert going.event() == b"suspended"
    assert going.is_cooked()
    os.write(going.commands, b"f")
    going.wait_until(MOVING)
    assert not going.is_cooked()
    going.type(b"\x1a")
    assert going.event() == b"suspended"
    assert going.is_cooked()
    os.write(going.commands, b"f")
    going.wait_until(MOVING)
    going.type(b"\n")
    assert going.end() == 3
    assert going.is_cooked()


def test_a_run_that_continues_in_the_background_reports_that_the_key_does_not_work(run):
    going = run()
    job = os.tcgetpgrp(going.terminal)
    going.type(b"\x1a")
    assert going.event() == b"suspended"
    os.write(going.commands, b"b")
    going.wait_until(rb"in the background: the stop key does not work")
    assert going.is_cooked()
    os.kill(job, signal.SIGTERM)
    assert going.end() == 130
    assert going.is_cooked()


def test_a_run_whose_terminal_is_lost_ramps_down(run, tmp_path):
    """SIGHUP is ignored, as with nohup; otherwise it would end the run."""
    going = run("--record", "a.mcap", ignored="SIGHUP")
    os.close(going.terminal)
    assert os.read(going.events, 100) == b"ended"
    status = os.waitpid(going.pid, 0)[1]
    assert os.waitstatus_to_exitcode(status) == 2  # its output cannot be printed
    stop = load(tmp_path / "a.mcap").events[-2]
    assert stop["text"] == "the terminal of the stop key was lost"
    assert stop["mode"] == "stopping"


def test_on_a_system_without_terminals_the_instructions_say_that_there_is_no_key(monkeypatch):
    monkeypatch.setattr("teleop.trial.stop_switch.posix_module", lambda name: None)
    switch = StopSwitch(key=True)
    assert "no stop key: not available on this system" in switch.instructions
    with switch, switch.reading_keys():
        assert switch.request(True).arm


def test_without_a_terminal_there_is_no_key_and_the_run_continues(tmp_path):
    lines = tmp_path / "lines"
    lines.write_text("\n\n")
    with lines.open() as typed:
        command = ("run", "--clock", "virtual", "--no-record", "--duration", "0.2")
        assert run_command(*command, stdin=typed).returncode == 0


def test_a_process_whose_input_is_not_a_terminal_is_not_in_the_foreground(monkeypatch):
    with Path(os.devnull).open() as stdin:
        monkeypatch.setattr("sys.stdin", stdin)
        assert not is_foreground()
