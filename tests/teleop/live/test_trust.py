"""The marks of k and b: whether the estimates can be used, and why."""

from __future__ import annotations

import math

import numpy as np
import pytest

from estimation.filters import Play
from teleop.live.history import History
from teleop.live.trust import JUDGED, Trust
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.live_documents import transmission_document

PARTS = ("k", "b", "k_std", "b_std", "held", "misfit")
COLUMNS = [
    "time",
    "v",
    "k_bound",
    "b_bound",
    "contact",
    *(f"{e}_{p}" for e in ("rls", "me") for p in PARTS),
]
RIGID = {"force_lag": 0.0, "lost_motion": 0.0}
GOOD = {"k": 2000.0, "b": 20.0, "k_std": 10.0, "b_std": 1.0, "held": 0.0, "misfit": 0.01}
MOTION = {"k_bound": 0.01, "b_bound": 0.1, "contact": 1.0}


def decided(transmission=RIGID, motion=None, seconds=2.0, **of):
    """Return the decision after constant rows, in which `rls` and `me` have given values."""
    trust, history = Trust(COLUMNS, ["rls", "me"], transmission), History(len(COLUMNS))
    add(trust, history, 0.0, seconds, motion, **of)
    return trust.document


def add(trust, history, start, end, motion=None, rls=None, me=None):
    values = MOTION | (motion or {})
    for name, own in (("rls", rls), ("me", me)):
        values |= {f"{name}_{part}": value for part, value in (GOOD | (own or {})).items()}
    for t in np.arange(start, end, 4e-3):
        values |= {"time": t, "v": 0.05 * math.cos(2.0 * math.pi * t)}
        history.add(np.array([[values[name] for name in COLUMNS]]))
        if trust.is_due(t):
            trust.update(history.latest(JUDGED))


def both(**own):
    return {"rls": own, "me": own}


def test_good_estimates_can_be_used_and_the_narrowest_is_named():
    found = decided(me={"k_std": 20.0, "b_std": 0.5})
    assert found["k"] == {"mark": "can be used", "reason": "± 1.0 % (rls)"}
    assert found["b"] == {"mark": "can be used", "reason": "± 4.9 % (me)"}
    assert found["supported"] == 2 * [{"k": True, "b": True}]


@pytest.mark.parametrize(
    ("motion", "of", "mark", "reason"),
    [
        ({"k_bound": 1.2, "b_bound": 1.2}, {}, "not yet", None),
        ({"k_bound": math.nan, "b_bound": math.nan}, {}, "not yet", None),
        ({"contact": 0.0}, {}, "not yet", "no contact"),
        ({}, {"k": math.nan, "b": math.nan}, "not yet", "no estimate yet"),
        ({}, {"held": 1.0}, "not yet", "estimate held"),
        ({}, {"k_std": 300.0, "b_std": 300.0}, "not yet", None),
        ({}, {"k_std": math.inf, "b_std": math.inf}, "not yet", "interval ± >100 %"),
        ({}, {"k_std": math.nan, "b_std": math.nan}, "cannot", "no interval"),
        ({}, {"misfit": math.nan}, "not yet", "misfit not known yet"),
        ({}, {"misfit": 0.09}, "cannot", "misfit up to 9 %"),
        ({}, {"k": -2000.0, "b": -20.0}, "cannot", None),
    ],
)
def test_without_support_no_estimate_of_any_estimator_can_be_used(motion, of, mark, reason):
    found = decided(motion=motion, **both(**of))
    assert {found[part]["mark"] for part in ("k", "b")} == {mark}
    assert reason is None or {found[part]["reason"] for part in ("k", "b")} == {reason}
    assert found["supported"] == 2 * [{"k": False, "b": False}]


def test_a_motion_that_determines_k_only_leaves_b_without_support():
    found = decided(motion={"b_bound": 1.2})
    assert found["k"]["mark"] == "can be used"
    assert found["b"] == {"mark": "not yet", "reason": "motion does not determine b"}


def test_k_can_be_used_with_an_interval_of_ten_percent_and_b_with_one_of_fifty():
    assert decided(**both(k_std=100.0, b_std=5.0))["k"]["mark"] == "can be used"
    assert decided(**both(k_std=100.0, b_std=5.0))["b"]["mark"] == "can be used"
    assert decided(**both(k_std=105.0))["k"]["mark"] == "not yet"
    assert decided(**both(b_std=5.3))["b"]["mark"] == "not yet"


def test_reasons_state_the_relative_interval_and_a_negative_value():
    assert decided(**both(k_std=300.0))["k"]["reason"] == "interval ± 29 %"
    assert decided(**both(b=-20.0))["b"]["reason"] == "b is negative"


@pytest.mark.parametrize("part", ["k_std", "misfit"])
def test_an_estimate_that_was_good_for_less_than_a_second_is_not_supported(part):
    trust, history = Trust(COLUMNS, ["rls", "me"], RIGID), History(len(COLUMNS))
    add(trust, history, 0.0, 2.0, **both(**{part: 500.0}))
    add(trust, history, 2.0, 2.7)
    assert not trust.document["supported"][0]["k"]
    add(trust, history, 2.7, 4.0)
    assert trust.document["supported"][0]["k"]


def test_one_usable_estimator_suffices_and_the_others_are_not_supported():
    found = decided(rls={"misfit": 0.2, "k_std": 1.0})
    assert found["k"] == {"mark": "can be used", "reason": "± 1.0 % (me)"}
    assert [one["k"] for one in found["supported"]] == [False, True]


def test_b_cannot_be_used_if_lag_and_lost_motion_change_it_by_more_than_half():
    moving = {"force_lag": 2.66e-3, "lost_motion": 122e-6}
    found = decided(moving)
    # k (lag + lost motion mean |v| / mean v^2), and 4 / (pi V) for a sine with the speed V
    shift = 2000.0 * (2.66e-3 + 122e-6 * 4.0 / (math.pi * 0.05))
    assert found["b"] == {"mark": "cannot", "reason": f"lag, lost motion: -{shift:.0f} N s/m"}
    assert found["k"]["mark"] == "can be used"
    assert decided(moving, **both(b=3.0 * shift))["b"]["mark"] == "can be used"
    over = decided({"force_lag": -0.02, "lost_motion": 0.0})
    assert over["b"] == {"mark": "cannot", "reason": "lag: +40 N s/m"}


def test_b_cannot_be_used_if_the_lag_was_never_measured():
    found = decided(None)
    assert found["b"] == {"mark": "cannot", "reason": "force lag not measured"}
    assert found["k"]["mark"] == "can be used"


def decided_behind(play, transmission=RIGID, removed=0.0, seconds=6.0, **of):
    """Return the decision on a spring of 2000 N/m behind a play, as rows of a trial."""
    names = [*COLUMNS, "slave_position", "contact_force"]
    t = np.arange(0.0, seconds, 4e-3)
    x = 5e-3 + 3e-3 * np.sin(2.0 * np.pi * (0.5 * t + 0.2 * t**2))
    force = 2000.0 * Play(play).run(x) + np.random.default_rng(1).normal(0.0, 0.02, t.size)
    values = MOTION | {f"{e}_{part}": value for e in ("rls", "me") for part, value in GOOD.items()}
    values |= {f"{e}_{part}": value for e, own in of.items() for part, value in own.items()}
    values |= {"time": t, "v": np.gradient(x, t), "slave_position": x, "contact_force": force}
    rows = np.column_stack([np.broadcast_to(values[name], t.shape) for name in names])
    trust = Trust(names, ["rls", "me"], transmission, removed)
    trust.update(rows[-JUDGED:])
    return trust.document


def test_b_cannot_be_used_if_the_force_indicates_lost_motion():
    found = decided_behind(100e-6)
    assert found["b"] == {"mark": "cannot", "reason": "lost motion ≈ 0.1 mm"}
    assert found["k"]["mark"] == "can be used"
    assert decided_behind(0.0)["b"]["mark"] == "can be used"
    assert decided_behind(300e-6)["b"]["reason"] == "lost motion ≥ 0.2 mm"


def test_lost_motion_that_changes_an_estimate_only_within_its_interval_is_not_stated():
    wide = {"k_std": 20.0, "b": 40.0, "b_std": 9.0}
    assert decided_behind(100e-6, rls=wide, me=wide)["b"]["mark"] == "can be used"


def test_k_cannot_be_used_if_the_lost_motion_changes_it():
    soft = {"k": 100.0, "k_std": 1.0}
    found = decided_behind(200e-6, rls=soft, me=soft)
    assert found["k"] == {"mark": "cannot", "reason": "lost motion ≥ 0.2 mm"}


def test_indicated_lost_motion_is_compared_with_that_which_is_removed():
    assert decided_behind(120e-6, removed=120e-6)["b"]["mark"] == "can be used"
    found = decided_behind(50e-6, removed=150e-6)
    assert found["b"]["reason"] == "lost motion 0.05, not 0.15 mm"


def test_lost_motion_is_stated_even_if_the_lag_is_unknown_and_a_known_shift_before_it():
    assert decided_behind(100e-6, None)["b"]["reason"] == "lost motion ≈ 0.1 mm"
    assert decided_behind(0.0, None)["b"]["reason"] == "force lag not measured"
    known = decided_behind(100e-6, {"force_lag": 0.02, "lost_motion": 0.0})
    assert known["b"]["reason"] == "lag: -40 N s/m"


def test_before_the_first_row_nothing_can_be_used_and_without_estimators_there_is_no_mark():
    nothing = {"mark": "not yet", "reason": "no estimate yet"}
    before = decided(seconds=0.0)
    assert (before["k"], before["b"]) == (nothing, nothing)
    assert Trust([], [], None).document == {"supported": []}


def test_marks_change_at_most_twice_per_second_and_follow_a_replay_back_in_time():
    trust, history = Trust(COLUMNS, ["rls", "me"], RIGID), History(len(COLUMNS))
    add(trust, history, 0.0, 2.1)
    usable = trust.document
    add(trust, history, 2.1, 2.4, **both(misfit=0.5))
    assert trust.document == usable
    add(trust, history, 2.4, 2.7)
    assert trust.document["k"]["reason"] == "misfit up to 50 %"
    history.clear()
    add(trust, history, 1.0, 1.2, {"contact": 0.0})
    assert trust.document["k"]["reason"] == "no contact"


def test_lag_and_lost_motion_that_are_not_corrected_are_those_of_the_transmission():
    corrected = transmission_document(TrialSettings())
    assert corrected == {"force_lag": 0.0, "lost_motion": 0.0}
    as_measured = transmission_document(TrialSettings(force_lag=0.0, lost_motion=0.0))
    assert as_measured["force_lag"] == pytest.approx(2.66e-3, abs=1e-5)
    assert as_measured["lost_motion"] == pytest.approx(122e-6, abs=1e-6)
