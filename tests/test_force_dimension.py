"""The example package for Force Dimension, with a compiled library in place of the SDK."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from drivers import Command, RigError, registry
from drivers.rig_file import RigFileError, parse_rig_file, read_rig_file
from drivers.wired_rig import WiredRig
from teleop.cli import main
from teleop.settings.trial_settings import TrialSettings

FOLDER = Path(__file__).parents[1] / "examples" / "force_dimension"
SDK = r"""
static double force[3];
static int enabled, broken, opened, commanded;
static double at;
int dhdOpenID(signed char i) { opened = i == 0; return i == 0 ? 7 : -1; }
int dhdClose(signed char i) { opened = 0; return 0; }
int dhdEnableForce(unsigned char on, signed char i) { enabled = on; return i == 7 ? 0 : -1; }
int dhdGetStatus(int *s, signed char i) { s[5] = enabled && !broken; return 0; }
int dhdGetPosition(double *x, double *y, double *z, signed char i) {
  *x = at; *y = 2 * at; *z = 3 * at; return i == 7 && broken != 2 ? 1 : -1; }
int dhdSetForce(double x, double y, double z, signed char i) {
  force[0] = x; force[1] = y; force[2] = z; commanded++; return 2; }
const char *dhdGetSystemName(signed char i) { return "omega.3"; }
const char *dhdErrorGetLastStr(void) { return "no device found"; }
double fake_force(int i) { return enabled ? force[i] : 0.0; }
void fake_at(double x) { at = x; }
void fake_broken(int x) { broken = x; }
int fake_opened(void) { return opened; }
"""
pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdk")
    source, path = folder / "dhd.c", folder / "libdhd.so"
    source.write_text(SDK)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", path, source], check=True)
    return path


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Install the example package."""
    info = tmp_path / "teleop_force_dimension-0.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: teleop-force-dimension\nVersion: 0.1\n"
    )
    text = (FOLDER / "pyproject.toml").read_text()
    point = text[text.index('"teleop.devices"]') :].splitlines()[1].replace('"', "")
    (info / "entry_points.txt").write_text(f"[teleop.devices]\n{point}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(FOLDER)
    registry.offered.cache_clear()
    yield
    registry.offered.cache_clear()
    sys.modules.pop("force_dimension", None)


@pytest.fixture
def sdk(library):
    """The functions of the library with which a test changes and reads its state."""
    found = ctypes.CDLL(str(library))
    found.fake_force.restype = ctypes.c_double
    found.fake_at.argtypes = (ctypes.c_double,)
    found.fake_broken(0)
    found.fake_at(0.01)
    return found


@pytest.fixture
def device(installed, library):
    from force_dimension import ForceDimension, ForceDimensionSettings

    device = ForceDimension(
        "master",
        ForceDimensionSettings(
            kind="force_dimension", library=str(library), model="omega.3", axis="y", max_force_n=12
        ),
    )
    device.time = 0.0
    yield device
    device.stop()


def tick(device, force=None):
    """Do what a rig does in a tick, with or without a command."""
    device.time += 1e-3
    device.update(device.time)
    if force is not None:
        device.command(force)
        device.transmit()


def started(device):
    device.start(lambda: 0.0)
    return device


def test_the_driver_has_less_than_120_lines():
    assert len((FOLDER / "force_dimension.py").read_text().splitlines()) < 120


def test_its_axis_is_measured_and_a_force_acts_along_this_axis_only(device, sdk):
    started(device)
    assert device.samples["position"].value == 0.02
    tick(device, 3.0)
    assert sdk.fake_force(1) == 0.0  # not in operation
    assert device.enable()
    assert sdk.fake_force(1) == 0.0
    tick(device, 3.0)
    assert [sdk.fake_force(i) for i in range(3)] == [0.0, 3.0, 0.0]
    assert device.command(-99.0) == -12.0
    assert device.idle()
    assert sdk.fake_force(1) == 0.0
    device.stop()
    assert not sdk.fake_opened()


def test_without_commands_the_driver_switches_the_forces_off(device, sdk):
    started(device)
    device.enable()
    tick(device, 3.0)
    for _ in range(60):
        tick(device)
    assert device.error == "watchdog: no command arrived in time"
    assert sdk.fake_force(1) == 0.0
    tick(device, 3.0)
    assert sdk.fake_force(1) == 0.0


def test_a_device_whose_forces_are_off_does_not_operate(device, sdk):
    started(device)
    sdk.fake_broken(1)
    assert not device.enable()
    assert device.idle()


def test_a_position_that_cannot_be_read_is_an_error(device, sdk):
    started(device)
    assert device.enable()
    sdk.fake_broken(2)
    tick(device, 1.0)
    assert device.error == "dhdGetPosition: no device found"
    assert sdk.fake_force(1) == 0.0


def test_another_model_and_a_missing_library_are_refused(device, library):
    settings = device.settings
    device.settings = settings.model_copy(update={"model": "sigma.7"})
    with pytest.raises(RigError, match=r"model 'omega.3', expected 'sigma.7'"):
        started(device)
    device.settings = settings.model_copy(update={"index": 3})
    with pytest.raises(RigError, match="device 3: no device found"):
        started(device)
    device.settings = settings.model_copy(update={"library": "/none/libdhd.so"})
    with pytest.raises(RigError, match="expected the SDK as '/none/libdhd.so'"):
        started(device)


@pytest.mark.usefixtures("installed")
def test_its_rig_file_describes_a_force_commanded_master():
    rig = read_rig_file(FOLDER / "omega.toml")
    settings = TrialSettings(rig=rig, depth=5e-3, specimen="gel")
    assert settings.master_coupling.max_force == 12.0
    stiff = rig.text.replace("stiffness_n_per_m = 600", "stiffness_n_per_m = 900")
    with pytest.raises(RigFileError, match="expected at most 666 N/m"):
        parse_rig_file(FOLDER / "stiff.toml", stiff)


@pytest.mark.usefixtures("installed")
def test_it_is_listed_and_cannot_be_emulated(capsys, tmp_path):
    assert main(["rig", "list", "--kinds"]) == 0
    assert "force_dimension" in capsys.readouterr().out
    out = str(tmp_path / "run.toml")
    assert main(["rig", "emulate", str(FOLDER / "omega.toml"), "--out", out]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "force_dimension" in error


ALONE = """
name = "one axis"
buses.none = {{ kind = "serial", port = "/dev/none", baud_bps = 9600 }}
[devices.omega]
kind = "force_dimension"
library = "{library}"
model = "omega.3"
axis = "y"
max_force_n = 12
[channels]
contact_force = {{ device = "omega", signal = "position", scale = 1, range_n = [-50, 50] }}
slave_position = {{ device = "omega", signal = "position", range_mm = [-60, 60] }}
[drives]
slave = {{ device = "omega", max_velocity_mm_per_s = 100, max_force_n = 12, moving_mass_kg = 0.2 }}
[limits]
max_velocity_mm_per_s = 100
max_acceleration_m_per_s2 = 10
max_master_velocity_mm_per_s = 100
max_master_acceleration_m_per_s2 = 10
soft_position_mm = [-45, 25]
hard_position_mm = [-50, 30]
soft_force_n = 10
hard_force_n = 12
following_error_mm = 2
"""


class NoBus:
    """A bus without devices. Waiting ends when the condition holds."""

    name, pump = "none", None

    def open(self): ...

    def close(self): ...

    def poll(self): ...

    def transmit(self, devices):
        for device in devices:
            device.transmit()

    def wait_for(self, condition, seconds):
        return condition()


@pytest.mark.usefixtures("installed")
def test_a_rig_opens_commands_and_closes_it(tmp_path, monkeypatch, library, sdk):
    monkeypatch.setattr("drivers.wired_rig.make_bus", lambda *_: NoBus())
    time = [1.0]
    file = parse_rig_file(tmp_path / "rig.toml", ALONE.format(library=library))
    rig = WiredRig(file, lambda: time[0])
    assert not sdk.fake_opened()  # reading a rig file opens nothing
    with rig:
        assert sdk.fake_opened()
        for k in range(20):
            time[0] += 1e-3
            sdk.fake_at(0.01 + 1e-6 * max(0, k - 10))
            assert rig.read().slave_position == pytest.approx(0.02 + 2e-6 * max(0, k - 10))
            assert rig.enable()
            rig.write(Command(0.0, 0.01))
        assert sdk.fake_force(1) > 0.1  # the velocity loop
        assert rig.idle()
        assert sdk.fake_force(1) == 0.0
    assert not sdk.fake_opened()
