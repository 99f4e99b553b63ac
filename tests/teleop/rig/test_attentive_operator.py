"""One emulated operator suits trials with any condition, in any order."""

from __future__ import annotations

import numpy as np
import pytest

from sim_backend import AttentiveOperator
from sim_backend.wire.mechanism import NEVER
from teleop.settings.ranges import COUNT_IN
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_simulated_rig
from teleop.trial.run import run_trial


def trial(condition, cube="soft", seed=1):
    """Run a trial with an operator who does not know its condition."""
    emulated = TrialSettings(condition="mimic", cube=cube, seed=seed, count_in=COUNT_IN)
    settings = TrialSettings(
        condition=condition, cube=cube, seed=seed, duration=8.0, clock="virtual", rate=500.0,
        count_in=COUNT_IN,
    )  # fmt: skip
    return run_trial(
        settings,
        rig_maker=lambda now: make_simulated_rig(emulated, now, NEVER, AttentiveOperator),
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("condition", "cube"), [("free", "soft"), ("mimic", "hard")])
def test_the_operator_palpates_in_free_and_mimic(condition, cube, seed):
    done = trial(condition, cube, seed)
    assert done.fault is None
    summary = done.summary()
    assert summary["contact_s"] > 4.0
    t, x, force = (done.columns[name] for name in ("time", "slave_position", "master_force"))
    assert x[t > 6.0].max() > 0.5 * done.settings.setup.depth
    assert summary["estimates"]["rls"]["held"] < 0.5
    assert np.std(force[t > 4.0]) > 0.1


def test_the_operator_follows_the_target_of_mimic():
    tracking = trial("mimic").tracking()
    assert tracking["gain"] == pytest.approx(1.0, abs=0.4)
    assert tracking["frequency_hz"] == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("cube", ["soft", "medium", "hard"])
def test_the_operator_lets_go_of_a_handle_that_moves_by_itself(cube):
    done = trial("autonomous", cube)
    assert done.fault is None
    force = done.columns["master_force"][done.columns["time"] > 2.0]
    assert np.std(force) < 0.1
    assert abs(np.mean(force)) < 0.1
