"""What a trial on a hardware rig must state, and how a person arms it."""

from __future__ import annotations

import contextlib
import io
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.rig_file import read_rig_file
from drivers.wired_rig import WiredRig
from sim_backend import CUBES, SimulatedRig
from teleop.cli import main
from teleop.commands.series import note_of_person
from teleop.control.excitation_signals import Sine
from teleop.errors import InputError
from teleop.settings.configuration import read_configuration
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.arming import arming_text, is_armed
from teleop.trial.run import run_trial

from ...forked_command import start_command

BOARD = Path(__file__).parents[3] / "rigs" / "serial-board.toml"
STATED = ("--specimen", "liver", "--depth", "3mm")


def wired(**settings):
    return TrialSettings(rig=read_rig_file(BOARD), **settings)


@pytest.fixture
def unopened(monkeypatch):
    """Fail if a rig is opened."""
    monkeypatch.setattr("drivers.wired_rig.WiredRig.open", lambda self: pytest.fail("opened"))


@pytest.fixture
def terminal(monkeypatch):
    """Return a function that makes standard input a terminal on which a line is typed."""
    pty = pytest.importorskip("pty", reason="needs a pseudo-terminal")
    leader, follower = pty.openpty()

    def type_after_the_prompt(line):
        file = os.fdopen(follower, closefd=False)
        monkeypatch.setattr("sys.stdin", file)
        monkeypatch.setattr("teleop.trial.arming.is_foreground", lambda: True)
        monkeypatch.setattr("sys.stderr", Typist(leader, line))
        return leader

    yield type_after_the_prompt
    os.close(leader)
    os.close(follower)


class Typist(io.StringIO):
    """Standard error whose reader types a line when the prompt is shown."""

    def __init__(self, leader, line):
        super().__init__()
        self.leader, self.line = leader, line

    def write(self, text):
        if "Enter arms" in text or "Enter for no note" in text:
            os.write(self.leader, self.line)
        return super().write(text)


@pytest.mark.parametrize(
    ("stated", "missing"),
    [
        ((), ("--specimen NAME", "--depth 3mm")),
        (("--specimen", "liver"), ("--depth 3mm",)),
        (("--depth", "3mm"), ("--specimen NAME",)),
    ],
)
def test_a_run_on_a_rig_without_specimen_or_depth_is_refused_in_one_line(
    refused, unopened, stated, missing
):
    line = refused("run", "--rig", BOARD, "--yes", *stated)
    for option in ("--specimen NAME", "--depth 3mm"):
        assert (option in line) == (option in missing)


def test_a_trial_started_from_python_has_to_state_them_too(unopened):
    with pytest.raises(InputError, match="expected also a specimen"):
        run_trial(wired(depth=3e-3))


def test_a_cube_on_a_rig_of_devices_is_refused(refused, unopened):
    line = refused("run", "--rig", BOARD, *STATED, "--cube", "soft", "--yes")
    assert "--cube: belongs to the simulated rig" in line


def test_a_depth_beyond_the_soft_limit_of_the_rig_is_refused(refused, unopened):
    line = refused("run", "--rig", BOARD, "--specimen", "liver", "--depth", "26mm", "--yes")
    assert "depth 26 mm: expected at most 25 mm" in line
    assert wired(depth=25e-3).depth == 25e-3


def test_the_adaptation_gain_follows_the_depth_and_not_a_cube():
    soft = TrialSettings(cube="soft").estimation_preset.adaptation_gain
    as_soft = wired(depth=TrialSettings().setup.depth).estimation_preset.adaptation_gain
    assert as_soft == soft
    half = wired(depth=0.5 * TrialSettings().setup.depth, cube="hard")
    assert half.estimation_preset.adaptation_gain == pytest.approx([4.0 * g for g in soft])


def test_without_a_terminal_the_drives_are_not_armed(refused, unopened, monkeypatch):
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert "expected --yes" in refused("run", "--rig", BOARD, *STATED)


@pytest.mark.parametrize(("line", "armed"), [(b"\n", True), (b"n\n", False), (b" \n", False)])
def test_enter_alone_arms_the_drives(terminal, line, armed):
    terminal(line)
    assert is_armed(read_rig_file(BOARD), "moves") == armed


def test_a_key_typed_before_the_prompt_does_not_arm(terminal):
    leader = terminal(b"no\n")
    os.write(leader, b"\n")
    assert not is_armed(read_rig_file(BOARD), "moves")


def test_a_line_typed_before_the_question_for_a_note_is_not_the_note(terminal):
    leader = terminal(b"a note\n")
    os.write(leader, b"typed too early\n")
    assert note_of_person(SimpleNamespace(number=1, label="soft-1")) == "a note"


def test_a_refusal_ends_the_command_before_the_rig_is_opened(terminal, unopened, tmp_path):
    terminal(b"no\n")
    record = tmp_path / "a.mcap"
    assert main(["run", "--rig", str(BOARD), *STATED, "--record", str(record)]) == 130
    assert "not armed: nothing was moved" in sys.stderr.getvalue()
    assert not record.exists()


MOVING = [("check", BOARD, "--move"), ("tare", "--rig", BOARD, "--contact", "touch")]


@pytest.mark.parametrize("command", MOVING, ids=["check", "tare"])
def test_other_commands_that_move_a_rig_need_a_person_or_yes_too(
    refused, monkeypatch, command, tmp_path
):
    monkeypatch.chdir(tmp_path)
    opened = "port /dev/ttyACM0 cannot be opened"
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert "expected --yes" in refused("rig", *command)
    assert opened in refused("rig", *command, "--yes")


@pytest.mark.parametrize("command", MOVING, ids=["check", "tare"])
def test_a_refusal_ends_them_before_the_rig_is_opened(
    terminal, unopened, monkeypatch, command, tmp_path
):
    monkeypatch.chdir(tmp_path)
    terminal(b"no\n")
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["rig", *map(str, command)]) == 130
    shown = sys.stderr.getvalue()
    for part in ("serial board: ", "stop at", "Ctrl-C", "not armed: nothing was moved"):
        assert part in " ".join(shown.split())
    assert max(map(len, shown.splitlines())) <= 80
    assert not [*tmp_path.iterdir()]


def test_the_prompt_states_what_will_happen_and_how_to_stop():
    text = " ".join(arming_text(wired(condition="mimic", specimen="liver", depth=3e-3)).split())
    for part in ("serial board", "mimic", "liver", "3 mm", "200 N", "Ctrl-C"):
        assert part in text


def test_a_configuration_of_a_rig_names_no_cube(tmp_path):
    path = tmp_path / "trial.toml"
    path.write_text(f'rig = "{BOARD}"\ncube = "hard"\n')
    with pytest.raises(InputError, match="cube: belongs to the simulated rig"):
        read_configuration(path)


def test_a_rig_file_may_have_a_rate_above_1_khz(tmp_path, capsys):
    path = tmp_path / "fast.toml"
    path.write_text(BOARD.read_text().replace("rate_hz = 1000", "rate_hz = 2000", 1))
    assert read_rig_file(path).sections.rate_hz == 2000.0
    assert main(["run", "--rig", str(path), *STATED, "--yes"]) == 2
    said, line = capsys.readouterr().err.splitlines()
    assert said.startswith("teleop: 2000 Hz: this computer can")
    assert "port /dev/ttyACM0 cannot be opened" in line


@pytest.mark.parametrize(
    ("keys", "code", "shown"),
    [
        (b"\x03", 130, b""),
        (b"\n", 2, b"port /dev/ttyACM0 cannot be opened"),
    ],
)
def test_the_answer_in_a_terminal_decides_whether_the_rig_is_opened(keys, code, shown, tmp_path):
    pytest.importorskip("pty", reason="needs a pseudo-terminal")
    terminal, follower = os.openpty()
    command = start_command("run", "--rig", BOARD, *STATED, terminal=follower, cwd=tmp_path)
    os.close(follower)
    text, answered = b"", False
    with contextlib.suppress(OSError):
        while chunk := os.read(terminal, 4096):
            text += chunk
            if b"any other answer ends." in text and not answered:
                answered = True
                os.write(terminal, keys)
    os.close(terminal)
    assert command.wait() == code
    assert shown in text
    assert (b"cannot be opened" in text) == (code == 2)
    assert not [*tmp_path.rglob("*.mcap")]


def test_a_mimic_trial_on_a_rig_is_longer_than_its_count_in():
    stated = {"specimen": "liver", "depth": 3e-3, "signal": Sine(1.0)}
    with pytest.raises(InputError, match="duration 4 s: expected count-in and two periods .* 5 s"):
        wired(condition="mimic", duration=4.0, **stated)
    wired(condition="mimic", duration=5.0, **stated)


@pytest.mark.parametrize("arm", ["no", "False", 1, [False], float("nan")], ids=repr)
def test_only_true_arms_a_hardware_rig(unopened, arm):
    with pytest.raises(InputError, match="expected arm=True"):
        run_trial(wired(specimen="liver", depth=3e-3), arm=arm)


def test_a_class_derived_from_the_simulated_rig_can_have_real_drives(unopened):
    class Wrapped(SimulatedRig):
        def __init__(self, now):
            super().__init__(CUBES["soft"], now)
            self.drives = WiredRig(read_rig_file(BOARD), now)

        def open(self):
            self.drives.open()

    with pytest.raises(InputError, match="nobody has armed the drives"):
        run_trial(TrialSettings(clock="virtual"), rig_maker=Wrapped)
