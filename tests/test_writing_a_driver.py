"""The code of docs/writing-a-driver.md works as it stands."""

from __future__ import annotations

import importlib
import re
import sys
import tomllib
from pathlib import Path

import pytest

from drivers import registry
from drivers.testing import PAGE, RULES
from teleop.rig.new_driver import write_driver

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """The packages that the commands of the page write, by the name of the device."""
    folder = tmp_path_factory.mktemp("page")
    write_driver("acme_ft", "udp", "none", folder / "acme_ft")
    write_driver("acme_motor", "can", "force", folder / "acme_motor")
    return folder


@pytest.fixture
def on_the_path(packages, monkeypatch):
    """Install the packages."""
    for name in ("acme_ft", "acme_motor"):
        info = packages / name / f"{name}-0.1.dist-info"
        info.mkdir(exist_ok=True)
        (info / "METADATA").write_text(f"Name: {name}\nVersion: 0.1\n")
        points = tomllib.loads((packages / name / "pyproject.toml").read_text())["project"]
        lines = []
        for group, found in points["entry-points"].items():
            lines += [f"[{group}]", *(f"{one} = {value}" for one, value in found.items())]
        (info / "entry_points.txt").write_text("\n".join(lines))
        monkeypatch.syspath_prepend(packages / name)
    registry.offered.cache_clear()
    yield
    for name in [name for name in sys.modules if name.startswith(("acme_", "test_acme_"))]:
        del sys.modules[name]


def test_its_commands_write_the_packages_whose_code_it_shows(driver_page, packages):
    text = (ROOT / PAGE).read_text(encoding="utf-8")
    assert "$ teleop rig new-driver acme_ft --kind udp\n" in text
    assert "$ teleop rig new-driver acme_motor --kind can --drive force\n" in text
    for name in (
        "acme_ft/acme_ft.py",
        "acme_ft/acme_ft_emulated.py",
        "acme_motor/acme_motor.py",
        "acme_motor/test_acme_motor.py",
    ):
        assert (packages / name).read_text() in driver_page.python, name
    assert (packages / "acme_ft" / "pyproject.toml").read_text() in driver_page.toml


def test_its_drivers_have_less_than_80_lines(packages):
    for name in ("acme_ft", "acme_motor"):
        assert len((packages / name / f"{name}.py").read_text().splitlines()) < 80


@pytest.mark.usefixtures("on_the_path")
@pytest.mark.parametrize("name", ["acme_ft", "acme_motor"])
def test_the_tests_of_its_packages_pass(name):
    tests = vars(importlib.import_module(f"test_{name}"))
    found = [test for key, test in tests.items() if key.startswith("test_")]
    assert len(found) == (1 if name == "acme_ft" else 2)
    for test in found:
        test()


@pytest.mark.usefixtures("on_the_path")
def test_a_function_that_makes_frames_replaces_the_emulated_device(driver_page):
    namespace: dict = {}
    exec(driver_page.block("def frames(now)"), namespace)
    namespace["test_the_sensor"]()


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_that_is_checked_is_in_its_section(rule):
    text, section = RULES[rule]
    page = (ROOT / PAGE).read_text(encoding="utf-8")
    _, _, rest = page.partition(f"\n## {section}\n")
    listed = re.findall(r"^- (.*)\.$", rest.partition("\n## ")[0], re.MULTILINE)
    assert text in [one[0].lower() + one[1:] for one in listed] + listed


def test_its_toml_is_toml_and_names_what_the_code_defines(driver_page):
    documents = [tomllib.loads(code) for code in driver_page.toml]
    assert documents[0]["project"]["entry-points"] == {
        "teleop.devices": {"acme_ft": "acme_ft:AcmeFt"},
        "teleop.emulators": {"acme_ft": "acme_ft_emulated:EmulatedAcmeFt"},
    }
    assert documents[1]["devices"]["tip"]["kind"] == "acme_ft"
    assert "teleop.rigs" in documents[2]["project"]["entry-points"]


def test_a_registered_device_is_known_to_rig_files(installed, third_party, third_party_rig):
    from drivers.rig_file import read_rig_file

    with installed(third_party):
        assert read_rig_file(third_party_rig).devices["tip"].kind == "acme"


def test_the_other_blocks_compile(driver_page):
    for code in driver_page.python:
        compile(code, "writing-a-driver.md", "exec")
