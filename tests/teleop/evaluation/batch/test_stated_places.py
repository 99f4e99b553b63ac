"""The zero of the depth, and the text about a stiffness that is not determined."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from teleop.evaluation.batch.depth import zero_of_depth
from teleop.evaluation.batch.reasons import reasons_after_fit


@pytest.mark.parametrize(("free_force", "zero"), [(None, 1e-3), (0.0, 2e-3)])
def test_without_free_motion_the_depth_begins_at_the_lowest_position_of_the_record(
    free_force, zero
):
    record = SimpleNamespace(x=np.array([1e-3, 2e-3, 3e-3]))
    usable = np.array([False, True, True])
    phases = SimpleNamespace(contact_point=None, free_force=free_force, usable=usable)
    assert zero_of_depth(record, phases, SimpleNamespace(baseline_size=0.0)) == zero


@pytest.mark.parametrize(
    ("half", "text"), [(4.9e7, "15000 N/m \u00b1 more than 1000%"), (9e3, "15000 \u00b1 9000 N/m")]
)
def test_an_interval_that_excludes_nothing_is_not_printed_as_a_number(half, text):
    x = np.array([0.0, 1e-5])
    record = SimpleNamespace(x=x, v=x, f=np.array([0.0, 0.2]), clock=[0.0, 60.0])
    phases = SimpleNamespace(free_force=None, usable=slice(None))
    best = SimpleNamespace(degree=1, times=(7.0,))
    local = SimpleNamespace(k=15e3, b=0.0, b_std=1.0, r2=1.0, best=best)
    (reason,) = reasons_after_fit(record, phases, local, half)
    assert f"the stiffness is not determined: {text} (" in reason.text
    assert "models that describe it equally well do not agree on k" in reason.text
