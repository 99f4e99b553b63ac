"""Estimates are equal to the stored reference estimates."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

SPEC = importlib.util.spec_from_file_location(
    "estimation_reference", Path(__file__).with_name("reference.py")
)
reference = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(reference)


def test_all_estimators_with_all_models_equal_the_stored_estimates():
    with np.load(reference.FILE) as file:
        expected = dict(file)
    got = {key: reference.kept(key, answer) for key, answer in reference.runs()}
    assert got.keys() >= expected.keys()  # estimators can be added
    for key, stored in expected.items():
        np.testing.assert_allclose(got[key], stored, rtol=1e-9, atol=1e-300, err_msg=key)
