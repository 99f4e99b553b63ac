from __future__ import annotations

import time

import pytest

from teleop.control.clock import RealClock, VirtualClock


class FakeTime:
    """A monotonic clock that advances only by sleep and by work."""

    def __init__(self, monkeypatch) -> None:
        self.ns = 10**15
        monkeypatch.setattr(time, "monotonic_ns", self.look)
        monkeypatch.setattr(time, "sleep", self.work)

    def look(self):
        self.ns += 1000
        return self.ns

    def work(self, seconds):
        self.ns += round(seconds * 1e9)


@pytest.fixture
def fake(monkeypatch):
    return FakeTime(monkeypatch)


def test_deadlines_are_whole_periods_from_the_first_tick_for_any_work(fake):
    clock = RealClock(1000.0)
    clock.wait()
    first = fake.ns
    for n in range(1, 3001):
        fake.work(0.9e-3 * (n % 2))
        tick = clock.wait()
        assert fake.ns - first == pytest.approx(n * 1e6, abs=3000)
        assert 0.0 <= tick.lateness < 3e-6
        assert not tick.overrun


def test_a_period_that_is_not_a_whole_number_of_nanoseconds_does_not_drift(fake):
    clock = RealClock(3000.0)
    clock.wait()
    first = fake.ns
    for _ in range(30_000):
        clock.wait()
    assert (fake.ns - first) * 1e-9 == pytest.approx(10.0, abs=5e-6)


def test_a_late_tick_is_an_overrun_and_the_next_is_on_time_again(fake):
    clock = RealClock(1000.0)
    clock.wait()
    first = fake.ns
    fake.work(1.4e-3)
    late = clock.wait()
    assert late.overrun
    assert late.skipped == 0
    assert late.lateness == pytest.approx(0.4e-3, abs=5e-6)
    assert not clock.wait().overrun
    assert fake.ns - first == pytest.approx(2e6, abs=3000)


def test_whole_missed_periods_are_skipped(fake):
    clock = RealClock(1000.0)
    clock.wait()
    first = fake.ns
    fake.work(4.3e-3)
    late = clock.wait()
    assert (late.overrun, late.skipped) == (True, 3)
    assert late.lateness == pytest.approx(0.3e-3, abs=5e-6)
    clock.wait()
    assert fake.ns - first == pytest.approx(5e6, abs=3000)


def test_real_time_passes_in_real_time():
    clock = RealClock(1000.0)
    start = time.monotonic()
    for _ in range(51):
        clock.wait()
    assert time.monotonic() - start >= 0.05
    assert clock.now() >= 0.05


def test_virtual_time_advances_only_by_ticks():
    clock = VirtualClock(1000.0)
    assert clock.now() == 0.0
    for n in range(1000):
        assert clock.wait() == (0.0, False, 0, 0.0)
        assert clock.now() == n / 1000.0


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("make", [RealClock, VirtualClock])
def test_a_rate_that_is_not_positive_is_refused(make, rate):
    with pytest.raises(ValueError, match="rate must be positive"):
        make(rate)


@pytest.mark.parametrize("rate", [1000.0, 2000.0, 4000.0, 6000.0])
def test_the_loop_sleeps_in_each_second_so_that_linux_does_not_suspend_it(rate, fake, monkeypatch):
    """Linux suspends a process in real time that uses more than 95 % of its processor."""
    slept = []
    monkeypatch.setattr(time, "sleep", lambda seconds: (slept.append(seconds), fake.work(seconds)))
    clock = RealClock(rate)
    for _ in range(round(rate)):
        assert clock.wait().skipped == 0
        fake.work(70e-6)
    assert sum(slept) > 0.1
