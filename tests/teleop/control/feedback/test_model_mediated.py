"""The model that the hand feels: passive while it changes, in bounded steps, and not negative."""

from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers import Ages, Measurement
from estimation.transmission import TransmissionCalibration
from sim_backend import CUBES, Transmission
from teleop.control.admittance import Admittance, AdmittanceParameters, Environment
from teleop.control.alignment import Pair
from teleop.control.coupling import Coupling
from teleop.control.feedback.energy_tank import TANK_START
from teleop.control.feedback.law import STIFF_PRIOR, Report
from teleop.control.feedback.local_model import PERIOD, LocalModel, ModelMediatedSlave
from teleop.control.feedback.model_mediated import FORCE_RATE, ModelMediatedMaster

DT = 1e-3
MODELS = st.builds(
    Environment,
    k=st.floats(0.0, 60e3),
    k3=st.floats(0.0, 1e10),
    b=st.floats(0.0, 20.0),
)
INPUTS = st.lists(st.tuples(st.floats(-15.0, 15.0), MODELS), min_size=3, max_size=25)


def run(master, inputs, ticks=40):
    """Apply each force with each estimate for some ticks; yield the states before and after."""
    for force, model in inputs:
        for _ in range(ticks):
            admittance = master.admittance
            before = admittance.position, admittance.velocity, master.state
            master.step(force, Report(0.0, model), DT)
            yield before, (admittance.position, admittance.velocity, master.state), force


@given(INPUTS)
def test_the_hand_never_extracts_more_than_the_tank_and_the_damping_gave(inputs):
    master = ModelMediatedMaster(Admittance(AdmittanceParameters()))
    given_energy = dissipated = 0.0
    for (x, v, _), (end, fast, state), force in run(master, inputs):
        given_energy += force * (end - x)
        dissipated += 15.0 * (v * v + v * fast + fast * fast) / 3.0 * DT
        stored = 0.5 * 0.5 * fast * fast + state.model.energy(end)
        # rounding and the linearisation of k3 within a tick
        slack = 1e-5 + 0.02 * (stored + abs(given_energy))
        assert stored <= given_energy + TANK_START + slack
    assert dissipated >= 0.0


@given(INPUTS)
def test_a_change_of_the_model_changes_the_displayed_force_slowly(inputs):
    master = ModelMediatedMaster(Admittance(AdmittanceParameters()))
    for (x, v, before), (_, _, after), _ in run(master, inputs):
        jump = abs(after.model.force(x, v) - before.model.force(x, v))
        assert jump <= FORCE_RATE * DT * (1.0 + 1e-6) + 1e-9
        assert min(after.model.k, after.model.k3, after.model.b) >= 0.0
        assert after.tank >= 0.0


def test_the_model_begins_stiff_and_softening_is_free():
    master = ModelMediatedMaster(Admittance(AdmittanceParameters()))
    assert master.state.model.k == STIFF_PRIOR
    master.admittance.position = 1e-3
    tank = master.state.tank
    master.step(0.0, Report(0.0, Environment(2000.0)), DT)
    assert master.state.model.k < STIFF_PRIOR
    assert master.state.tank >= tank


def test_stiffening_in_contact_stops_when_the_tank_is_empty():
    master = ModelMediatedMaster(Admittance(AdmittanceParameters()))
    master.step(0.0, Report(0.0, Environment(1000.0)), DT)
    stiff = Environment(100e3)
    for _ in range(3000):  # the hand holds the handle still, so that nothing fills the tank
        master.admittance.position, master.admittance.velocity = 5e-3, 0.0
        master.step(master.state.model.k * 5e-3, Report(0.0, stiff), DT)
    assert master.state.model.k == pytest.approx(1000.0 + 2.0 * TANK_START / 5e-3**2, rel=0.05)


def test_a_specimen_that_is_not_glued_does_not_pull():
    master = ModelMediatedMaster(Admittance(AdmittanceParameters()), glued=False)
    master.admittance.position = -1e-3
    master.step(0.0, Report(0.0, Environment(2000.0, glued=False)), DT)
    assert master.state.displayed == 0.0


def test_the_model_is_scaled_to_the_motion_of_the_master():
    master = ModelMediatedMaster(Admittance(AdmittanceParameters()), scale=0.5, gain=2.0)
    for _ in range(100):
        master.step(0.0, Report(0.0, Environment(3000.0, 4e6, 2.0)), DT)
    model = master.state.model
    x, v = 4e-3, 0.02
    contact = Environment(3000.0, 4e6, 2.0).force(0.5 * x, 0.5 * v)
    assert model.force(x, v) == pytest.approx(2.0 * contact)


def palpate(model, cube, seconds=3.0, depth=4e-3, bias=0.0):
    for n in range(round(seconds / DT)):
        t = n * DT
        x = 0.5 * depth * (1.0 - math.cos(2.0 * math.pi * t))
        v = 0.5 * depth * 2.0 * math.pi * math.sin(2.0 * math.pi * t)
        model.update(Pair(x, cube.force(x, v) + bias * math.sin(40.0 * t), DT))


@pytest.mark.parametrize("name", ["soft", "medium", "hard"])
def test_the_local_model_has_the_stiffness_of_the_cube(name):
    model, cube = LocalModel(), CUBES[name]
    assert model.model.k == STIFF_PRIOR
    depth = {"soft": 4e-3, "medium": 2e-3, "hard": 0.4e-3}[name]
    palpate(model, cube, depth=depth)
    assert model.model.force(depth, 0.0) == pytest.approx(cube.force(depth, 0.0), rel=0.02)


def test_after_a_small_motion_the_interval_contains_the_force_of_the_hard_cube_at_more_depth():
    """The motion of 70 um shows 0.03 N of the force k3 x^3, which is 2.5 N at 0.3 mm."""
    cube, depth, deep, omega = CUBES["hard"], 70e-6, 0.3e-3, 6.0 * math.pi
    for seed in range(10):
        model, noise = LocalModel(), random.Random(seed)
        for n in range(1500):
            x = 0.5 * depth * (1.0 - math.cos(omega * n * DT))
            v = 0.5 * depth * omega * math.sin(omega * n * DT)
            model.update(Pair(x, cube.force(x, v) + noise.gauss(0.0, 0.02), DT))
        _, k, k3 = model._chosen._estimator.state.theta
        error = k * deep + k3 * deep**3 - cube.force(deep, 0.0)
        assert abs(error) < model._chosen.half_interval(deep)


def test_a_disturbance_at_the_rate_of_the_estimator_does_not_change_the_model():
    """Without the average over the period, it would be a constant force of 2 N."""
    models = LocalModel(), LocalModel()
    cube = CUBES["soft"]
    for n in range(3000):
        t = n * DT
        x = 2e-3 * (1.0 - math.cos(2.0 * math.pi * t))
        force = cube.force(x, 4e-3 * math.pi * math.sin(2.0 * math.pi * t))
        for model, size in zip(models, (0.0, 2.0), strict=True):
            disturbance = size * math.cos(2.0 * math.pi * n * DT / PERIOD)
            model.update(Pair(x, force + disturbance, DT))
    undisturbed, disturbed = (model.model.force(4e-3, 0.0) for model in models)
    assert disturbed == pytest.approx(undisturbed, rel=1e-6)


def palpate_through(model, transmission, law, seconds=4.0, depth=4e-3, start=0.0):
    """Move the encoder of the simulated transmission; the tip touches the body with this law."""
    played = 0.0
    for n in range(round(seconds / DT)):
        t = start + n * DT
        x = 0.5 * depth * (1.0 - math.cos(2.0 * math.pi * t))
        v = 0.5 * depth * 2.0 * math.pi * math.sin(2.0 * math.pi * t)
        played = transmission.play(played, x)
        tip = law.compressed(played, transmission.compliance)
        force = transmission.tip_force(law, played, tip, x, v)
        model.update(Pair(x, force, DT))


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("name", "depth"), [("soft", 4e-3), ("hard", 0.7e-3)])
def test_with_lost_motion_the_model_is_that_of_the_tissue_at_the_tip(name, depth, known):
    transmission = Transmission(120e-6, 7e-6)
    calibrated = TransmissionCalibration(lost_motion=120e-6 if known else 0.0, compliance=7e-6)
    model, cube = LocalModel(calibrated, known), CUBES[name]
    palpate_through(model, transmission, cube, depth=depth)
    assert model.half_width == pytest.approx(120e-6)
    tip = cube.compressed(depth - 120e-6, 7e-6)
    assert model.model.force(tip, 0.0) == pytest.approx(cube.force(tip, 0.0), rel=0.02)
    assert model.model.b == pytest.approx(cube.b, rel=0.4, abs=1.0)


@given(
    st.permutations(["soft", "medium", "hard"]),
    st.floats(0.0, 200e-6),
    st.floats(0.0, 1.0),
)
@settings(max_examples=15, deadline=None)
def test_two_seconds_after_a_change_of_the_body_the_model_is_that_of_the_new_one(
    names, lost, phase
):
    """In small motion, as a stiff model causes it, and in each direction."""
    transmission = Transmission(lost, 7e-6)
    model = LocalModel(TransmissionCalibration(lost_motion=lost, compliance=7e-6))
    depth = 1e-3 + lost
    before, after = CUBES[names[0]], CUBES[names[1]]
    palpate_through(model, transmission, before, 3.0 + phase, depth)
    palpate_through(model, transmission, after, 2.0, depth, start=3.0 + phase)
    tip = after.compressed(1e-3, 7e-6)
    assert model.model.force(tip, 0.0) == pytest.approx(after.force(tip, 0.0), rel=0.1)


def test_a_body_that_is_left_at_each_press_is_identified():
    model = LocalModel(glued=False)
    cube = replace(CUBES["medium"], glued=False)
    for n in range(4000):
        t = n * DT
        x = 2e-3 * math.sin(2.0 * math.pi * t)
        v = 4e-3 * math.pi * math.cos(2.0 * math.pi * t)
        model.update(Pair(x, cube.force(x, v), DT))
    assert model.model.force(2e-3, 0.0) == pytest.approx(cube.force(2e-3, 0.0), rel=0.02)


def test_on_misfit_the_model_is_the_stiff_prior_again():
    model = LocalModel()
    palpate(model, CUBES["soft"])
    assert model.model.k < 3000.0
    palpate(model, CUBES["soft"], bias=15.0)
    assert model.model.k == STIFF_PRIOR


def test_the_slave_expects_the_slope_of_its_model_once_the_force_confirms_it():
    model, cube = LocalModel(), CUBES["soft"]
    slave = ModelMediatedSlave(Coupling(), model)
    assert slave.stiffness(1e-3) == STIFF_PRIOR
    palpate(model, cube)
    slave.observe(Pair(2e-3, cube.force(2e-3, 0.0), DT))
    assert slave.stiffness(2e-3) == pytest.approx(cube.stiffness(2e-3), rel=0.05)
    slave.observe(Pair(2e-3, 2.0 * cube.force(2e-3, 0.0), DT))  # a stiffer specimen
    assert slave.stiffness(2e-3) == STIFF_PRIOR
    slave.observe(Pair(1e-4, cube.force(1e-4, 0.0), DT))  # the beginning of a contact
    assert slave.stiffness(1e-4) == STIFF_PRIOR
    at_rest = Measurement(0.0, 0.0, 0.0, 1e-3, 2.5, 0.0, Ages(*[0.0] * 5))
    assert slave.report(at_rest, DT) == Report(2.5, model.model, tip=1e-3)


@given(INPUTS, st.floats(0.002, 0.05))
def test_a_limit_of_the_master_does_not_fill_the_tank(inputs, fastest):
    admittance = Admittance(AdmittanceParameters())
    master = ModelMediatedMaster(admittance)
    dissipated = 0.0
    for force, model in inputs:
        for _ in range(40):
            start, before = admittance.position, admittance.velocity
            master.step(force, Report(0.0, model), DT)
            assert master.reserve <= TANK_START + dissipated * (1.0 + 1e-9) + 1e-12
            if abs(admittance.velocity) > fastest:
                admittance.velocity = math.copysign(fastest, admittance.velocity)
                admittance.position = start + admittance.velocity * DT
            now = admittance.velocity
            dissipated += 15.0 * (before * before + before * now + now * now) / 3.0 * DT
