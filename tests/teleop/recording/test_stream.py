"""Recordings that are read in blocks, and in part."""

from __future__ import annotations

import numpy as np
import pytest
from mcap.records import MessageIndex

from teleop.cli import main
from teleop.evaluation.reading.samples import is_replayed
from teleop.recording import stream
from teleop.recording.recording import load


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    path = tmp_path_factory.mktemp("trial") / "trial.mcap"
    arguments = ["--clock", "virtual", "--duration", "0.5", "--record", str(path)]
    assert main(["run", *arguments]) == 0
    return path


def test_only_the_wanted_columns_are_stored(trial):
    whole, part = load(trial), load(trial, is_replayed)
    assert set(part.columns) == {name for name in whole.columns if is_replayed(name)}
    assert len(part.columns) < len(whole.columns) / 3
    for name, column in part.columns.items():
        assert np.array_equal(column, whole[name], equal_nan=True)
    assert (part.settings, part.events, part.gaps) == (whole.settings, whole.events, whole.gaps)


def test_a_name_is_in_a_recording_if_it_has_this_column(trial):
    recording = load(trial)
    assert "contact_force" in recording
    assert "banana" not in recording


def test_blocks_of_any_size_give_the_same_recording(trial, monkeypatch):
    whole = load(trial)
    monkeypatch.setattr(stream, "BLOCK", 7)
    blocks = load(trial)
    for name, column in whole.columns.items():
        assert np.array_equal(blocks[name], column, equal_nan=True)


def test_the_indices_of_messages_are_not_parsed(trial, monkeypatch):
    def read(_):
        raise AssertionError("parsed")

    monkeypatch.setattr(MessageIndex, "read", read)
    assert len(load(trial)) > 0
