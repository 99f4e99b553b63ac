"""The code of docs/writing-an-estimator.md works as it stands, as a package beside this one.

tests/test_third_party.py runs every command with it.
"""

from __future__ import annotations

import sys

import pytest

from estimation import registry
from teleop.cli import main


def test_its_tests_pass(installed, third_party, estimator_page):
    with installed(third_party):
        defined = {"__name__": "tests_of_the_page"}
        exec(estimator_page.block("def test_it_keeps"), defined)
        tests = [value for name, value in defined.items() if name.startswith("test_")]
        assert len(tests) == 2
        for test in tests:
            test()


def test_all_includes_it(installed, third_party):
    with installed(third_party):
        assert registry.named_estimators("all")[-1] == "nlms"


RUN = ["run", "--clock", "virtual", "--duration", "0.6", "--no-record"]


def plugin(folder, name, code="", value="acme_broken:make", group="teleop.estimators"):
    """Write the package Acme with one entry point, whose module contains some code."""
    info = folder / "Acme-1.5.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Name: Acme\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text(f"[{group}]\n{name} = {value}\n")
    (folder / "acme_broken.py").write_text(code)
    sys.modules.pop("acme_broken", None)
    return folder


ENDS = "raise SystemExit(0)"
FACTORY = "def make(preset):\n    "


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("import no_such_module", "ModuleNotFoundError: No module named 'no_such_module'"),
        (ENDS, "cannot be loaded: SystemExit: 0"),
        ("x = 1", "cannot be loaded: AttributeError"),
        ("raise ValueError('two\\nlines')", "two lines"),
        ("class End(BaseException): pass\nraise End", "cannot be loaded: End"),
        (FACTORY + ENDS, "cannot be called: SystemExit: 0"),
        (FACTORY + "1 / 0", "cannot be called: ZeroDivisionError"),
        (FACTORY + "return 3", "returned int: expected an Estimator"),
        ("make = 3", "cannot be called: TypeError"),
    ],
)
def test_a_package_that_cannot_be_used_is_named_in_one_line(
    installed, tmp_path, capsys, code, expected
):
    with installed(plugin(tmp_path, "broken", code)):
        assert main([*RUN, "--estimators", "broken"]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.count("\n") == 1
    assert expected in error
    assert "'broken' of the package Acme 1.5: " in error


@pytest.mark.parametrize(
    ("name", "chosen"),
    [("my est", "my est"), ("a,b", "all"), ("rls", "all"), ("é", "é"), ("all", "all")],
)
def test_an_estimator_with_an_invalid_or_ambiguous_name_is_refused(
    installed, tmp_path, capsys, name, chosen
):
    with installed(plugin(tmp_path, name, ENDS)):
        assert main([*RUN, "--estimators", chosen]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert f"estimator {name!r} of the package Acme 1.5: " in error
        assert main([*RUN, "--estimators", "rls,ai"]) == 0


@pytest.mark.parametrize("clock", ["real", "virtual"])
@pytest.mark.parametrize("ending", ["SystemExit(0)", "GeneratorExit"])
def test_an_estimator_that_ends_the_program_within_a_tick_is_a_defect(
    installed, tmp_path, capfd, estimator_page, clock, ending
):
    """With exit code 0 the trial would look complete."""
    code = estimator_page.block("class Nlms")
    code += f"\ndef stopping(*arguments):\n    raise {ending}\n"
    code += "def make(preset):\n    made = nlms(preset)\n    made.advance = stopping\n"
    code += "    made.advance_all = stopping\n    return made\n"
    options = ["--estimators", "broken", "--condition", "autonomous"]
    run = [clock if word == "virtual" else word for word in RUN]
    with installed(plugin(tmp_path, "broken", code)):
        assert main([*run, *options]) == 1
    error = capfd.readouterr().err
    assert "Traceback" in error
    assert f"the estimates are not complete: {ending.partition('(')[0]}" in error


def test_code_that_ends_the_program_is_named_with_exit_code_1(monkeypatch, capsys):
    """Wherever the code of another package is called, such as in `teleop estimate`."""
    monkeypatch.setattr("teleop.trial.run.run_trial", lambda *arguments, **options: sys.exit(0))
    assert main(RUN) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "test_writing_an_estimator.py, line" in error
    assert "ended the program: SystemExit(0)" in error


@pytest.mark.parametrize(
    ("kind", "code", "expected"),
    [
        ("acme", ENDS, "acme_broken:make cannot be loaded: SystemExit: 0"),
        ("acme", "1 / 0", "cannot be loaded: ZeroDivisionError"),
        ("my kind", "make = 3", "expected a name of letters"),
        ("bota", "make = 3", "that no other package has"),
    ],
)
def test_a_device_that_cannot_be_used_is_named_in_one_line(
    installed, tmp_path, capsys, kind, code, expected
):
    rig = tmp_path / "rig.toml"
    rig.write_text(f'[devices.sensor]\nkind = "{kind}"\n')
    with installed(plugin(tmp_path, kind, code, group="teleop.devices")):
        assert main(["rig", "check", str(rig)]) == 2
    lines = capsys.readouterr().err.splitlines()
    (line,) = [line for line in lines if "devices.sensor.kind" in line]
    assert expected in line
    assert "Acme 1.5" in line
