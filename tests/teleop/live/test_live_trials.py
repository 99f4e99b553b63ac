"""Trials with the live page, in real time, with the real processes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from teleop.recording.recording import load
from teleop.studies.json_lines import locked
from teleop.studies.series.journal import Journal

from .live_client import page
from .page.delay import Delay

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX"),
]


RATE = ("--rate", "100")
"""Option with a low rate of the loop, so that a busy machine can run it."""


class Command:
    """A running `teleop` command with a live page."""

    def __init__(self, process, url, folder):
        self.process = process
        self.address, self.token = re.search(r"http://(.*)/#t=(\w+)", url).groups()
        self.folder = folder

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
        return {Path(line.split()[5]) for line in lines if "/teleop-live-" in line}

    def page(self, **options):
        return page(self.address, self.token, **options)

    def end(self, number=signal.SIGTERM):
        """Send a signal, and return the exit code, standard output and standard error."""
        if number:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=120)
        return self.process.returncode, out, err


@contextlib.contextmanager
def starting(folder):
    """Yield a function that starts a command and waits until its page is served."""
    started = []

    def run(*arguments):
        rate = RATE if "run" in arguments and "--rate" not in arguments else ()
        process = subprocess.Popen(
            [sys.executable, "-m", "teleop", *arguments, *rate],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder,
        )
        started.append(process)
        for line in process.stderr:
            if "live page: " in line:
                return Command(process, line, folder)
        raise AssertionError(f"no live page: {process.communicate()}")

    yield run
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.fixture
def start(tmp_path):
    with starting(tmp_path) as run:
        yield run


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
    await client.until(client.is_in("ready"))
    await client.until(lambda: client.latest["state"]["control"] == "you")
    await client.beat()
    await client.send("unlock")
    await client.send("start")
    await client.until(client.is_in("active"))


def run(scenario):
    return asyncio.run(asyncio.wait_for(scenario, 120.0))


@pytest.fixture(scope="module")
def armed_trial(tmp_path_factory):
    """The client that armed a trial of 1 s, the output of the command, and the recording."""

    async def scenario(command):
        async with command.page() as client, beating(client):
            await client.until(client.is_in("ready"))
            await client.until(
                lambda: (
                    client.rows is not None and len(client.rows) and client.column("time")[-1] > 1.0
                )
            )
            await arm(client)
            armed = client.latest["state"]
            await client.until(lambda: "summary" in client.latest)
            await client.until(client.is_in("ended"))
            return client, armed

    with starting(tmp_path_factory.mktemp("armed")) as start:
        options = ("--duration", "1", "--rate", "250", "--condition", "mimic")
        command = start("run", "--live", *options, "--record", "one.mcap")
        client, armed = run(scenario(command))
        code, out, _ = command.end(None)  # --record: one trial
    assert code == 0
    return client, armed, out, load(command.folder / "one.mcap")


def test_a_trial_waits_for_start_and_lasts_its_whole_duration_after_it(armed_trial):
    client, armed, out, recording = armed_trial
    assert client.latest["welcome"]["may_arm"]
    assert armed["armed_by"] == "page"
    assert armed["armed_at"] > 1.0
    assert "stiffness" in out
    active = recording["time"][recording["mode"] == 3]
    assert active[0] > 1.0
    assert active[-1] - active[0] == pytest.approx(1.0, abs=0.05)
    first = np.flatnonzero(recording["mode"] == 3)[:3]
    assert recording["target"][first][1:] == pytest.approx(
        [recording["target"][first][1]] * 2, rel=0.01
    )


def test_the_page_shows_the_values_of_the_recording(armed_trial):
    client, _, _, recording = armed_trial
    names = [column["name"] for column in client.latest["welcome"]["columns"]]
    at = np.searchsorted(recording["time"], client.rows[:, 0])
    assert len(at) > 300
    for name, column in zip(names, client.rows.T, strict=True):
        if name != "sent":
            assert np.array_equal(column, recording[name][at], equal_nan=True), name
    assert np.diff(client.rows[:, -1]).min() > 0.0
    assert client.latest["summary"]["ticks"] > 200
    health = client.latest["state"]["health"]
    assert health["skipped"] == recording["skipped"].sum()
    assert health["overruns"] == recording["overrun"].sum()


def test_after_end_or_stop_from_any_page_next_runs_another_trial_with_other_settings(start):
    async def scenario(command):
        async with command.page() as client, command.page() as other, beating(client):
            await arm(client)
            await client.send("end")
            await client.until(client.is_in("ended"))
            await client.send("choose", specimen="hard", duration=5)
            await client.send("choose", specimen="steel")
            await client.until(lambda: client.errors)
            await client.answer("notes", text="second <b>trial</b>")
            await client.answer("next")
            await arm(client)
            assert client.latest["trial"]["specimen"] == "hard cube"
            assert client.latest["trial"]["duration"] == 5.0
            await client.send("choose", specimen="soft")
            await client.until(lambda: len(client.errors) == 2)
            assert not client.latest["state"]["faulted"]
            await other.send("stop")
            await client.until(client.is_in("fault"))
            assert client.latest["state"]["text"] == "emergency stop: live page"
            await client.until(client.is_in("ended"))
            assert client.latest["state"]["faulted"]
            advice = "emergency stop: live page; NEXT prepares another trial"
            await client.until(lambda: client.latest["state"]["text"] == advice)
            await client.answer("repeat")
            await client.until(client.is_in("ready"))
            await client.send("choose", specimen="medium")  # the trial that waits begins again
            await client.until(lambda: client.latest["trial"]["specimen"] == "medium cube")
            await client.until(client.is_in("ready"))

    command = start("run", "--live", "--duration", "30")
    run(scenario(command))
    code, _, err = command.end()
    assert code == 130
    assert "emergency stop: live page" in err
    recordings = sorted(command.folder.rglob("*.mcap"), key=os.path.getmtime)
    assert [load(path).session["specimen"] for path in recordings[:2]] == ["soft cube", "hard cube"]
    assert load(recordings[1]).session["notes"] == "second <b>trial</b>"


@pytest.mark.parametrize("pause", [0.0, 0.2])
def test_of_two_choices_in_quick_succession_the_later_one_counts(start, pause):
    async def scenario(command):
        async with command.page() as client, beating(client):
            await client.until(client.is_in("ready"))
            await client.until(lambda: client.latest["state"]["control"] == "you")
            for cube in ("soft", "hard"):
                await client.send("choose", condition="mimic", specimen=cube)
                await client.receive_for(pause)
            is_hard = lambda: client.latest["trial"]["choice"]["specimen"] == "hard"  # noqa: E731
            await client.until(is_hard, 10.0)
            await arm(client)
            assert is_hard()
            assert client.errors == []

    command = start("run", "--live", "--cube", "medium")
    run(scenario(command))
    command.end()


def test_a_page_that_closes_stops_the_trial_that_it_armed(start):
    async def scenario(command):
        async with command.page() as watching:
            async with command.page() as client, beating(client):
                await arm(client)
            await watching.until(watching.is_in("fault"))
            text = "the page has confirmed no data of the last 1 s"
            assert text in watching.latest["state"]["text"]

    command = start("run", "--live", "--duration", "20", "--record", "one.mcap")
    run(scenario(command))
    assert command.end(None)[0] == 3
    recording = load(command.folder / "one.mcap")
    assert recording.fault["fault"] == "live page lost"
    speeds = recording["commanded_slave_velocity"]
    fault = np.flatnonzero(recording["mode"] == 5)[0]
    assert abs(speeds[fault + 80]) == 0.0


def test_a_page_behind_a_slow_connection_can_stop_but_not_arm(start):
    async def scenario(command):
        delay = Delay()
        async with (
            delay.before(command.address) as proxy,
            command.page(through=proxy) as client,
            beating(client),
        ):
            await client.until(client.is_in("ready"))
            delay.seconds = 0.4
            await client.receive_for(1.5)
            for kind in ("unlock", "start"):
                client.errors.clear()
                await client.send(kind)
                await client.until(lambda: client.errors)
                assert re.fullmatch(
                    rf"{kind}: the connection .* too slow .*: round trip (0.8|0.9|1.\d) s, "
                    "expected at most 0.3 s",
                    client.errors[0],
                )
            assert client.is_in("ready")()
            delay.seconds = 0.0
            await client.receive_for(0.9)
            await arm(client)
            await client.send("stop")
            await client.until(client.is_in("fault"))

    command = start("run", "--live", "--duration", "20", "--record", "one.mcap")
    run(scenario(command))
    assert command.end(None)[0] == 3
    assert load(command.folder / "one.mcap").fault["fault"] == "emergency stop"


def test_a_connection_that_becomes_slow_stops_the_trial_and_the_hand_lets_go_before(start):
    async def scenario(command):
        delay = Delay()
        async with (
            delay.before(command.address) as proxy,
            command.page(through=proxy) as client,
            beating(client),
        ):
            await arm(client)
            for step in range(200):
                delay.seconds = 0.02 * step  # without a time in which nothing arrives
                await client.send("pointer", depth=0.006, grip=True)
                await client.receive_for(0.05)
                if client.is_in("fault")():
                    return
            raise AssertionError("the trial was not stopped")

    command = start(
        *("run", "--live", "--operator", "pointer", "--duration", "20", "--record", "one.mcap")
    )
    run(scenario(command))
    assert command.end(None)[0] == 3
    recording = load(command.folder / "one.mcap")
    assert recording.fault["fault"] == "live page lost"
    assert "confirmed no data of the last 1 s" in recording.fault["text"]
    held = recording["time"][recording["pointer_grip"] == 1.0]
    fault = recording["time"][np.flatnonzero(recording["mode"] == 5)[0]]
    assert len(held) > 10
    assert held[-1] < fault - 0.3
    assert not recording["pointer_grip"][recording["mode"] == 5].any()


def test_a_live_process_that_hangs_ends_the_trial_that_the_page_armed(start):
    async def scenario(command):
        async with command.page() as client, beating(client):
            await arm(client)
            os.kill(command.live_process, signal.SIGSTOP)
            await asyncio.sleep(0.1)

    command = start("run", "--live", "--duration", "2", "--record", "one.mcap")
    with contextlib.suppress(Exception):  # the connection is lost
        run(scenario(command))
    code, _, err = command.end(None)
    recording = load(command.folder / "one.mcap")
    assert len(recording.gaps) == 0
    assert code == 3, err
    assert "the live process was silent for 0.3 s" in recording.fault["text"]


def test_a_command_ends_if_its_live_process_hangs_or_dies_before_the_trial_is_armed(start):
    async def scenario(command, number):
        async with command.page() as client, beating(client):
            await client.until(client.is_in("ready"))
            os.kill(command.live_process, number)
            await asyncio.sleep(0.1)

    commands = [start("run", "--live", "--record", f"{name}.mcap") for name in ("stop", "kill")]
    for command, number in zip(commands, (signal.SIGSTOP, signal.SIGKILL), strict=True):
        with contextlib.suppress(Exception):  # the connection is lost
            run(scenario(command, number))
    hanging, dead = commands
    assert hanging.end(signal.SIGTERM)[0] in (0, 130)
    assert dead.end(None)[0] in (0, 130)


@pytest.mark.parametrize("lost", ["page", "live process"])
def test_the_hand_lets_go_and_the_trial_goes_on_if_the_page_or_the_live_process_is_lost(
    start, lost
):
    async def scenario(command):
        async with command.page() as client:
            await client.send("control")
            await client.until(client.is_in("active"))
            assert client.latest["welcome"]["pointer"]
            async with beating(client):
                for _ in range(30):
                    await client.send("pointer", depth=0.008, grip=True)
                    await client.receive_for(0.02)
                if lost == "page":
                    client.connection.transport.abort()
                else:
                    os.kill(command.live_process, signal.SIGKILL)
                await asyncio.sleep(0.1)

    command = start(
        *("run", "--live", "--operator", "pointer", "--yes", "--duration", "3"),
        *("--record", "one.mcap"),
    )
    with contextlib.suppress(Exception):  # the connection is lost
        run(scenario(command))
    code, _, err = command.end(None)
    assert code == 0, err
    recording = load(command.folder / "one.mcap")
    assert recording.fault is None
    active = recording["time"][recording["mode"] == 3]
    assert active[-1] == pytest.approx(3.0, abs=0.05)
    grip = recording["pointer_grip"]
    held = np.flatnonzero(grip == 1.0)
    assert len(held)
    assert recording["contact_force"][held[-1]] > 1.0
    assert not grip[held[-1] + 1 :].any()
    after = recording["master_force"][held[-1] + 4 :]
    assert len(after) > 20
    assert np.abs(after).max() < 0.3
    assert len(recording.gaps) == 0


def test_if_the_command_is_killed_the_loop_is_gone_and_no_shared_memory_is_left(start):
    async def scenario(command):
        async with command.page() as client:
            await client.until(client.is_in("active"))
            command.process.kill()
            await client.until(lambda: client.latest["state"]["loop"] == "gone")

    command = start("run", "--live", "--yes", "--duration", "20", "--no-record")
    shared = command.shared_files
    assert len(shared) == 3
    run(scenario(command))
    assert not any(file.exists() for file in shared)


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="needs /proc")
def test_the_foxglove_server_has_a_process_of_its_own_with_a_low_priority(start):
    async def scenario(command):
        async with command.page() as client:
            await client.until(client.is_in("active"))
            assert "_foxglove" not in Path(f"/proc/{command.live_process}/maps").read_text()
            viewers = command.child(b"teleop.live.foxglove_process")
            own, other = (
                os.getpriority(os.PRIO_PROCESS, one) for one in (command.live_process, viewers)
            )
            assert other > own
            os.kill(viewers, signal.SIGKILL)  # the trial does not need it
            await client.receive_for(0.5)
            assert client.is_in("active")()

    command = start("run", "--live", "--foxglove", "--yes", "--duration", "20", "--no-record")
    run(scenario(command))
    assert command.end()[0] == 130


PLAN = """
name = "two"
order = "listed"
[factors]
cube = ["soft", "hard"]
[settings]
live = true
rate_hz = 100.0
duration_s = 0.5
estimators = ["rls"]
"""


def test_a_series_is_run_from_the_page_and_an_answer_sent_twice_answers_one_question(
    start, tmp_path
):
    (tmp_path / "plan.toml").write_text(PLAN.replace('"hard"', '"medium", "hard"'))

    async def scenario(command):
        async with command.page() as client, beating(client):

            async def answer_twice(kind, question):
                await client.answer(kind, question)
                await client.send(kind, prompt=client.prompt["number"])

            await answer_twice("skip", "trial 1 of 3")
            for is_repeated in (False, True):
                if is_repeated:
                    await answer_twice("repeat", "trial 3 of 3")
                await answer_twice("next", "trial 2 of 3")
                await arm(client)
                assert client.latest["trial"]["series"] == {"position": 2, "of": 3}
                await client.answer("notes", "Note on trial 2", text="touched at an edge")
            await client.until(lambda: "trial 3 of 3" in client.latest["state"]["text"])
            number = client.prompt["number"]
            for _ in range(10):  # the question remains, and no trial begins
                await client.send("next", prompt=number - 1)
                await client.until(lambda: client.latest.pop("error", None))
            assert client.prompt["number"] == number
            await client.answer("skip")

    command = start("series", "plan.toml", "--out", "three")
    run(scenario(command))
    code, out, err = command.end(None)
    assert code == 0, err
    assert "1 of 3 trials done, 2 skipped" in out
    entries = Journal(tmp_path / "three").entries[1:]
    run_once = [("started", 2), ("done", 2), ("note", 2)]
    expected = [("skipped", 1), *run_once, *run_once, ("skipped", 3)]
    assert [(e["entry"], e["trial"]) for e in entries] == expected
    assert "touched at an edge" in (tmp_path / "three" / "trials.csv").read_text()


@pytest.mark.parametrize(
    ("when", "number"),
    [
        ("first question", signal.SIGTERM),
        ("before START", signal.SIGINT),
        ("trial", signal.SIGTERM),
    ],
)
def test_a_signal_ends_a_series_and_its_live_process_wherever_it_waits(
    start, tmp_path, when, number
):
    (tmp_path / "plan.toml").write_text(PLAN.replace("duration_s = 0.5", "duration_s = 30.0"))

    async def scenario(command):
        async with command.page() as client, beating(client):
            await client.until(lambda: client.prompt)
            if when != "first question":
                await client.answer("next", "trial 1 of 2")
                await client.until(client.is_in("ready"))
            if when == "trial":
                await arm(client)
            command.process.send_signal(number)
            await client.until(lambda: client.latest["state"]["loop"] == "gone")

    command = start("series", "plan.toml", "--out", "two")
    run(scenario(command))
    code, out, err = command.end(None)
    assert code == 130, err
    assert "two: 0 of 2 trials done, 0 skipped, 2 pending" in out
    with locked(tmp_path / "two"):
        last = Journal(tmp_path / "two").last(1)
    assert (last and last["entry"]) == (None if when == "first question" else "spoilt")


def test_one_ctrl_c_ends_the_trial_of_a_series_and_another_one_ends_the_series(start, tmp_path):
    (tmp_path / "plan.toml").write_text(PLAN.replace("duration_s = 0.5", "duration_s = 30.0"))

    async def scenario(command):
        async with command.page() as client, beating(client):
            await client.answer("next", "trial 1 of 2")
            await arm(client)
            command.process.send_signal(signal.SIGINT)
            await client.until(lambda: "Note on trial 1" in client.latest["state"]["text"])
            command.process.send_signal(signal.SIGINT)
            await client.until(lambda: client.latest["state"]["loop"] == "gone")

    command = start("series", "plan.toml", "--out", "two")
    run(scenario(command))
    code, out, err = command.end(None)
    assert code == 130
    assert "interrupted; the same trial is next" in err
    assert "0 of 2 trials done, 0 skipped, 2 pending" in out
