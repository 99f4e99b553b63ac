"""Each measure of what the hand felt, computed again from recorded signals by other formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from sim_backend import OperatorModel
from teleop.control.admittance import AdmittanceParameters
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.evaluation.teleoperation.thresholds import LEAST_FORCE, NOTICEABLE, SETTLING
from teleop.safety.events import ACTIVE
from teleop.safety.tightened_limits import TightenedLimits
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

DEFAULT_RIG = TrialSettings(
    clock="virtual",
    duration=9.0,
    seed=52611,
    estimators=("rls",),
    operator_model=OperatorModel(400.0, 10.0),
    tightened_limits=TightenedLimits(soft_force=20.0, hard_force=40.0),
)
CASES = {
    "model-mediated": replace(
        DEFAULT_RIG,
        cube="hard",
        feedback=FeedbackSettings("model-mediated"),
        channel=ChannelSettings(0.05, 0.02, 0.05),
    ),
    "position-force": replace(
        DEFAULT_RIG,
        cube="medium",
        feedback=FeedbackSettings("position-force"),
        admittance=AdmittanceParameters(damping=50.0),
    ),
}


class Felt:
    """A trial, and the signals at the hand that are integrated from the command."""

    def __init__(self, settings):
        self.trial = run_trial(settings)
        self.measures = self.trial.feedback()
        recording = self.trial.recording
        active = recording.where(recording["mode"] == ACTIVE)
        self.active, self.law = active, settings.setup.cube
        # The virtual mass moves by the mean of two successive velocities.
        velocity = active["desired_master_velocity"]
        step = 0.5 * (velocity + np.concatenate(([0.0], velocity[:-1]))) * active["dt"]
        self.position = active["slave_position"][0] + np.cumsum(step)
        self.velocity = velocity
        self.felt = np.nan_to_num(active["displayed_force"])  # NaN before the first tick
        position, speed = self.position.tolist(), velocity.tolist()
        pairs = zip(position, speed, strict=True)
        self.tissue = np.array([self.law.force(x, v) for x, v in pairs])
        self.used = (active["time"] > SETTLING) & (np.abs(self.tissue) > LEAST_FORCE)


@pytest.fixture(scope="module", params=CASES)
def felt(request):
    return Felt(CASES[request.param])


def test_the_hand_feels_the_stiffness_of_the_tissue_of_the_simulation(felt):
    """The oracle is the law of the simulated body, and not a fit to the data of the slave."""
    x = felt.position[felt.used]
    shown, tissue = felt.felt[felt.used], felt.tissue[felt.used]
    # The mean of the force over a range of depths, instead of sums of products.
    bins = np.digitize(x, np.linspace(x.min(), x.max(), 12))
    means = [[v[bins == i].mean() for i in np.unique(bins)] for v in (shown, tissue, x)]
    k_shown, k_tissue = (np.polyfit(means[2], means[i], 1)[0] for i in (0, 1))
    assert felt.measures["rendered_k_error"] == pytest.approx(k_shown / k_tissue - 1.0, abs=0.02)
    assert abs(felt.measures["rendered_k_error"]) < 0.03


def test_the_error_of_the_felt_force_is_that_against_the_tissue_of_the_simulation(felt):
    shown, tissue = felt.felt[felt.used], felt.tissue[felt.used]
    correct = np.std(shown - tissue) ** 2 + np.mean(shown - tissue) ** 2
    expected = np.sqrt(correct / (np.std(tissue) ** 2 + np.mean(tissue) ** 2))
    assert felt.measures["felt_force_error"] == pytest.approx(expected, abs=0.015)


def test_the_felt_damping_is_the_part_of_the_force_in_phase_with_the_velocity(felt):
    """The elastic part is removed by the mean of the force at the same depth."""
    x, v, used = felt.position, felt.velocity, felt.used
    found = {}
    for name, force in (("rendered_b", felt.felt), ("tissue_b", felt.tissue)):
        elastic = np.polynomial.Polynomial.fit(x[used], force[used], 5)
        rest, speed = (
            force[used] - elastic(x[used]),
            v[used] - np.polyval(np.polyfit(x[used], v[used], 5), x[used]),
        )
        found[name] = rest @ speed / (speed @ speed)
    scale = felt.law.b + abs(found["rendered_b"])
    assert felt.measures["rendered_b"] == pytest.approx(found["rendered_b"], abs=0.25 * scale)
    assert felt.measures["tissue_b"] == pytest.approx(felt.law.b, rel=0.25)


def test_the_lowest_energy_is_the_smallest_integral_of_felt_power(felt):
    work = np.concatenate(([0.0], np.cumsum(felt.felt * felt.velocity * felt.active["dt"])))
    assert felt.measures["energy_min_j"] == pytest.approx(min(work.min(), 0.0), abs=2e-3)


def test_up_to_the_bandwidth_the_impedance_of_welch_spectra_is_that_of_the_tissue(felt):
    rate = 1.0 / float(np.mean(felt.active["dt"]))
    part = felt.active["time"] > SETTLING
    v = felt.velocity[part]
    f, felt_spectrum = signal.csd(v, felt.felt[part], rate, nperseg=2560)
    _, tissue_spectrum = signal.csd(v, felt.tissue[part], rate, nperseg=2560)
    _, power = signal.welch(v, rate, nperseg=2560)
    known = (f > 0.0) & (power > 1e-3 * power.max()) & (f <= 0.8 * felt.measures["bandwidth_hz"])
    assert known.any()
    error = np.abs(felt_spectrum - tissue_spectrum) / np.abs(tissue_spectrum)
    assert np.median(error[known]) < NOTICEABLE


def test_the_contact_force_error_compares_the_force_of_the_same_motion(felt):
    """Without a fit of the delay: the smallest difference of the two forces over all delays."""
    dt = float(np.mean(felt.active["dt"]))
    contact = felt.active["contact_force"]
    late = felt.active["time"] > SETTLING + 0.2
    errors = []
    for ticks in range(round(0.12 / dt)):
        shifted = np.concatenate((np.zeros(ticks), felt.felt[: len(felt.felt) - ticks]))
        touches = late & (np.abs(contact) > LEAST_FORCE)
        difference = (shifted - contact)[touches]
        errors.append(np.sqrt(np.mean(difference**2) / np.mean(contact[touches] ** 2)))
    assert felt.measures["contact_force_error"] == pytest.approx(min(errors), abs=0.04)
