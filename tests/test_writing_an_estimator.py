"""The code of docs/writing-an-estimator.md works as it stands, as a package beside this one.

tests/test_third_party.py runs every command with it.
"""

from __future__ import annotations

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


def test_a_package_that_cannot_be_imported_is_named_in_one_line(installed, tmp_path, capsys):
    (tmp_path / "broken-1.dist-info").mkdir(parents=True)
    (tmp_path / "broken-1.dist-info" / "METADATA").write_text("Name: broken\nVersion: 1\n")
    points = "[teleop.estimators]\nbroken = no_such_module:make\n"
    (tmp_path / "broken-1.dist-info" / "entry_points.txt").write_text(points)
    run = ["run", "--clock", "virtual", "--duration", "0.6", "--no-record"]
    with installed(tmp_path):
        assert main([*run, "--estimators", "broken"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "no_such_module" in error
