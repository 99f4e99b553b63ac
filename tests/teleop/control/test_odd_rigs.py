"""Rigs and conditions of other packages that return invalid values or raise exceptions."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers import Ages, Command, RigError
from sim_backend import SimulatedRig
from teleop.control.conditions import Condition
from teleop.safety import Fault, Mode
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.run import run_trial

AT = 300
"""Number of the first faulty call of the rig or the condition; the drives move then."""


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    """Shorten the time that a trial records after a fault."""
    monkeypatch.setattr("teleop.trial.loop.AFTER", 0.2)


class OddRig(SimulatedRig):
    """The simulated rig, one of whose calls is replaced from call `AT` on."""

    odd: tuple[str, Any] = ("", None)

    def attempt(self, name: str, call: Any, *arguments: Any) -> Any:
        self.calls = getattr(self, "calls", {})
        self.calls[name] = self.calls.get(name, 0) + 1
        answer = call(*arguments)
        if name == self.odd[0] and self.calls[name] >= AT:
            return self.odd[1](answer)
        return answer

    def read(self):
        return self.attempt("read", super().read)

    def idle(self):
        # number of the read at the first call; the call at the end comes 200 reads later
        self.idled = min(getattr(self, "idled", math.inf), self.calls["read"])
        return super().idle()

    def write(self, command):
        return self.attempt("write", super().write, command)


class Odd(Condition):
    """A constant force whose value or `finished` is replaced from call `AT` on."""

    def __init__(self, **odd: Any) -> None:
        self._odd, self._calls = odd, itertools.count()

    def drive_force(self, t, measurement):
        late = next(self._calls) >= AT
        if late and "finished" in self._odd:
            self.finished = self._odd["finished"]
        return self._odd["force"] if late and "force" in self._odd else 0.5


SETTINGS = TrialSettings(condition="autonomous", clock="virtual", duration=1.0, estimators=("rls",))


class OddTrial:
    """A trial with a faulty rig or a faulty condition."""

    def __init__(self, odd: tuple[str, Any] = ("", None), other: Condition | None = None) -> None:
        self.odd, self.other = odd, other
        self.rigs: list[OddRig] = []

    def make_rig(self, now):
        rig = make_simulated_rig(SETTINGS, now)
        rig.__class__ = OddRig
        rig.odd = self.odd
        self.rigs.append(rig)
        return rig

    def run(self, path: Path | None = None):
        return run_trial(SETTINGS, path, condition=self.other, rig_maker=self.make_rig, arm=True)


def raising(error: BaseException) -> Any:
    def fail(answer: Any) -> Any:
        raise error

    return fail


class Unprintable(Exception):
    def __str__(self) -> str:
        raise ValueError("no text")


ANSWERS = {
    "read None": ("read", lambda m: None),
    "read a force of None": ("read", lambda m: m._replace(contact_force=None)),
    "read text": ("read", lambda m: m._replace(slave_position="0.1")),
    "read an array": ("read", lambda m: m._replace(slave_position=np.array([0.1, 0.2]))),
    "read few ages": ("read", lambda m: m._replace(age=m.age[:3])),
    "read no ages": ("read", lambda m: m._replace(age=None)),
    "read a stop that is an array": ("read", lambda m: m._replace(emergency_stop=np.zeros(2))),
    "write None": ("write", lambda c: None),
    "write three": ("write", lambda c: (0.0, 0.0, 0.0)),
    "write text": ("write", lambda c: ("0", "0")),
    "read unprintable error": ("read", raising(Unprintable())),
    "write unprintable error": ("write", raising(Unprintable())),
    "read exits": ("read", raising(SystemExit(0))),
    "write exits": ("write", raising(SystemExit(0))),
    "read ends a generator": ("read", raising(GeneratorExit())),
}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("odd", ANSWERS.values(), ids=ANSWERS)
def test_an_invalid_return_value_of_a_rig_stops_the_drives_and_is_reported(odd, tmp_path):
    made = OddTrial(odd=odd)
    path = tmp_path / "odd.mcap"
    with pytest.raises(Exception) as raised:  # noqa: PT011
        made.run(path)
    assert "The drives were stopped." in "".join(raised.value.__notes__)
    assert AT <= made.rigs[0].idled < AT + 100
    assert "rig failure" in (tmp_path / "odd.fault" / "cause.txt").read_text()


@pytest.mark.parametrize(
    "odd",
    [
        ("read", lambda m: m._replace(time=math.nan)),
        ("read", lambda m: m._replace(time=math.inf)),
        ("write", lambda c: Command(math.nan, 0.0)),
        ("write", lambda c: Command(0.0, -math.inf)),
    ],
)
def test_a_return_value_that_is_not_finite_is_a_rig_failure(odd):
    trial = OddTrial(odd=odd).run()
    assert trial.fault["fault"] == Fault.RIG_FAILURE
    assert "expected" in trial.fault["text"]
    assert np.isfinite(trial.recording["time"]).all()


def test_numpy_numbers_and_integers_are_accepted():
    def numpy(m: Any) -> Any:
        single = m._replace(
            contact_force=np.float64(m.contact_force),
            age=Ages(*map(np.float64, m.age)),
            drive_error=None,
            emergency_stop=np.bool_(False),
        )
        return single._replace(age=single.age._replace(master_force=0))

    trial = OddTrial(odd=("read", numpy)).run()
    assert trial.fault is None


def test_a_drive_error_that_is_not_text_is_reported_as_text():
    trial = OddTrial(odd=("read", lambda m: m._replace(drive_error=0x8611))).run()
    assert trial.fault["text"] == f"drive error: {0x8611}"


def test_a_drive_error_has_one_line_of_bounded_length():
    long = "\x1b[2J" + "over-current\n" * 10_000
    trial = OddTrial(odd=("read", lambda m: m._replace(drive_error=long))).run()
    assert "\x1b" not in trial.fault["text"]
    assert "\n" not in trial.fault["text"]
    assert len(trial.fault["text"]) < 3000


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("force", [None, np.ones(2), 1j])
def test_a_force_that_is_not_a_number_is_a_control_failure(force, tmp_path):
    made = OddTrial(other=Odd(force=force))
    with pytest.raises(TypeError):
        made.run(tmp_path / "odd.mcap")
    assert AT <= made.rigs[0].idled < AT + 100
    assert "control failure" in (tmp_path / "odd.fault" / "cause.txt").read_text()


def test_a_condition_whose_finished_has_no_truth_value_is_a_control_failure(tmp_path):
    with pytest.raises(ValueError, match="ambiguous"):
        OddTrial(other=Odd(finished=np.zeros(2))).run(tmp_path / "odd.mcap")
    assert "control failure" in (tmp_path / "odd.fault" / "cause.txt").read_text()


def test_system_exit_in_a_condition_is_reported_as_an_error():
    class Exiting(Condition):
        def drive_force(self, t, measurement):
            raise SystemExit(0)

    with pytest.raises(RuntimeError, match="unexpected SystemExit: 0"):
        OddTrial(other=Exiting()).run()


def clock_of(name: str) -> Any:
    calls = itertools.count()

    def odd(m: Any) -> Any:
        first = next(calls) == 0
        times = {"stands still": 0.3, "jumps ahead": m.time + 1e6 * first, "restarts": m.time - 1e6}
        return m._replace(time=times[name])

    return odd


@pytest.mark.parametrize("name", ["stands still", "jumps ahead", "restarts"])
def test_a_run_ends_soon_after_a_fault_for_any_time_of_the_rig(name, monkeypatch):
    made = OddTrial(odd=("read", clock_of(name)))
    steps = itertools.count()
    step = "teleop.trial.loop.Loop.step"
    original = Loop.step

    def bounded(self):
        assert next(steps) < 2200, "the run does not end"
        return original(self)

    monkeypatch.setattr(step, bounded)
    trial = made.run()
    assert trial.recording["mode"][-1] == Mode.FAULT
    expected = {"jumps ahead": Fault.OVERRUN, "restarts": Fault.RIG_FAILURE}
    assert trial.fault["fault"] == expected.get(name, trial.fault["fault"])


def test_drives_that_never_get_ready_end_the_run_in_one_line(monkeypatch):
    monkeypatch.setattr(OddRig, "enable", lambda self: False, raising=False)
    with pytest.raises(RigError, match="the drives did not get ready: expected"):
        OddTrial().run()


def test_drives_that_cannot_be_idled_at_the_last_tick_are_a_rig_failure(monkeypatch):
    def refuse(self):
        raise RigError("no answer")

    monkeypatch.setattr(OddRig, "idle", refuse)
    trial = OddTrial().run()
    assert trial.fault
    assert trial.fault["fault"] == Fault.RIG_FAILURE
    assert "no answer" in trial.fault["text"]


@pytest.mark.parametrize("answer", [None, False, "no", np.array([1, 0])])
def test_drives_that_never_confirm_the_end_of_a_trial_are_reported(answer, monkeypatch):
    monkeypatch.setattr("teleop.trial.loop.AFTER", 1.0)
    monkeypatch.setattr(OddRig, "idle", lambda self: SimulatedRig.idle(self) and answer)
    trial = OddTrial().run()
    assert trial.fault
    assert trial.fault["fault"] == Fault.NOT_STOPPED
    assert "the drives have not confirmed within 0.5 s" in trial.stop_text


def test_drives_that_confirm_the_end_of_a_trial_late_are_no_fault(monkeypatch):
    calls = itertools.count()
    monkeypatch.setattr("teleop.trial.loop.AFTER", 1.0)
    monkeypatch.setattr(
        OddRig,
        "idle",
        lambda self: SimulatedRig.idle(self) and next(calls) > 0.3 * SETTINGS.loop_rate,
    )
    assert not OddTrial().run().fault
