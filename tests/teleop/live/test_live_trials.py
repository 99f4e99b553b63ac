"""Trials with the live page, in real time, with the real processes."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed

from teleop.recording.recording import load
from teleop.studies.json_lines import locked
from teleop.studies.series.journal import Journal

from .live_command import arm, beating, command_case, outcomes
from .page.delay import Delay

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(os.name != "posix", reason="the live page needs POSIX"),
]

__all__ = ["outcomes"]  # a fixture
ONE = ("--record", "one.mcap")
"""Options of a command that ends after one trial."""


@contextlib.asynccontextmanager
async def controlled(command, **options):
    """Connect as a page, which takes control and sends heartbeats."""
    async with command.page(**options) as client, beating(client):
        yield client


@command_case("run", "--live", "--duration", "1", "--condition", "mimic", *ONE)
async def test_a_trial_waits_for_start_lasts_its_whole_duration_and_its_page_shows_the_recording(
    command,
):
    async with controlled(command) as client:
        await client.until(client.is_in("ready"))
        await client.until(
            lambda: client.rows is not None and len(client.rows) and client.column("time")[-1] > 1.0
        )
        await arm(client)
        armed = client.latest["state"]
        await client.until(lambda: "summary" in client.latest)
        await client.until(client.is_in("ended"))
    code, out, _ = await command.end()  # --record: one trial
    assert code == 0
    assert client.latest["welcome"]["may_arm"]
    assert armed["armed_by"] == "page"
    assert armed["armed_at"] > 1.0
    summary = client.latest["summary"]
    assert summary["shown"]["use"] in out
    assert summary["files"]["recording"].endswith("/one.mcap")
    assert "evaluating" in client.latest
    recording = load(command.folder / "one.mcap")
    active = recording["time"][recording["mode"] == 3]
    assert active[0] > 1.0
    assert active[-1] - active[0] == pytest.approx(1.0, abs=0.05)
    target, moving = client.latest["trial"]["target"], recording["mode"] == 3
    assert target["count_in"] == 0.0
    phase = 2.0 * np.pi * target["frequency"] * (active - active[0])
    depth, low = target["depth"], target["low"]
    expected = low + 0.5 * (depth - low) * (1.0 - np.cos(phase))
    assert recording["target"][moving][1:] == pytest.approx(expected[1:], rel=0.01)
    names = [column["name"] for column in client.latest["welcome"]["columns"]]
    at = np.searchsorted(recording["time"], client.rows[:, 0])
    assert len(at) > 150
    for name, column in zip(names, client.rows.T, strict=True):
        if name != "sent":
            assert np.array_equal(column, recording[name][at], equal_nan=True), name
    assert np.diff(client.rows[:, -1]).min() > 0.0
    assert client.latest["summary"]["ticks"] > 80
    health = client.latest["state"]["health"]
    assert health["skipped"] == recording["skipped"].sum()
    assert health["overruns"] == recording["overrun"].sum()


@command_case("run", "--live", "--duration", "30")
async def test_after_end_or_stop_from_any_page_next_runs_another_trial_with_other_settings(command):
    async with command.page() as other, controlled(command) as client:
        await arm(client)
        await client.send("end")
        await client.until(client.is_in("ended"))
        names = ["rls", "kalman", "passive", "window", "segments"]
        more = {"estimators": names, "feedback": "model-mediated"}
        await client.send("choose", specimen="hard", duration=5, **more)
        await client.send("choose", specimen="steel")
        await client.until(lambda: client.errors)
        await client.answer("notes", text="second <b>trial</b>")
        await client.answer("next")
        await arm(client)
        assert client.latest["trial"]["specimen"] == "hard cube"
        assert client.latest["trial"]["duration"] == 5.0
        assert client.latest["trial"]["feedback"]["law"] == "model-mediated"
        assert [one["name"] for one in client.latest["welcome"]["estimators"]] == names
        await client.send("choose", specimen="soft")
        await client.until(lambda: len(client.errors) == 2)
        assert not client.latest["state"]["faulted"]
        await other.send("stop")
        await client.until(client.is_in("fault"))
        assert client.latest["state"]["text"] == "stopped with STOP in the page"
        await client.until(client.is_in("ended"))
        assert client.latest["state"]["faulted"]
        assert client.latest["state"]["by_person"]
        await client.until(lambda: "NEXT" in client.latest["state"]["advice"])
        assert client.latest["state"]["text"] == "stopped with STOP in the page"
        await client.answer("repeat")
        await client.until(client.is_in("ready"))
        await client.send("choose", specimen="medium")  # the trial that waits begins again
        await client.until(lambda: client.latest["trial"]["specimen"] == "medium cube")
        await client.until(client.is_in("ready"))
    code, _, err = await command.end(signal.SIGTERM)
    assert code == 130
    assert "emergency stop: live page" in err
    recordings = sorted(command.folder.rglob("*.mcap"), key=os.path.getmtime)
    events = load(recordings[1]).events
    armed, stopped = (
        next(e["time"] for e in events if e["mode"] == m) for m in ("active", "fault")
    )
    assert f"stopped at {stopped - armed:.3f} s: " in err  # the time of the trial, as in the page
    assert [load(path).session["specimen"] for path in recordings[:2]] == ["soft cube", "hard cube"]
    assert load(recordings[1]).session["notes"] == "second <b>trial</b>"


@command_case("run", "--live", "--cube", "medium", "--no-record")
async def test_of_two_choices_in_quick_succession_the_later_one_counts(command):
    async with controlled(command) as client:
        await client.until(client.is_in("ready"))
        await client.until(lambda: client.latest["state"]["control"] == "you")
        chosen = lambda: client.latest["trial"]["choice"]["specimen"]  # noqa: E731
        for pause, *cubes in ((0.0, "soft", "hard"), (0.2, "medium", "soft")):
            for cube in cubes:
                await client.send("choose", condition="mimic", specimen=cube)
                await client.receive_for(pause)
            await client.until(lambda: chosen() == cubes[-1], 10.0)  # noqa: B023
            await client.until(client.is_in("ready"))
            await client.receive_for(0.3)
            assert chosen() == cubes[-1]
        await arm(client)
        assert chosen() == "soft"
        assert client.errors == []
    assert (await command.end(signal.SIGTERM))[0] == 130


@command_case("run", "--live", "--duration", "20", *ONE)
async def test_a_page_that_closes_stops_the_trial_that_it_armed(command):
    async with command.page() as watching:
        async with controlled(command) as client:
            await arm(client)
        await watching.until(watching.is_in("fault"))
        text = "the page has confirmed no data of the last 1 s"
        assert text in watching.latest["state"]["text"]
    assert (await command.end())[0] == 3
    recording = load(command.folder / "one.mcap")
    assert recording.fault["fault"] == "live page lost"
    speeds = recording["commanded_slave_velocity"]
    fault = np.flatnonzero(recording["mode"] == 5)[0]
    assert abs(speeds[fault + 80]) == 0.0


@command_case(
    *("run", "--live", "--operator", "pointer", "--duration", "20", *ONE),
)
async def test_a_connection_that_is_slow_cannot_arm_and_one_that_becomes_slow_stops_the_trial(
    command,
):
    """The hand lets go of the handle before the stop."""
    delay = Delay()
    async with (
        delay.before(command.address) as proxy,
        controlled(command, through=proxy) as client,
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
        client.errors.clear()
        await arm(client)
        for step in range(200):
            delay.seconds = 0.02 * step  # without a time in which nothing arrives
            await client.send("pointer", depth=0.006, grip=True)
            await client.receive_for(0.05)
            if client.is_in("fault")():
                break
        else:
            raise AssertionError("the trial was not stopped")
    assert (await command.end())[0] == 3
    recording = load(command.folder / "one.mcap")
    assert recording.fault["fault"] == "live page lost"
    assert "confirmed no data of the last 1 s" in recording.fault["text"]
    held = recording["time"][recording["pointer_grip"] == 1.0]
    fault = recording["time"][np.flatnonzero(recording["mode"] == 5)[0]]
    assert len(held) > 10
    assert held[-1] < fault - 0.3
    stopped = np.flatnonzero(recording["mode"] == 5)
    assert not recording["pointer_grip"][stopped].any()
    assert recording["commanded_slave_velocity"][stopped[0] + 80] == 0.0


@command_case("run", "--live", "--duration", "2", *ONE)
async def test_a_live_process_that_hangs_ends_the_trial_that_the_page_armed(command):
    with contextlib.suppress(ConnectionClosed):
        async with controlled(command) as client:
            await arm(client)
            os.kill(command.live_process, signal.SIGSTOP)
            await asyncio.sleep(0.1)
    code, _, err = await command.end()
    recording = load(command.folder / "one.mcap")
    assert len(recording.gaps) == 0
    assert code == 3, err
    assert "the live process was silent for 0.3 s" in recording.fault["text"]


async def lose_live_process_before_arming(command, number):
    with contextlib.suppress(ConnectionClosed):
        async with controlled(command) as client:
            await client.until(client.is_in("ready"))
            os.kill(command.live_process, number)
            await asyncio.sleep(0.1)


@command_case("run", "--live", *ONE)
async def test_a_command_can_be_ended_if_its_live_process_hangs_before_the_trial_is_armed(command):
    await lose_live_process_before_arming(command, signal.SIGSTOP)
    assert (await command.end(signal.SIGTERM))[0] in (0, 130)


@command_case("run", "--live", *ONE)
async def test_a_command_ends_if_its_live_process_dies_before_the_trial_is_armed(command):
    await lose_live_process_before_arming(command, signal.SIGKILL)
    assert (await command.end())[0] in (0, 130)


async def palpate(command, lose):
    """Palpate with the pointer; then lose the page or the live process."""
    with contextlib.suppress(ConnectionClosed):
        async with command.page() as client:
            await client.send("control")
            await client.until(client.is_in("active"))
            assert client.latest["welcome"]["pointer"]
            async with beating(client):
                for _ in range(30):
                    await client.send("pointer", depth=0.008, grip=True)
                    await client.receive_for(0.02)
                lose(client)
                await asyncio.sleep(0.1)
    code, _, err = await command.end()
    assert code == 0, err
    recording = load(command.folder / "one.mcap")
    assert recording.fault is None
    active = recording["time"][recording["mode"] == 3]
    assert active[-1] == pytest.approx(2.5, abs=0.05)
    grip = recording["pointer_grip"]
    held = np.flatnonzero(grip == 1.0)
    assert len(held)
    assert recording["contact_force"][held[-1]] > 1.0
    assert not grip[held[-1] + 1 :].any()
    after = recording["master_force"][held[-1] + 4 :]
    assert len(after) > 20
    assert np.abs(after).max() < 0.3
    assert len(recording.gaps) == 0


POINTER = ("run", "--live", "--operator", "pointer", "--yes", "--duration", "2.5", *ONE)


@command_case(*POINTER)
async def test_the_hand_lets_go_and_the_trial_goes_on_if_the_page_is_lost(command):
    await palpate(command, lambda client: client.connection.transport.abort())


@command_case(*POINTER)
async def test_the_hand_lets_go_and_the_trial_goes_on_if_the_live_process_is_lost(command):
    await palpate(command, lambda client: os.kill(command.live_process, signal.SIGKILL))


@command_case("run", "--live", "--yes", "--duration", "20", "--no-record")
async def test_if_the_command_is_killed_the_loop_is_gone_and_no_shared_memory_is_left(command):
    async with command.page() as client:
        await client.until(client.is_in("active"))
        shared = command.shared_files
        assert len(shared) == 5  # ticks, estimates, events, missed ticks, requests of the page
        command.process.kill()
        await client.until(lambda: client.latest["state"]["loop"] == "gone")
    end = time.monotonic() + 10.0
    while any(file.exists() for file in shared):  # the readers remove them
        assert time.monotonic() < end
        await asyncio.sleep(0.1)


FOXGLOVE = ("run", "--live", "--foxglove", "--yes", "--duration", "20", "--no-record")


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="needs /proc")
@command_case(*FOXGLOVE)
async def test_the_foxglove_server_has_a_process_of_its_own_with_a_low_priority(command):
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
    assert (await command.end(signal.SIGTERM))[0] == 130


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
LONG = PLAN.replace("duration_s = 0.5", "duration_s = 30.0")
SERIES = ("series", "plan.toml", "--out")


@command_case(*SERIES, "three", plan=PLAN.replace('"hard"', '"medium", "hard"'))
async def test_a_series_is_run_from_the_page_and_an_answer_sent_twice_answers_one_question(command):
    async with controlled(command) as client:

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
    code, out, err = await command.end()
    assert code == 0, err
    assert "1 of 3 trials done, 2 skipped" in out
    entries = Journal(command.folder / "three").entries[1:]
    run_once = [("started", 2), ("done", 2), ("note", 2)]
    expected = [("skipped", 1), *run_once, *run_once, ("skipped", 3)]
    assert [(e["entry"], e["trial"]) for e in entries] == expected
    assert "touched at an edge" in (command.folder / "three" / "trials.csv").read_text()


async def signal_series(command, when, number):
    """Send a signal to a series of long trials; return its standard error."""
    async with controlled(command) as client:
        await client.until(lambda: client.prompt)
        if when != "first question":
            await client.answer("next", "trial 1 of 2")
            await client.until(client.is_in("ready"))
        if when == "trial":
            await arm(client)
        command.process.send_signal(number)
        if when == "trial" and number == signal.SIGINT:
            await client.until(lambda: "Note on trial 1" in client.latest["state"]["text"])
            command.process.send_signal(number)
        await client.until(lambda: client.latest["state"]["loop"] == "gone")
    code, out, err = await command.end()
    assert code == 130, err
    assert "two: 0 of 2 trials done, 0 skipped, 2 pending" in out
    with locked(command.folder / "two"):
        last = Journal(command.folder / "two").last(1)
    assert (last and last["entry"]) == (None if when == "first question" else "spoilt")
    return err


@command_case(*SERIES, "two", plan=LONG)
async def test_a_signal_ends_a_series_and_its_live_process_at_the_first_question(command):
    await signal_series(command, "first question", signal.SIGTERM)


@command_case(*SERIES, "two", plan=LONG)
async def test_a_signal_ends_a_series_and_its_live_process_before_start(command):
    await signal_series(command, "before START", signal.SIGINT)


@command_case(*SERIES, "two", plan=LONG)
async def test_one_ctrl_c_ends_the_trial_of_a_series_and_another_one_ends_the_series(command):
    err = await signal_series(command, "trial", signal.SIGINT)
    assert "interrupted; the same trial is next" in err


@command_case("run", "--live", "--no-record", "--rate", "100000")
async def test_a_start_that_is_refused_is_a_message_in_the_page_which_can_try_again(command):
    async with controlled(command) as client:
        for question in (1, 2):
            await client.until(lambda: client.prompt and client.prompt["number"] == question)  # noqa: B023
            state = client.latest["state"]
            assert "a tick takes" in state["text"]
            assert state["advice"] == "NEXT prepares another trial"
            assert not state["faulted"]
            await client.answer("next")
    code, _, error = await command.end(signal.SIGTERM)
    assert code == 130
    assert error.count("a tick takes") >= 2
