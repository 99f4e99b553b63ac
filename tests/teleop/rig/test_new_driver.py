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


def test_a_new_package_is_formatted(tmp_path):
    pytest.importorskip("ruff")
    for kind, drive in NAMES:
        written(tmp_path / f"{kind}-{drive}", "acme", kind, drive)
    ruff = [sys.executable, "-m", "ruff"]
    files = [*tmp_path.rglob("*.py")]
    assert len(files) >= 3 * len(NAMES)
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
    "a frame that is too short gives a sample": (
        "can",
        "none",
        "len(frame.data) != STATUS.size:\n"
        '            self.rejected["length"] += 1\n            return\n'
        "        _, millinewton = STATUS.unpack(frame.data)\n",
        "not frame.data:\n            return\n"
        "        _, millinewton = STATUS.unpack(bytes(frame.data).ljust(8, b'x')[:8])\n",
        "a frame that is too short gives no sample",
        "4 of 8 bytes of a frame gave a sample|7 of 8 bytes of a frame gave a sample",
    ),
    "an old datagram gives a sample": (
        "udp",
        "none",
        "        if self._newest is not None and",
        "        if self._newest is not None and 0 and",
        "an old or repeated datagram gives no sample",
        "an old datagram gave a sample",
    ),
    "half a frame is left after a new start": (
        "serial",
        "none",
        "port, Frames(self.rejected)\n",
        'port, getattr(self, "_frames", None) or Frames(self.rejected)\n',
        "`start` resets the state of the driver",
        "rejected {'checksum': 1",
    ),
    "frames before the second start are newer": (
        "udp",
        "none",
        "        self._newest = None\n",
        '        self._newest = getattr(self, "_newest", None)\n',
        "`start` resets the state of the driver",
        "rejected {'old'",
    ),
    "a wrong unit": (
        "can",
        "none",
        "millinewton * 1e-3",
        "millinewton * 1e-2",
        "a value is that of the sensor, in the unit of the signal",
        "force is 123.4 N, expected 12.34",
    ),
    "a signal without samples": (
        "can",
        "none",
        'return {"force": "N"}',
        'return {"force": "N", "temperature": "degC"}',
        "every signal gets samples",
        "no sample of temperature in 2 s",
    ),
    "an error stays": (
        "can",
        "none",
        "    def receive(",
        "    def rearm(self): ...\n\n    def receive(",
        "`rearm` clears the stored error",
        "after rearm, the error is",
    ),
    "a stop needs the port": (
        "udp",
        "none",
        "contextlib.suppress(RigError)",
        "contextlib.suppress(KeyError)",
        "no method raises an exception",
        "stop raised RigError: bench: UDP port 192.0.2.1:1 is disconnected",
    ),
    "another clock": (
        "can",
        "none",
        "1e-3, time)",
        "1e-3, time - 900.0)",
        "the time of a sample is on the controller's clock",
        "the newest sample of force is 900 s old",
    ),
    "times that decrease": (
        "can",
        "none",
        "1e-3, time)",
        "1e-3, time - 0.01 * (_ % 2))",
        "the times of the samples do not decrease",
        "ms older than before",
    ),
    "noise ends the frames": (
        "serial",
        "none",
        "        for _, millinewton in",
        '        for _, millinewton in [] if self.rejected["noise"] else',
        "noise between frames is skipped",
        "no sample of every signal in 1 s after noise",
    ),
    "a valid frame is rejected": (
        "can",
        "none",
        "        _, millinewton =",
        '        self.rejected["valid"] += 1\n        _, millinewton =',
        "valid frames give finite values and are not rejected",
        "rejected {'valid'",
    ),
    "a frame raises": (
        "udp",
        "none",
        '            self.rejected["length"] += 1\n            return\n',
        '            raise ValueError("length")\n',
        "no method raises an exception, whatever arrives",
        "receive raised ValueError: length, after the bytes (empty)",
    ),
    "no device is found": (
        "udp",
        "none",
        "self._send(START)",
        "self._send(STOP)",
        "`start` succeeds with a device that works",
        "start raised RigError",
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
        check_device(tested.Acme, tested.SETTINGS, tested.EmulatedAcme, {"force": 12.34})
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
    "a force before the first command": (
        OPERATES,
        OPERATES,
        "        self._send(ENABLE, self.settings.watchdog_ms)\n",
        "        self._send(ENABLE, self.settings.watchdog_ms)\n        self._send(SET, 10000)\n",
        "`enable` causes neither motion nor force",
        "0.5 N before the first command",
    ),
    "operation is never confirmed": (
        OPERATES,
        OPERATES,
        "        return self._confirmed\n\n    def command",
        "        return False\n\n    def command",
        "`enable` puts the drive into operation",
        "enable returned False for 2 s",
    ),
    "a stop is requested later": (
        OPERATES,
        OPERATES,
        "        self._send(IDLE)\n        return self._confirmed\n",
        "            return False\n        self._send(IDLE)\n        return self._confirmed\n",
        "`idle` sends its request at once",
        "the first call of idle sent nothing",
    ),
    "a stop is requested once": (
        OPERATES,
        OPERATES,
        "        self._send(IDLE)\n        return self._confirmed\n",
        "            self._send(IDLE)\n        return self._confirmed\n",
        "the request of `idle` is repeated until the drive has confirmed it",
        "1 requests in 1 s without an answer",
    ),
    "a stop is no stop": (
        OPERATES,
        OPERATES,
        "        self._send(IDLE)\n        return self._confirmed\n",
        "        self._send(SET, 0)\n        return self._confirmed\n",
        "`idle` takes the drive out of operation",
        "idle returned False for 1 s",
    ),
    "a long watchdog time": (
        OPERATES,
        OPERATES,
        "self._send(ENABLE, self.settings.watchdog_ms)",
        "self._send(ENABLE, 10**6)",
        "the watchdog stops the drive if the host is silent",
        "the drive operates 0.15 s after the last frame",
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
