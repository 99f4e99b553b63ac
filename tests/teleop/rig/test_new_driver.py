"""`teleop rig new-driver` writes a package that passes its own tests."""

from __future__ import annotations

import importlib
import subprocess
import sys
from itertools import product

import pytest

from drivers import registry
from drivers.testing import check_device, check_drive
from teleop.cli import main
from teleop.rig.new_driver import BASES, DRIVES

NAMES = list(product(BASES, DRIVES))


def written(folder, name, kind="serial", drive="none"):
    """Write a package, and the metadata that pip writes when it installs the package."""
    command = ["rig", "new-driver", name, "--kind", kind, "--drive", drive]
    assert main([*command, "--out", str(folder)]) == 0
    cls = "".join(part.capitalize() for part in name.split("_"))
    info = folder / f"{name}-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(
        f"[teleop.devices]\n{name} = {name}:{cls}\n"
        f"[teleop.emulators]\n{name} = {name}_emulated:Emulated{cls}\n"
    )
    registry.offered.cache_clear()


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """Returns a function that imports a module of a package in the folder `tmp_path`."""
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    yield importlib.import_module
    for name in set(sys.modules) - before:
        if "acme" in name:
            del sys.modules[name]


@pytest.mark.parametrize(("kind", "drive"), NAMES)
def test_the_tests_of_a_new_package_pass_and_its_driver_is_short(tmp_path, modules, kind, drive):
    written(tmp_path, "acme_one", kind, drive)
    found = modules("test_acme_one")
    tests = [test for name, test in vars(found).items() if name.startswith("test_")]
    assert len(tests) == (1 if drive == "none" else 2)
    for test in tests:
        test()
    assert len((tmp_path / "acme_one.py").read_text().splitlines()) < 80


@pytest.mark.parametrize(("kind", "drive"), NAMES)
def test_a_new_package_is_formatted(tmp_path, kind, drive):
    pytest.importorskip("ruff")
    written(tmp_path, "acme", kind, drive)
    ruff = [sys.executable, "-m", "ruff"]
    files = [*tmp_path.glob("*.py")]
    line = "--line-length=100"
    done = subprocess.run([*ruff, "format", "--check", line, *files], check=False)
    assert done.returncode == 0
    rules = "--select=B,C4,E,F,I,N,PERF,RET,RUF,SIM,UP,W"
    assert subprocess.run([*ruff, "check", line, rules, *files], check=False).returncode == 0


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Acme", "small letters"),
        ("1a", "small letters"),
        ("../acme", "small letters"),
        ("class", "keyword"),
        ("bota", "kind of device"),
        ("json", "module json exists"),
    ],
)
def test_a_bad_name_is_refused(tmp_path, capsys, name, expected):
    assert main(["rig", "new-driver", name, "--out", str(tmp_path / "new")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert expected in error
    assert not (tmp_path / "new").exists()


def test_nothing_is_overwritten(tmp_path, capsys):
    kept = tmp_path / "pyproject.toml"
    kept.write_text("mine")
    assert main(["rig", "new-driver", "acme", "--out", str(tmp_path)]) == 2
    assert main(["rig", "new-driver", "acme", "--out", str(kept)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 2
    assert error.count("is empty") == 2
    assert [*tmp_path.iterdir()] == [kept]
    assert kept.read_text() == "mine"


DEFECTS = {
    "a frame cut in two raises": (
        "serial",
        "none",
        "        for _, millinewton in self._frames.feed(data):\n",
        "        for _, millinewton in [STATUS.unpack(data[1:-2])]:\n",
        "a frame of a stream may be cut anywhere|no method raises an exception",
        "struct.error|error: unpack requires",
    ),
    "a time stamp in the future": (
        "udp",
        "none",
        "Sample(millinewton * 1e-3, time)",
        "Sample(millinewton * 1e-3, time + 0.01)",
        "no sample is newer than the present time",
        "10 ms ahead of now",
    ),
    "no age in silence": (
        "can",
        "none",
        "    def receive(self, frame, time):\n",
        "    def update(self, now):\n"
        '        self.samples["force"] = Sample(self.samples["force"].value, now)\n\n'
        "    def receive(self, frame, time):\n",
        "without a frame there is no new sample",
        "the time of force advanced by",
    ),
    "it waits": (
        "udp",
        "none",
        "        self._newest = counter\n",
        "        self._newest = counter\n        self._port.wait_for(lambda: False, 0.01)\n",
        "only `start` waits",
        "receive waits for 0.5 ms",
    ),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_a_defect_of_a_sensor_is_found(tmp_path, modules, defect):
    kind, drive, good, bad, rule, seen = DEFECTS[defect]
    written(tmp_path, "acme", kind, drive)
    plant(tmp_path / "acme.py", good, bad)
    tested = modules("test_acme")
    with pytest.raises(AssertionError) as error:
        check_device(tested.Acme, tested.SETTINGS, tested.EmulatedAcme)
    assert_found(error, rule, seen)


def plant(path, good, bad):
    text = path.read_text()
    assert text.count(good) == 1
    path.write_text(text.replace(good, bad))


def assert_found(error, rules, seens):
    lines = str(error.value).splitlines()
    assert any(
        rule in line and seen in line and '(docs/writing-a-driver.md, "The rules of a' in line
        for line in lines
        for rule in rules.split("|")
        for seen in seens.split("|")
    ), lines


OPERATES = (
    "        if self._wanted and self._confirmed:  # only this frame resets the watchdog timer\n"
)
DRIVE_DEFECTS = {
    "polling feeds the watchdog": (
        OPERATES,
        OPERATES.replace("self._wanted and self._confirmed", "True"),
        "    def enable(self):\n",
        "    def update(self, now):\n        self._send(SET, self._value)\n\n"
        "    def enable(self):\n",
        "only a command resets the watchdog timer",
        "and update sent frames",
    ),
    "a stop is confirmed by itself": (
        "        return self._confirmed\n\n    def command",
        "        return self._confirmed\n\n    def command",
        "        self._send(IDLE)\n        return self._confirmed\n",
        "        self._send(IDLE)\n        return True\n",
        "`idle` returns True only after the drive has confirmed it",
        "the first call of idle returned True",
    ),
    "operation is confirmed by itself": (
        OPERATES,
        OPERATES,
        "        return self._confirmed\n\n    def command",
        "        return True\n\n    def command",
        "`enable` returns True only after the drive has confirmed it",
        "although the request is lost",
    ),
    "the limit is not in the returned value": (
        OPERATES,
        OPERATES,
        "        return self._value * 1e-6 / self._radius\n",
        "        return force\n",
        "`command` returns the value that is sent",
        "but the drive applies",
    ),
    "a restart is no error": (
        OPERATES,
        OPERATES,
        "            self.error = self.error or ",
        "            self.rejected[''] = self.error or ",
        "a restart of the device in operation is an error",
        "no error in 1 s",
    ),
    "an error ends by itself": (
        OPERATES,
        OPERATES,
        "        most = self.settings.max_torque_nm\n",
        '        most, self.error = self.settings.max_torque_nm, ""\n',
        "an error of a drive stays until `rearm`",
        "ended without rearm",
    ),
}


@pytest.mark.parametrize("defect", DRIVE_DEFECTS)
def test_a_defect_of_a_drive_is_found(tmp_path, modules, defect):
    good, bad, second, other, rule, seen = DRIVE_DEFECTS[defect]
    written(tmp_path, "acme", "can", "force")
    plant(tmp_path / "acme.py", good, bad)
    plant(tmp_path / "acme.py", second, other)
    tested = modules("test_acme")
    with pytest.raises(AssertionError) as error:
        check_drive(tested.Acme, tested.SETTINGS, tested.EmulatedAcme, tested.WATCHDOG)
    assert_found(error, rule, seen)
