"""Commands with a live page, in processes of their own. Several run at the same time."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import pytest

from ...busy_machine import REPEATS, busy_cause
from ...forked_command import start_command
from .live_client import page

AT_ONCE = 4
"""Number of commands that run at the same time. Most of them wait most of the time."""
PAUSE = 0.2
"""Shortest time without data from the server that is a pause [s]. It sends 60 frames per second."""
RATE = ("--rate", "100")
"""Option with a low rate of the loop, so that a busy machine can run it."""


class Command:
    """A `teleop` command with a live page. Its output goes to files, so no pipe is left open."""

    def __init__(self, arguments, folder):
        self.folder, self.arguments = folder, arguments
        self._output, self._error = (tempfile.TemporaryFile() for _ in range(2))  # noqa: SIM115
        rate = RATE if "run" in arguments and "--rate" not in arguments else ()
        self.process = start_command(
            *arguments,
            *rate,
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=self._error,
            cwd=folder,
        )

    @property
    def output(self):
        """Standard output until now."""
        return text_of(self._output)

    @property
    def error(self):
        """Standard error until now."""
        return text_of(self._error)

    @property
    def report(self):
        """What is known about the command, for the message of a test that fails."""
        code = self.process.poll()
        state = "is running" if code is None else f"ended with {code}"
        return (
            f"teleop {' '.join(map(str, self.arguments))}: {state}\n"
            f"standard output:\n{self.output}\nstandard error:\n{self.error}"
        )

    async def served(self):
        """Wait for the address of the page."""
        while not (found := re.search(r"live page: http://(.*)/#t=(\w+)\n", self.error)):
            assert self.process.poll() is None, "no live page"
            await asyncio.sleep(0.01)
        self.address, self.token = found.groups()

    @property
    def live_process(self):
        """Process id of the live process."""
        return self.child(b"teleop.live.process")

    def child(self, module):
        """Process id of the process that runs a module."""
        for entry in Path("/proc").iterdir():
            if entry.name.isdecimal():
                with contextlib.suppress(OSError):
                    line = (entry / "cmdline").read_bytes()
                    parent = (entry / "stat").read_text().rpartition(")")[2].split()[1]
                    if module in line and int(parent) == self.process.pid:
                        return int(entry.name)
        raise AssertionError(f"no process {module}")

    @property
    def shared_files(self):
        """Files that the command has in memory to share them with the live process."""
        lines = Path(f"/proc/{self.process.pid}/maps").read_text().splitlines()
        return {Path(line.split()[5]) for line in lines if "/shm/teleop-" in line}

    def page(self, **options):
        return page(self.address, self.token, **options)

    async def end(self, number=None):
        """Send a signal, if one is stated, and return the exit code, output and errors."""
        if number:
            self.process.send_signal(number)
        while self.process.poll() is None:
            await asyncio.sleep(0.01)
        return self.process.returncode, self.output, self.error

    def close(self):
        """End the process, if it is still running, and close the files."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._output.close()
        self._error.close()


def text_of(file):
    """The text that another process has written to a file."""
    return os.pread(file.fileno(), 1 << 20, 0).decode(errors="replace")


@contextlib.asynccontextmanager
async def running(arguments, folder):
    """Run a command in the block. An exception gets a note with its exit code and output."""
    command = Command(arguments, folder)
    try:
        await command.served()
        yield command
    except BaseException as error:
        end = time.monotonic() + 5.0
        while command.process.poll() is None and time.monotonic() < end:
            await asyncio.sleep(0.05)  # until the command has stated why it ends
        error.add_note(command.report)
        error.busy_cause = busy_cause(command.error)
        raise
    finally:
        command.close()


class Case(NamedTuple):
    """A scenario with a command."""

    arguments: tuple[str, ...]
    plan: str
    """Content of the file plan.toml in the folder of the command."""
    scenario: object
    """Function of the running command, which also checks its result."""


async def play(case, folder):
    """Run a case; repeat it if the command states that the machine was too busy."""
    for number in range(1 + REPEATS):
        own = folder / f"{case.scenario.__name__[:80]}-{number}"
        own.mkdir()
        if case.plan:
            (own / "plan.toml").write_text(case.plan)
        try:
            async with asyncio.timeout(60.0), running(case.arguments, own) as command:
                await case.scenario(command)
                return
        except Exception as error:
            if number == REPEATS or not error.busy_cause:
                raise
            print(f"repeated after {error!r}, {error.busy_cause}: {case.scenario.__name__}")


def command_case(*arguments, plan=""):
    """Decorate a scenario with a command, which becomes a test with the fixture `outcomes`."""

    def decorate(scenario):
        def test(outcomes):
            if error := outcomes[test.case]:
                raise error

        test.case = Case(arguments, plan, scenario)
        test.__name__, test.__doc__ = scenario.__name__, scenario.__doc__
        return test

    return decorate


def run_cases(cases, folder):
    """Run cases, of which `AT_ONCE` run at the same time; return their exceptions by the case."""

    async def run():
        free = asyncio.Semaphore(AT_ONCE)

        async def run_one(case):
            async with free:
                await play(case, folder)

        return await asyncio.gather(*map(run_one, cases), return_exceptions=True)

    return dict(zip(cases, asyncio.run(run()), strict=True))


@pytest.fixture(scope="module")
def outcomes(request, tmp_path_factory):
    """The exceptions of all cases that are selected in a file, None for those that succeed."""
    functions = (getattr(item, "function", None) for item in request.session.items)
    cases = [one.case for one in functions if hasattr(one, "case")]
    return run_cases(cases, tmp_path_factory.mktemp("live"))


@contextlib.asynccontextmanager
async def beating(client):
    """Take control, and send heartbeats within the block."""

    async def beat():
        with contextlib.suppress(Exception):
            while True:
                await client.beat()
                await asyncio.sleep(0.05)

    await client.send("control")
    task = asyncio.create_task(beat())
    try:
        yield
    finally:
        task.cancel()


async def arm(client):
    """Unlock and start. Like a person, try again after a pause of the page, see `PAUSE`.

    After a pause, the live process refuses UNLOCK and START, or the loop ignores START.
    """
    await client.until(client.is_in("ready"))
    await client.until(lambda: client.latest["state"]["control"] == "you")
    for _ in range(1 + REPEATS):
        known, longest = len(client.errors), 0.0
        await client.beat()
        await client.send("unlock")
        await client.send("start")
        sent = received = time.monotonic()
        while received < sent + 3.0 and not client.is_in("active")():
            await client.receive()
            longest = max(longest, time.monotonic() - received)
            received = time.monotonic()
            if len(client.errors) > known:
                break
        else:
            if client.is_in("active")():
                return
        refused = "".join(client.errors[known:])
        text = f"{refused} {client.latest['state']}, longest time without data {longest:.2f} s"
        assert "too slow to arm" in refused or longest > PAUSE, text
        await client.receive_for(0.3)
        if client.is_in("active")():
            return
        del client.errors[known:]
    raise AssertionError(f"not active: {client.latest['state']}")
