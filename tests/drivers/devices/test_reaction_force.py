from __future__ import annotations

import math
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import solve_ivp

from drivers.device import NO_SAMPLE, Device, DeviceSettings, Sample
from drivers.devices.reaction_force import ReactionForceObserver, ReactionForceSettings
from drivers.rig import RigError
from drivers.rig_file import read_rig_file

MASS = 0.8
BANDWIDTH = 30.0
RATE = 2 * math.pi * BANDWIDTH


class Drive(Device):
    def __init__(self, name: str = "slave") -> None:
        super().__init__(name, DeviceSettings(kind="drive"))

    def signals(self) -> dict[str, str]:
        return {"force": "N", "velocity": "m/s"}

    def tell(self, time: float, force: float, velocity: float) -> None:
        self.samples = {"force": Sample(force, time), "velocity": Sample(velocity, time)}


class Sensor(Drive):
    def signals(self) -> dict[str, str]:
        return {"force": "N"}


def observer_of(drive: Drive, **settings: float) -> ReactionForceObserver:
    given_settings = {"moving_mass_kg": MASS, "bandwidth_hz": BANDWIDTH} | settings
    observer = ReactionForceObserver(
        "contact", ReactionForceSettings(kind="reaction_force", drive="slave", **given_settings)
    )
    observer.start({"slave": drive, "contact": observer})
    return observer


def estimates(
    times: list[float],
    force: Callable[[float], float],
    velocity: Callable[[float], float],
    **settings: float,
) -> list[float]:
    drive = Drive()
    observer = observer_of(drive, **settings)
    found = []
    for time in times:
        drive.tell(time, force(time), velocity(time))
        observer.update(time)
        found.append(observer.samples["force"].value)
    return found


@given(
    steps=st.lists(st.floats(1e-5, 0.05), min_size=1, max_size=30),
    motor=st.floats(-50, 50),
    contact=st.floats(-50, 50),
    mass=st.floats(0.0, 5.0),
)
def test_under_constant_forces_it_is_the_analytic_lag_at_any_times(steps, motor, contact, mass):
    times = list(accumulate(steps, initial=0.0))
    acceleration = (motor - contact) / mass if mass > 1e-3 else 0.0
    mass = mass if mass > 1e-3 else 0.0
    contact = contact if mass else motor
    found = estimates(times, lambda t: motor, lambda t: acceleration * t, moving_mass_kg=mass)
    exact = [contact + (motor - contact) * math.exp(-RATE * t) for t in times]
    assert found == pytest.approx(exact, rel=1e-6, abs=1e-6)


def test_a_ramp_is_delayed_by_the_lag_without_an_additional_half_sample():
    times = [n * 2e-3 for n in range(200)]
    found = estimates(times, lambda t: 100.0 * t, lambda t: 0.0)
    exact = [100.0 * (t + math.expm1(-RATE * t) / RATE) for t in times]
    assert found == pytest.approx(exact, abs=0.01)


@pytest.mark.parametrize("friction", [0.0, 1.5])
def test_follows_the_force_of_a_tissue_as_the_lag_does(friction):
    """Reference: integration of the mass on a spring and damper, and of the lag, by scipy."""
    stiffness, damping, viscous = 400.0, 5.0, 3.0

    def motor(t: float) -> float:
        return 6.0 * math.sin(2 * math.pi * 2.0 * t)

    def rubbing(v: float) -> float:
        return friction * math.tanh(v / 1e-6) + viscous * v if friction else 0.0

    def motion(t: float, state: list[float]) -> list[float]:
        x, v, lagged = state
        contact = stiffness * x + damping * v
        return [v, (motor(t) - rubbing(v) - contact) / MASS, RATE * (contact - lagged)]

    times = np.arange(0.0, 1.0, 1e-3)
    solved = solve_ivp(motion, (0.0, 1.0), [0.0] * 3, "LSODA", times, max_step=1e-3, rtol=1e-8)
    _, velocity, lagged = solved.y
    found = estimates(
        list(times),
        motor,
        lambda t: velocity[round(t * 1e3)],
        coulomb_friction_n=friction,
        viscous_friction_n_s_per_m=viscous if friction else 0.0,
    )
    error = np.array(found) - lagged
    assert np.sqrt(np.mean(error**2)) < 0.01 * np.ptp(lagged)


def test_is_that_of_murakami_yu_and_ohnishi():
    """The published form LPF(F_motor + g m v) - g m v, in small steps, gives the same force."""
    step, filtered, form = 1e-5, 0.0, []
    times = [n * step for n in range(5000)]
    for t in times:
        velocity = 0.1 * math.sin(40 * t)
        filtered += step * RATE * (math.cos(90 * t) - 1 + RATE * MASS * velocity - filtered)
        form.append(filtered - RATE * MASS * velocity)
    found = estimates(times, lambda t: math.cos(90 * t) - 1, lambda t: 0.1 * math.sin(40 * t))
    assert np.ptp(form) > 1.0
    assert found == pytest.approx(form, abs=0.01)


def test_updates_only_at_new_samples_and_has_their_time():
    drive = Drive()
    observer = observer_of(drive)
    observer.update(1.0)
    assert observer.samples["force"] is NO_SAMPLE
    drive.tell(1.0, 2.0, 0.0)
    observer.update(1.1)
    first = observer.samples["force"]
    assert first == Sample(2.0, 1.0)
    observer.update(1.2)
    assert observer.samples["force"] is first
    drive.samples["velocity"] = Sample(0.5, 1.05)
    observer.update(1.3)
    assert observer.samples["force"] is first
    drive.samples["force"] = Sample(2.0, 1.01)
    observer.update(1.4)
    assert observer.samples["force"].time == 1.01


def test_before_its_start_it_estimates_nothing():
    settings = ReactionForceSettings(
        kind="reaction_force", drive="slave", moving_mass_kg=MASS, bandwidth_hz=BANDWIDTH
    )
    observer = ReactionForceObserver("contact", settings)
    observer.update(1.0)
    assert observer.samples["force"] is NO_SAMPLE


def test_a_value_that_is_not_finite_does_not_affect_later_estimates():
    drive = Drive()
    observer = observer_of(drive)
    drive.tell(1.0, 2.0, 0.0)
    observer.update(1.0)
    drive.tell(1.001, math.nan, 0.0)
    observer.update(1.001)
    assert observer.rejected == {"not finite": 1}
    drive.tell(1.002, 2.0, 0.0)
    observer.update(1.002)
    assert observer.samples["force"] == Sample(2.0, 1.002)


def test_at_standstill_no_friction_is_subtracted():
    drive = Drive()
    observer = observer_of(drive, coulomb_friction_n=1.0)
    drive.tell(0.0, 2.0, 0.0)
    observer.update(0.0)
    assert observer.samples["force"].value == 2.0


def test_reports_its_lag_and_that_it_is_estimated():
    observer = observer_of(Drive())
    assert observer.lag == pytest.approx(1 / (2 * math.pi * 30))
    assert observer.estimated
    assert observer.signals() == {"force": "N"}


@pytest.mark.parametrize("devices", [{}, {"slave": Sensor()}, {"other": Drive("other")}])
def test_a_drive_without_force_or_velocity_is_refused(devices):
    observer = observer_of(Drive())
    with pytest.raises(RigError, match="contact: drive 'slave': expected a device with"):
        observer.start(devices)


@pytest.mark.parametrize(
    "wrong", [{"bandwidth_hz": 0.0}, {"moving_mass_kg": -1.0}, {"coulomb_friction_n": math.nan}]
)
def test_invalid_settings_are_refused(wrong):
    right = {"drive": "slave", "moving_mass_kg": 1.0, "bandwidth_hz": 30.0}
    with pytest.raises(ValidationError):
        ReactionForceSettings(kind="reaction_force", **right | wrong)


def test_the_example_rig_is_as_expected_and_gives_the_lag():
    rig = read_rig_file(Path(__file__).parents[3] / "rigs" / "odrive-reaction-force.toml")
    observer = rig.make_devices()["contact"]
    assert isinstance(observer, ReactionForceObserver)
    lag = rig.sections.channels.contact_force.lag_ms * 1e-3
    assert lag == pytest.approx(observer.lag, rel=0.01)
