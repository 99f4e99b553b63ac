"""The code of docs/writing-a-driver.md works as it stands."""

from __future__ import annotations

import tomllib

import pytest


@pytest.fixture
def package_found(installed, third_party):
    with installed(third_party):
        yield


@pytest.mark.usefixtures("package_found")
def test_its_tests_pass(driver_page):
    namespace: dict = {}
    exec(driver_page.block("def test_a_frame_cut"), namespace)
    exec(driver_page.block("def test_the_driver_reads"), namespace)
    tests = [name for name in namespace if name.startswith("test_")]
    assert len(tests) == 2
    for name in tests:
        namespace[name]()


def test_its_toml_is_toml_and_names_what_the_code_defines(driver_page):
    documents = [tomllib.loads(code) for code in driver_page.toml]
    points = documents[0]["project"]["entry-points"]
    assert points == {
        "teleop.devices": {"acme": "acme:Acme"},
        "teleop.emulators": {"acme": "acme_emulated:EmulatedAcme"},
    }
    assert documents[1]["devices"]["tip"]["kind"] == "acme"


@pytest.mark.usefixtures("package_found")
def test_a_registered_device_is_known_to_rig_files(third_party_rig):
    from drivers.rig_file import read_rig_file

    assert read_rig_file(third_party_rig).devices["tip"].kind == "acme"


def test_the_other_blocks_compile(driver_page):
    for code in driver_page.python:
        compile(code, "writing-a-driver.md", "exec")
