"""The firmware in C: compilation without warnings, fuzzing, and use over a pseudo-terminal."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from drivers.devices.board import Board
from drivers.devices.board_settings import BoardSettings
from drivers.transports.serial_port import SerialPort

WATCHDOG = "watchdog: no command arrived in time: the loop was late, or the line is disturbed"
FIRMWARE = Path(__file__).parents[3] / "drivers" / "firmware"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
SANITIZERS = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover"]
FUZZED = 100_000
"""Number of malformed inputs; the default of fuzz.c is a million."""
SOON = 5.0
"""Longest wait for an event that normally takes a few milliseconds [s]."""


@pytest.fixture(scope="session")
def compiler():
    found = shutil.which("cc") or shutil.which("gcc")
    if not found:
        pytest.skip("no C compiler")
    return found


def build(compiler, program, *flags):
    sources = [str(FIRMWARE / "teleop_board.c"), str(FIRMWARE / f"{program.name}.c")]
    command = [compiler, *STRICT, *flags, "-o", str(program), *sources]
    return subprocess.run(command, capture_output=True, text=True)


@pytest.fixture(scope="session")
def posix_main(compiler, tmp_path_factory):
    program = tmp_path_factory.mktemp("posix") / "posix_main"
    built = build(compiler, program)
    assert not built.returncode, built.stderr
    return program


def test_malformed_input_violates_no_invariant(compiler, tmp_path):
    program = tmp_path / "fuzz"
    if build(compiler, program, *SANITIZERS).returncode:
        assert not (built := build(compiler, program)).returncode, built.stderr
    for seed in (1, 2):
        check_fuzzed(program, seed)


def check_fuzzed(program, seed):
    run = subprocess.run([program, str(FUZZED), str(seed)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    seen = {name: int(number) for name, number in re.findall(r"(\w+) (\d+)", run.stdout)}
    assert len(seen) == 8
    assert min(seen.values()) > 100


def test_the_core_needs_no_heap_and_no_operating_system(compiler, tmp_path):
    core = tmp_path / "core.o"
    flags = [*STRICT, "-Os", "-ffreestanding", "-fno-stack-protector", "-c", "-o", str(core)]
    subprocess.run([compiler, *flags, str(FIRMWARE / "teleop_board.c")], check=True)
    nm = shutil.which("nm")
    if not nm:
        pytest.skip("no nm to list the symbols with")
    listed = subprocess.run([nm, "--undefined-only", core], capture_output=True, text=True).stdout
    names = {line.split()[-1].lstrip("_") for line in listed.splitlines()}
    assert names <= {"memset", "memcpy", "memmove", "GLOBAL_OFFSET_TABLE_"}


ARDUINO = """
#include <stddef.h>
#include <stdint.h>
struct { void begin(long) {} int available() { return 0; } uint8_t read() { return 0; }
         int availableForWrite() { return 64; } void write(const uint8_t *, size_t) {} } Serial;
enum { INPUT_PULLUP, OUTPUT, HIGH, LOW, EMERGENCY_STOP_PIN, DRIVE_FAULT_PIN, DIRECTION_PIN,
       DUTY_PIN, FULL_FORCE_MN = 5000 };
void digitalWrite(int, int) {}
void analogWrite(int, int) {}
void analogWriteFrequency(int, float) {}
void pinMode(int, int) {}
int digitalRead(int) { return HIGH; }
uint32_t micros() { return 0; }
uint32_t RANDOM_OR_COUNTED_UP_IN_EEPROM() { return 1; }
int32_t LATEST_OF_THE_CONVERTER() { return 0; }
int32_t ENCODER_COUNTS() { return 0; }
int32_t ENCODER_COUNTS_PER_SECOND() { return 0; }
int32_t LATEST_OF_ANALOGUE_INPUT() { return 0; }
void MOTOR_POWER(bool) {}
void MOTOR_VELOCITY(int32_t) {}
"""


@pytest.mark.parametrize("name", ["example", "hapkit"])
def test_the_sketch_compiles_against_the_arduino_functions(compiler, tmp_path, name):
    cpp = shutil.which("c++") or shutil.which("g++")
    if not cpp:
        pytest.skip("no C++ compiler")
    source = tmp_path / "sketch.cpp"
    source.write_text(ARDUINO + (FIRMWARE / f"{name}.ino").read_text())
    strict = ["-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"]
    subprocess.run([cpp, *strict, f"-I{FIRMWARE}", str(source)], check=True)


class Bench:
    """The firmware in another process, connected to the driver by a pseudo-terminal."""

    def __init__(self, program, master, slave, force_axes):
        self.process = subprocess.Popen(
            [program, str(master), str(force_axes)],
            stdin=subprocess.PIPE,
            pass_fds=[master],
            bufsize=0,
        )
        path = os.ttyname(slave)
        self.port = SerialPort("usb", time.monotonic, path, 115200)
        self.driver = Board(
            "board",
            BoardSettings(
                kind="board",
                bus="usb",
                watchdog_ms=200,
                force_n_per_count=(0.01, 0.01),
                position_um_per_count=(1.0, 1.0),
                velocity_um_per_s_per_count=(1.0, 1.0),
                axis_force_n_per_count=(0.0, 1e-3) if force_axes else (),
                analogue_mv_per_count=(1.0,),
            ),
        )
        self.port.attach(self.driver.receive)

    def tell(self, order):
        self.process.stdin.write(order)

    def until(self, condition):
        """Run the loop until a condition is true; return whether it is true."""
        end = time.monotonic() + SOON
        while not condition():
            if time.monotonic() > end:
                return False
            time.sleep(1e-3)
            self.port.poll()
            self.driver.transmit()
        return True

    def enable(self):
        return self.until(self.driver.drives["axis_1"].enable)


@pytest.fixture
def bench(posix_main, request):
    pytest.importorskip("tty", reason="no pseudo-terminals here")
    import tty

    master, slave = os.openpty()
    tty.setraw(slave)
    bench = Bench(posix_main, master, slave, getattr(request, "param", 0))
    os.close(master)
    try:
        bench.port.open()
        bench.driver.start(bench.port)
        yield bench
    finally:
        bench.port.close()
        bench.process.stdin.close()
        bench.process.kill()
        bench.process.wait()
        os.close(slave)


def test_over_a_pseudo_terminal_it_is_set_up_and_measures(bench):
    driver = bench.driver
    assert driver.identity.firmware == (1, 0)
    assert bench.until(lambda: driver.samples["force_1"].time > 0.0)
    assert driver.samples["force_0"].value == pytest.approx(1.0)
    assert driver.samples["force_1"].value == pytest.approx(2.0)
    assert driver.samples["analogue_0"].value == pytest.approx(0.01)
    assert not driver.error


def test_over_a_pseudo_terminal_an_axis_moves_and_stops(bench):
    driver = bench.driver
    assert bench.enable()
    driver.drives["axis_1"].command(0.05)
    assert bench.until(lambda: driver.samples["position_1"].value > 0.002)
    assert driver.samples["velocity_1"].value == pytest.approx(0.05)
    assert driver.samples["position_0"].value == 0.0
    driver.drives["axis_1"].idle()
    assert bench.until(lambda: driver.samples["velocity_1"].value == 0.0)
    assert not driver.error


def test_over_a_pseudo_terminal_its_watchdog_stops_the_axis(bench):
    driver = bench.driver
    assert bench.enable()
    driver.drives["axis_1"].command(0.05)
    assert bench.until(lambda: driver.samples["velocity_1"].value > 0.0)
    assert bench.port.wait_for(lambda: driver.error, SOON)
    assert driver.error == WATCHDOG
    assert bench.port.wait_for(lambda: driver.samples["velocity_1"].value == 0.0, SOON)


def test_over_a_pseudo_terminal_its_inputs_are_reported(bench):
    driver = bench.driver
    assert bench.enable()
    bench.tell(b"e")
    assert bench.until(lambda: driver.emergency_stop)
    assert not driver.error
    bench.tell(b"ef")
    driver.drives["axis_1"].idle()
    assert bench.until(lambda: driver.error)
    assert driver.error == "drive fault input"


def test_over_a_pseudo_terminal_a_reset_is_detected(bench):
    assert bench.enable()
    bench.tell(b"r")
    assert bench.until(lambda: bench.driver.error)
    assert bench.driver.error.startswith("the board was reset, open the rig again: boot 0xb0a2d001")


def test_over_a_pseudo_terminal_random_bytes_are_survived(bench):
    driver = bench.driver
    bench.port.write(bytes(range(256)) * 8)
    assert bench.until(lambda: driver.rejected["by the board"])
    assert bench.enable()
    assert not driver.error


@pytest.mark.parametrize("bench", [2], indirect=True)
def test_over_a_pseudo_terminal_an_axis_accepts_a_force_until_its_watchdog_acts(bench):
    driver = bench.driver
    assert driver.identity.force_axes == 2
    assert bench.enable()
    driver.drives["axis_1"].command(20.0)  # moves the simulated axis with 20 mm/s
    assert bench.until(lambda: driver.samples["position_1"].value > 0.002)
    assert driver.samples["velocity_1"].value == pytest.approx(0.02)
    assert bench.port.wait_for(lambda: driver.error, SOON)
    assert bench.port.wait_for(lambda: driver.samples["velocity_1"].value == 0.0, SOON)
