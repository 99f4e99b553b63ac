"""Changes of the emulated palpation that a person types."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drivers import STANDSTILL
from drivers.rig_file import read_rig_file
from sim_backend.wire.mechanism import NEVER, PUT_BACK, Mechanism
from teleop.errors import InputError
from teleop.rig.emulation import Palpation, TypedLines
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_simulated_rig

BOARD = Path(__file__).parents[3] / "rigs" / "serial-board.toml"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("mimic medium", ("mimic", "medium")),
        ("hard", ("free", "hard")),
        (" autonomous\r", ("autonomous", "soft")),
    ],
)
def test_a_line_changes_what_it_names(line, expected):
    changed = Palpation(TrialSettings()).changed(line).settings
    assert (changed.condition, changed.cube) == expected


def test_a_depth_can_be_typed_and_remains_until_another_is_typed():
    palpation = Palpation(TrialSettings())
    assert palpation.text == "free, soft cube, depth 15.5 mm"
    shallow = palpation.changed("medium 4.5mm")
    assert shallow.settings.setup.depth == pytest.approx(4.5e-3)
    assert shallow.changed("mimic").text == "mimic, medium cube, depth 4.5 mm"
    with pytest.raises(InputError, match="depth 500 mm: expected"):
        palpation.changed("500mm")


@pytest.mark.parametrize("line", ["", "liver", "mimic liver", "5 mm", "mm"])
def test_a_line_with_another_word_is_refused(line):
    with pytest.raises(InputError, match=r"expected a condition \(free, mimic, autonomous, any\)"):
        Palpation(TrialSettings()).changed(line)


def test_complete_lines_are_read_without_waiting():
    output, source = os.pipe()
    typed = TypedLines(output)
    assert typed.read() == []
    os.write(source, b"mimic\nhar")
    assert typed.read() == ["mimic"]
    os.write(source, b"d\n")
    assert typed.read() == ["hard"]
    os.close(source)
    assert typed.read() == []
    os.close(output)
    assert typed.read() == []


def test_lines_are_read_from_a_terminal_that_does_not_control_the_process():
    terminal, descriptor = os.openpty()
    try:
        typed = TypedLines(descriptor)
        assert typed.read() == []
        os.write(terminal, b"free hard\n")
        assert typed.read() == ["free hard"]
    finally:
        os.close(terminal)
        os.close(descriptor)


def test_a_telemanipulator_is_exchanged_when_the_drives_are_disabled():
    now = [0.0]
    file = read_rig_file(BOARD)
    mechanism = Mechanism(file, Palpation(TrialSettings()).rig, lambda: now[0])
    hard = Palpation(TrialSettings(cube="hard")).rig
    soft = mechanism.rig.plant.slave.law
    mechanism.drive("slave", 0.0)
    mechanism.exchange(hard)
    mechanism.advance()
    assert mechanism.rig.plant.slave.law == soft
    mechanism.brake("slave")
    now[0] += 1.1 * PUT_BACK
    mechanism.advance()
    assert mechanism.rig.plant.slave.law == TrialSettings(cube="hard").setup.cube.slow
    mechanism.exchange(Palpation(TrialSettings()).rig)
    mechanism.advance()
    assert mechanism.rig.plant.slave.law == soft


def emulated_forces(seed, trials):
    """Return the force at the handle in each trial of an emulator, one list per trial."""
    now = [0.0]
    settings = TrialSettings(condition="mimic", seed=seed)
    mechanism = Mechanism(read_rig_file(BOARD), Palpation(settings).rig, lambda: now[0])
    found = []
    for _ in range(trials):
        mechanism.drive("master", 0.0)
        force = []
        for _ in range(600):
            now[0] += 2e-3
            force.append(mechanism.advance().master_force)
        found.append(force)
        mechanism.brake("master")
        now[0] += 1.1 * PUT_BACK
        mechanism.advance()
    return found


def test_each_trial_of_an_emulator_has_another_operator_and_the_order_repeats_exactly():
    first, second, third = emulated_forces(5, 3)
    assert emulated_forces(5, 3) == [first, second, third]
    for one, other in ((first, second), (second, third), (first, third)):
        difference = [a - b for a, b in zip(one, other, strict=True)]
        assert max(map(abs, difference)) > 0.3


def test_emulators_with_successive_seeds_have_no_trial_in_common():
    trials = [force for seed in range(3) for force in emulated_forces(seed, 3)]
    assert all(one != other for i, one in enumerate(trials) for other in trials[:i])


def test_the_first_trial_of_an_emulator_has_the_seed_of_the_settings():
    settings = TrialSettings(condition="mimic", seed=5)
    rig = make_simulated_rig(settings, lambda: now[0], NEVER)
    now, force = [0.0], []
    rig.open()
    rig.read()
    rig.enable()
    for _ in range(600):
        now[0] += 2e-3
        rig.write(STANDSTILL)
        force.append(rig.read().master_force)
    assert emulated_forces(5, 1) == [force]
