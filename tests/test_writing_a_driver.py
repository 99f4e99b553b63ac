"""The code of docs/writing-a-driver.md works as it stands."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[1] / "docs" / "writing-a-driver.md").read_text()
PYTHON = re.findall(r"```python\n(.*?)```", PAGE, re.S)
TOML = re.findall(r"```toml\n(.*?)```", PAGE, re.S)


def block(*words: str) -> str:
    """The only block of code with all of these words."""
    (found,) = [code for code in PYTHON if all(word in code for word in words)]
    return found


@pytest.fixture
def package(tmp_path, monkeypatch):
    (tmp_path / "acme.py").write_text(block("class Acme(SerialDevice)"))
    (tmp_path / "acme_emulated.py").write_text(block("class EmulatedAcme"))
    tests = block("def test_a_frame_cut") + block("def test_the_driver_reads")
    (tmp_path / "acme_tests.py").write_text(tests)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    for name in ("acme", "acme_emulated", "acme_tests"):
        sys.modules.pop(name, None)


def test_its_tests_pass(package):
    import importlib

    module = importlib.import_module("acme_tests")
    tests = [name for name in dir(module) if name.startswith("test_")]
    assert len(tests) == 2
    for name in tests:
        getattr(module, name)()


def test_its_toml_is_toml_and_names_what_the_code_defines(package):
    documents = [tomllib.loads(code) for code in TOML]
    points = documents[0]["project"]["entry-points"]
    assert points == {
        "teleop.devices": {"acme": "acme:Acme"},
        "teleop.emulators": {"acme": "acme_emulated:EmulatedAcme"},
    }
    assert documents[1]["devices"]["tip"]["kind"] == "acme"


def test_a_registered_device_is_known_to_rig_files(package, monkeypatch):
    from importlib.metadata import EntryPoint, EntryPoints

    from drivers import registry, rig_file

    offered = EntryPoints([EntryPoint("acme", "acme:Acme", registry.GROUP)])
    monkeypatch.setattr(registry, "entry_points", lambda group: offered)
    text = (Path(__file__).parents[1] / "rigs" / "serial-board.toml").read_text()
    head, _, rest = text.partition("[channels.contact_force]")
    _, _, rest = rest.partition("[channels.master_position]")
    path = package / "rig.toml"
    path.write_text(f"{head}{TOML[1]}\n[channels.master_position]{rest}")
    assert rig_file.read_rig_file(path).devices["tip"].kind == "acme"


def test_the_other_blocks_compile():
    for code in PYTHON:
        compile(code, "writing-a-driver.md", "exec")
