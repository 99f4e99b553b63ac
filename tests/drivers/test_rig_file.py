"""Reading of a rig file: all problems are reported together."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers import rig_file
from drivers.rig_file import RigFileError, read_rig_file
from drivers.transports.serial_port import SerialPort
from drivers.transports.shared_line import SharedLine
from drivers.transports.tcp_port import TcpPort
from drivers.wired_rig import WiredRig
from teleop.safety.rig_limits import rig_limits

from .shared_line_devices import Meter

RIGS = Path(__file__).parents[2] / "rigs"
EXAMPLES = sorted(RIGS.glob("*.toml"))
BOARD = (RIGS / "serial-board.toml").read_text()


def read(folder, text):
    path = folder / "rig.toml"
    path.write_text(text)
    return read_rig_file(path)


def problems(folder, text):
    with pytest.raises(RigFileError) as caught:
        read(folder, text)
    return [line.removeprefix(f"{folder / 'rig.toml'}: ") for line in str(caught.value).split("\n")]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_are_as_expected(path):
    rig = read_rig_file(path)
    assert rig_limits(rig.sections).hard_force > 0.0
    wired = WiredRig(rig, lambda: 0.0)
    assert set(wired.buses) == set(rig.sections.buses)


def test_each_kind_of_device_that_is_built_in_has_an_example():
    from drivers.registry import BUILT_IN

    used = {device.kind for path in EXAMPLES for device in read_rig_file(path).devices.values()}
    assert used == set(BUILT_IN)


def test_units_become_si(tmp_path):
    text = BOARD.replace("max_acceleration_m_per_s2 = 10\n", "max_acceleration_m_per_s2 = 8\n")
    limits = rig_limits(read(tmp_path, text).sections)
    assert limits.max_velocity == pytest.approx(0.2)
    assert limits.max_acceleration == 8.0
    assert limits.hard_position == pytest.approx((-0.05, 0.03))
    assert limits.drive_compliance == pytest.approx(4.2e-6)
    assert limits.channels["slave_position"].low == pytest.approx(-0.06)
    assert limits.channels["contact_force"].frozen_time == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('name = "serial board"', "", "name: is missing"),
        ("rate_hz = 1000\n\n", "rate_hz = 5\n\n", "rate_hz"),
        ("watchdog_ms = 50", "watchdog = 50", "devices.board.watchdog: unknown setting"),
        ("baud_bps = 921600", 'baud_bps = "fast"', "buses.usb.serial.baud_bps"),
        ('signal = "force_1"', 'signal = "force_9"', "channels.contact_force.signal: 'force_9'"),
        ('signal = "force_1"', 'signal = "analogue_0"', "channels.contact_force.scale: missing"),
        ('drive = "axis_1"', 'drive = "axis_7"', "drives.slave.drive: 'axis_7'"),
        ('drive = "axis_1"', "", "expected a drive of the device: axis_0, axis_1"),
        ('bus = "usb"', 'bus = "can"', "devices.board.bus: 'can': expected a serial or tcp bus"),
        (
            'kind = "board"',
            'kind = "bored"',
            "devices.board.kind: 'bored': expected one of ati_netft, board",
        ),
        ('kind = "board"', "", "devices.board.kind: None: expected one of ati_netft, board"),
        ('kind = "serial"', 'kind = "parallel"', "buses.usb"),
        ("range_n = [-500, 500]", "range_n = [-500, nan]", "range_n.1"),
    ],
)
def test_a_problem_is_reported_with_its_key(tmp_path, old, new, message):
    assert old in BOARD
    assert any(message in line for line in problems(tmp_path, BOARD.replace(old, new)))


def test_all_problems_are_reported_together(tmp_path):
    text = BOARD.replace("baud_bps = 921600", "baud_bps = -1")
    text = text.replace('signal = "force_1"', 'signal = "force_9"')
    text = text.replace("soft_force_n = 200", "soft = 1")
    found = "\n".join(problems(tmp_path, text))
    for message in ("baud_bps", "force_9", "limits.soft:", "limits.soft_force_n"):
        assert message in found


def test_an_invalid_device_is_not_reported_again_where_it_is_used(tmp_path):
    found = problems(tmp_path, BOARD.replace("watchdog_ms = 50", "watchdog = 50"))
    assert len(found) == 1


def test_hard_limits_inside_soft_ones_are_refused(tmp_path):
    text = BOARD.replace("hard_force_n = 250", "hard_force_n = 20")
    with pytest.raises(ValueError, match=r"limits: soft force limit 200 N is above"):
        rig_limits(read(tmp_path, text).sections)


def test_two_devices_on_one_port_are_refused(tmp_path):
    text = BOARD + '\n[devices.other]\nkind = "bota"\nbus = "usb"\n'
    assert problems(tmp_path, text) == [
        "devices.other.bus: port 'usb' is already used by device board"
    ]


@pytest.mark.parametrize(
    ("added", "problem"),
    [
        ("fd = true", "fd = true: the interface slcan has no CAN FD: expected another one"),
        ("data_bitrate_bps = 5_000_000", "data_bitrate_bps: expected only with fd = true"),
    ],
)
def test_a_bus_that_cannot_have_can_fd_is_refused(tmp_path, added, problem):
    text = (RIGS / "odrive-bota.toml").read_text()
    assert problems(tmp_path, text.replace('kind = "can"', f'kind = "can"\n{added}')) == [
        f"buses.can.can: {problem}"
    ]


def test_a_device_that_needs_can_fd_is_refused_on_another_bus(tmp_path):
    text = (RIGS / "moteus.toml").read_text()
    assert problems(tmp_path, text.replace("fd = true\n", "")) == [
        f"devices.{name}.bus: 'can': expected a bus with fd = true" for name in ("master", "slave")
    ]


def on_tcp(text, host, port):
    old = 'kind = "serial"\nport = "/dev/ttyACM0"\nbaud_bps = 921600'
    assert old in text
    return text.replace(old, f'kind = "tcp"\nhost = "{host}"\nport = {port}')


def test_a_serial_device_can_be_connected_by_tcp(tmp_path):
    rig = read(tmp_path, on_tcp(BOARD, "192.168.1.5", 4001))
    (bus,) = WiredRig(rig, lambda: 0.0).buses.values()
    assert isinstance(bus, TcpPort)
    assert bus.port == "192.168.1.5:4001"


def test_the_problems_of_network_buses_are_reported_together(tmp_path):
    text = on_tcp(BOARD, "192.168.1.5", 4001)
    udp = '\n[buses.{name}]\nkind = "udp"\nhost = "{host}"\nport = 49152\nlocal_port = 5000\n'
    text += udp.format(name="a", host="192.168.1.6") + udp.format(name="b", host="192.168.1.7")
    text += udp.format(name="c", host="192.168.1.6").replace("local_port = 5000\n", "")
    text += '[buses.d]\nkind = "tcp"\nhost = "192.168.1.5"\nport = 4001\n'
    text += '[devices.other]\nkind = "bota"\nbus = "a"\n'
    assert problems(tmp_path, text) == [
        "buses.b: 'local UDP port :5000' is already used by bus a",
        "buses.c: 'UDP port 192.168.1.6:49152' is already used by bus a",
        "buses.d: 'TCP port 192.168.1.5:4001' is already used by bus usb",
        "devices.other.bus: 'a': expected a serial or tcp bus of the section [buses]: usb, d",
    ]


@pytest.fixture
def meters(monkeypatch):
    """Adds the kind `meter`, whose devices may share a serial line."""
    of_others = rig_file.device_class
    monkeypatch.setattr(
        rig_file, "device_class", lambda kind: Meter if kind == "meter" else of_others(kind)
    )
    known = rig_file.kinds()
    monkeypatch.setattr(rig_file, "kinds", lambda: [*known, "meter"])


LINE = '\n[buses.line]\nkind = "serial"\nport = "/dev/ttyUSB5"\nbaud_bps = 115200\n'


def meter(name, address, bus="line"):
    return f'[devices.{name}]\nkind = "meter"\nbus = "{bus}"\naddress = {address}\n'


@pytest.mark.usefixtures("meters")
def test_devices_made_for_a_shared_line_may_have_the_same_bus(tmp_path):
    rig = WiredRig(read(tmp_path, BOARD + LINE + meter("a", 1) + meter("b", 2)), lambda: 0.0)
    assert isinstance(rig.buses["line"], SharedLine)
    assert isinstance(rig.buses["usb"], SerialPort)


@pytest.mark.usefixtures("meters")
def test_a_shared_line_with_other_devices_or_equal_addresses_is_refused(tmp_path):
    text = BOARD + LINE + meter("a", 1) + meter("b", 1) + meter("c", 1, bus="usb")
    text += '[devices.d]\nkind = "bota"\nbus = "line"\n'
    assert problems(tmp_path, text) == [
        "devices.b.bus: address 1 on 'line' is already used by device a",
        "devices.c.bus: port 'usb' is already used by device board",
        "devices.d.bus: port 'line' is already used by device a",
    ]


@pytest.mark.parametrize("port", ["0", "65536", '"http"'])
def test_an_impossible_port_number_is_reported(tmp_path, port):
    (found,) = {line.partition(":")[0] for line in problems(tmp_path, on_tcp(BOARD, "a", port))}
    assert found == "buses.usb.tcp.port"


@pytest.mark.parametrize("master", ["", 'drive = "axis"'])
@pytest.mark.parametrize("slave", ["", 'drive = "axis"'])
def test_one_drive_cannot_be_both_master_and_slave(tmp_path, master, slave):
    head, text = (RIGS / "odrive-bota.toml").read_text().split("[drives.master]")
    text = text.replace('device = "master"', f'device = "slave"\n{master}')
    text = text.replace("[drives.slave]", f"[drives.slave]\n{slave}")
    assert problems(tmp_path, f"{head}[drives.master]{text}") == [
        "drives.master: same drive as drives.slave: expected another drive"
    ]


@pytest.mark.parametrize("content", [b"\xff\xfe", b"name =", b"[a]\n[a]\n", b"a = 1\x00"])
def test_an_invalid_toml_file_is_reported_in_one_line(tmp_path, content):
    path = tmp_path / "rig.toml"
    path.write_bytes(content)
    with pytest.raises(RigFileError, match="not a TOML file"):
        read_rig_file(path)


@pytest.mark.parametrize("value", ["3", "[]", "{}", "true"])
def test_a_device_of_an_invalid_kind_is_reported(tmp_path, value):
    text = BOARD.replace('kind = "board"', f"kind = {value}")
    assert any(".kind: " in line for line in problems(tmp_path, text))


VALUES = ["3", "-1", '"x"', "[]", "[1, 2, 3]", "{}", "true", "nan", "1e400", "2026-01-01"]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
@given(st.data())
def test_any_value_anywhere_is_read_or_refused(tmp_path, data):
    lines = BOARD.splitlines()
    keyed = [i for i, line in enumerate(lines) if "=" in line and not line.startswith("#")]
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.sampled_from(keyed))
        lines[at] = f"{lines[at].partition('=')[0]}= {data.draw(st.sampled_from(VALUES))}"
    with contextlib.suppress(ValueError):
        rig = read(tmp_path, "\n".join(lines))
        WiredRig(rig, lambda: 0.0)
        rig_limits(rig.sections)


@pytest.mark.parametrize("section", ["buses", "devices", "channels", "drives", "limits"])
@pytest.mark.parametrize("value", ["3", "[]", '"x"', "{}", "{ a = 1 }"])
def test_an_invalid_section_is_reported(tmp_path, section, value):
    kept, skip = [f"{section} = {value}"], False
    for line in BOARD.splitlines():
        if line.startswith("["):
            skip = line.strip("[]").split(".")[0] == section
        if not skip:
            kept.append(line)
    assert any(section in line for line in problems(tmp_path, "\n".join(kept)))


@pytest.mark.parametrize(
    "text", ["a = " + "1" * 5000, "a = " + "[" * 100_000, 'a = "' + "x" * (17 << 20) + '"']
)
def test_a_file_that_is_too_large_or_nested_too_deeply_is_refused(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises((RigFileError, OSError)):
        read_rig_file(path)


def test_a_rate_above_1000_hz_is_accepted_as_on_the_command_line(tmp_path):
    path = tmp_path / "fast.toml"
    text = (RIGS / "serial-board.toml").read_text()
    path.write_text(text.replace("rate_hz = 1000\n", "rate_hz = 2000\n"))
    assert read_rig_file(path).sections.rate_hz == 2000.0


MIT = (RIGS / "mit-motor.toml").read_text()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "stiffness_n_per_m = 977 ",
            "stiffness_n_per_m = 80 ",
            "drives.master: stiffness_n_per_m of 80 N/m: the motor would apply 97.68 N/m: expected "
            "a value that it can apply with an error of at most 5%",
        ),
        (
            "friction_ns_per_m = 2\n",
            "friction_ns_per_m = 2\ndamping_ns_per_m = 0.1\n",
            "drives.master: damping_ns_per_m of 0.1 N s/m: the motor would apply 0 N s/m: expected "
            "a value that it can apply with an error of at most 5%",
        ),
        ("max_force_n = 40\n", "", "drives.master.max_force_n: missing: the drive accepts forces"),
        (
            "friction_ns_per_m = 2\n",
            "friction_ns_per_m = 1\n",
            "drives.master.stiffness_n_per_m: 977 N/m: expected at most 666 N/m with a coupling "
            "damping of 0 N s/m, 1 periods of latency at 1000 Hz in the drive, which closes the "
            "coupling (drive_rate_hz), and a friction of the handle of 1 N s/m, or a friction of "
            "at least 1.47 N s/m",
        ),
    ],
)
def test_a_coupling_that_the_motor_cannot_close_is_a_problem(tmp_path, old, new, message):
    assert problems(tmp_path, MIT.replace(old, new)) == [message]


def test_a_coupling_that_the_drive_closes_is_checked_with_the_rate_of_the_drive(tmp_path):
    text = MIT.replace(
        "friction_ns_per_m = 2\n", "friction_ns_per_m = 0.1\ndrive_rate_hz = 20000\n"
    )
    rig = read(tmp_path, text)
    coupling = rig.coupling("master", 0.01)
    assert coupling.largest_stiffness(0.01) == pytest.approx(0.1 * 20000.0 / 1.5, rel=1e-4)
    assert coupling.problem(0.01) == ""


def test_the_rate_of_a_drive_that_closes_no_coupling_is_a_problem(tmp_path):
    text = (RIGS / "odrive-torque.toml").read_text()
    text = text.replace(
        "stiffness_n_per_m = 700\n", "stiffness_n_per_m = 700\ndrive_rate_hz = 8000\n"
    )
    assert problems(tmp_path, text) == [
        "drives.master.drive_rate_hz: the host closes the coupling of this drive: expected no such "
        "key"
    ]


def test_the_velocity_loop_of_a_slave_has_the_gains_for_the_rate_of_the_trial():
    file = read_rig_file(RIGS / "odrive-torque.toml")
    gains = [
        axis.coupling.parameters.stiffness
        for rate in (None, 1000.0, 500.0)
        for name, axis, _ in WiredRig(file, lambda: 0.0, rate)._coupled
        if name == "slave"
    ]
    assert gains[0] == gains[1]
    assert gains[2] == pytest.approx(gains[0] / 4.0, rel=1e-4)


def test_the_mass_of_a_handle_belongs_to_the_master(tmp_path):
    text = (RIGS / "odrive-torque.toml").read_text()
    text = text.replace("moving_mass_kg = 3.0 ", "handle_mass_kg = 0.3\nmoving_mass_kg = 3.0 ")
    assert problems(tmp_path, text) == [
        "drives.slave.handle_mass_kg: the slave has no handle: expected it in drives.master"
    ]
