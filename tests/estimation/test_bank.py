from __future__ import annotations

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from estimation import Bank, paper_preset, scaled_preset


def test_every_estimator_processes_the_same_samples(palpation):
    s = palpation(seconds=0.2, noise=0.1)
    together, alone = paper_preset("soft").bank(), paper_preset("soft").bank()
    estimates = together.run(*s)
    assert [*estimates] == ["rls", "ai", "me"]
    for name in together:
        assert np.array_equal(estimates[name][:5], alone[name].run(*s)[:5])


def test_online_and_batch_agree(palpation):
    s = palpation(seconds=0.2, noise=0.1)
    online, batch = paper_preset("soft").bank(), paper_preset("soft").bank()
    for sample in zip(*s, strict=True):
        last = online.update(*sample)
    estimates = batch.run(*s)
    expected = {name: (*(a[-1] for a in e[:5]), ()) for name, e in estimates.items()}
    assert last == expected


def test_reset_resets_every_estimator(palpation):
    bank = paper_preset("soft").bank()
    bank.run(*palpation(seconds=0.1))
    bank.reset()
    fresh = paper_preset("soft").bank()
    assert {name: e.state for name, e in bank.items()} == {
        name: e.state for name, e in fresh.items()
    }


def test_an_empty_bank_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        Bank({})


def test_the_papers_preset_has_the_papers_values():
    preset = paper_preset("hard")
    assert preset.forgetting == 0.98
    assert preset.initial_covariance == (100.0, 100.0)
    assert preset.adaptation_gain == (50_000.0, 1e7)
    assert preset.grid.candidates == 7913
    assert list(preset.grid.b.values[:3]) == [-500.0, -475.0, -450.0]
    assert list(preset.grid.k.values[-2:]) == [39_700.0, 39_900.0]
    assert preset.forgetting_rate == 10.0
    assert np.exp(-2 * preset.forgetting_rate * preset.sample_period) == pytest.approx(
        0.98, abs=3e-4
    )


def test_the_papers_gain_fits_the_cube():
    gains = {cube: paper_preset(cube).adaptation_gain for cube in ("soft", "medium", "hard")}
    assert gains == {"soft": (2e3, 1.2e5), "medium": (5e3, 5e5), "hard": (5e4, 1e7)}


def test_an_unknown_cube_is_refused():
    with pytest.raises(ValueError, match="soft, medium, hard, got 'wood'"):
        paper_preset("wood")


def test_a_changed_setting_reaches_the_estimator_and_is_checked():
    bank = replace(paper_preset(), forgetting=1.0).bank()
    assert bank["rls"].parameters.beta == 1.0
    with pytest.raises(ValueError, match="forgetting"):
        replace(paper_preset(), forgetting=1.5).bank()


@pytest.mark.parametrize("length", [1e-6, 1.0, 1e3])
@pytest.mark.parametrize("force", [1e-3, 1e4])
@pytest.mark.parametrize("pace", [0.01, 1.0, 50.0])
def test_settings_scaled_from_the_data_suit_data_of_any_size(palpation, length, force, pace):
    s = palpation(seconds=4.0)
    x, v, f, dt = s.x * length, s.v * length * pace, s.f * force, s.dt / pace
    estimates = scaled_preset(x, v, f, dt).bank().run(x, v, f, dt)
    for series in estimates.values():
        assert series.k[-1] == pytest.approx(2100.0 * force / length, rel=0.02)
    assert estimates["rls"].b[-1] == pytest.approx(20.0 * force / length / pace, rel=1e-3)


@pytest.mark.parametrize("zero", range(3))
def test_data_without_information_is_refused(palpation, zero):
    s = list(palpation(seconds=0.1))
    s[zero] = 0.0 * s[zero]
    with pytest.raises(ValueError, match="zero in all samples"):
        scaled_preset(*s)


def test_a_bad_sample_leaves_every_estimator_as_it_was():
    bank = paper_preset("soft").bank()
    bank.update(1e-3, 0.01, 2.0, 1e-3)
    before = {name: deepcopy(e.state) for name, e in bank.items()}
    for bad in ((np.nan, 0.0, 0.0, 1e-3), (0.0, 0.0, 0.0, 0.0), (0.0, 1e31, 0.0, 1e-3)):
        with pytest.raises(ValueError, match="must be finite"):
            bank.update(*bad)
    assert {name: e.state for name, e in bank.items()} == before
