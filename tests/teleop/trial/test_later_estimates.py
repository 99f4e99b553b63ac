"""Estimates computed in blocks after the ticks are those that each tick computes, to the bit."""

from dataclasses import replace

import numpy as np
import pytest
from teleop.recording.sinks import Memory
from teleop.trial.later_estimates import LaterEstimates

from estimation import MODELS, Bank
from estimation.registry import BUILT_IN
from teleop.recording.recording import from_messages, load
from teleop.settings.trial_settings import TrialSettings
from teleop.trial import later_estimates
from teleop.trial.assembly import make_clock, make_controller, make_layout, make_simulated_rig
from teleop.trial.loop import Loop
from teleop.trial.run import run_trial
from teleop.trial.stop_switch import StopSwitch

SETTINGS = TrialSettings(clock="virtual", duration=1.2)


def estimated_in_each_tick(settings):
    """Return the recording of a trial whose ticks compute the estimates."""
    clock, bank, memory = make_clock(settings), settings.estimation_preset.bank(), Memory()
    layout = make_layout(settings, bank)
    with make_simulated_rig(settings, clock.now) as rig:
        controller = make_controller(settings, rig, bank, clock)
        Loop(controller, clock, layout, [memory], StopSwitch(), settings.duration).run()
    return from_messages(layout.definition, memory.messages, memory.events, {})


@pytest.mark.parametrize(
    "changes",
    [
        {"estimators": tuple(BUILT_IN)},
        {"model": MODELS["stiffening"], "estimators": ("rls_conditional", "rls")},
        {"conditioning": "foaw", "condition": "autonomous", "rate": 400.0},
    ],
)
def test_a_block_gives_the_same_recording_as_one_tick_at_a_time(changes, monkeypatch):
    settings = replace(SETTINGS, **changes)
    expected = estimated_in_each_tick(settings)
    for block in (77, 10_000):
        monkeypatch.setattr(later_estimates, "BLOCK", block)
        got = run_trial(settings).recording
        assert np.isfinite(got["x"]).sum() > 400
        assert got.events == expected.events
        for name, column in expected.columns.items():
            np.testing.assert_array_equal(got[name], column, err_msg=f"{name}, blocks of {block}")


class Order(Memory):
    """Stores at which tick each event was received."""

    def __init__(self):
        super().__init__()
        self.ticks_at_events = []

    def event(self, event):
        self.ticks_at_events.append(self._pushed)


def test_an_event_follows_the_ticks_before_it():
    bank = SETTINGS.estimation_preset.bank()
    layout = make_layout(SETTINGS, bank)
    order = Order()
    later = LaterEstimates(SETTINGS.make_conditioner(), bank, layout, [order])
    without_pair = layout._struct.pack(b"\0\1\0\0", *[np.nan] * len(layout.columns))
    for ticks in (3, 0, 2):
        for _ in range(ticks):
            later.push(without_pair)
        later.event(None)
    assert order.ticks_at_events == [3, 3, 5]


def test_an_estimator_that_fails_in_the_last_block_is_reported_after_all_ticks(
    monkeypatch, tmp_path
):
    run, path = Bank.run, tmp_path / "a.mcap"

    def failing(bank, x, *others):
        if len(x) > 100:
            raise ZeroDivisionError("by design")
        return run(bank, x, *others)

    monkeypatch.setattr(Bank, "run", failing)
    with pytest.raises(ZeroDivisionError) as raised:
        run_trial(SETTINGS, path)
    assert "Recording: " in raised.value.__notes__[0]
    recording = load(path)
    assert recording["time"][-1] > 1.19
    assert np.isfinite(recording["paired_position"]).sum() > 1000
    assert np.isnan(recording["rls_k"][100:]).all()
