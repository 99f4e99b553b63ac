"""The output states where online estimates differ from the result, or nothing supports them."""

from __future__ import annotations

import math

from teleop.output.estimate_tables import disagreement_lines


def summary(*, identifiable=True, b=None, **k):
    result = {"identifiable": identifiable, "k": 500.0, "k_low": 490.0, "k_high": 510.0}
    result |= {"b": 8.0, "b_low": 7.8, "b_reason": ""}
    row = {"b_end": 8.5 if b is None else b, "b_interval": 3.0, "k": 500.0, "k_interval": 20.0}
    rows = {name: {"k_end": value, **row} for name, value in k.items()}
    return {"result": result, "estimates": rows}


def test_estimators_that_differ_from_the_result_are_named():
    (line,) = disagreement_lines(summary(rls=18.1, ai=540.0, me=600.0, kalman=math.nan))
    assert line == "publish the result: k of rls, me differs by >10%"


def test_a_damping_that_differs_from_the_result_is_named():
    assert disagreement_lines(summary(rls=500.0, b=3.9))
    (line,) = disagreement_lines(summary(rls=500.0, ai=500.0, b=-19.3))
    assert line == "publish the result: b of rls, ai differs by >50%"
    unresolved = summary(rls=500.0, b=-19.3)
    unresolved["result"]["b_reason"] = "damping is not resolved"
    assert not disagreement_lines(unresolved)


def test_nothing_is_stated_where_the_estimates_agree():
    assert disagreement_lines(summary(rls=495.0, ai=548.0)) == []


def test_a_record_without_a_result_supports_no_estimate():
    (line,) = disagreement_lines(summary(identifiable=False, rls=18.1))
    assert "does not support the estimates" in line
