"""Requests of the live page as the loop reads them."""

from __future__ import annotations

import math
import mmap

import pytest

from teleop.live.cells import (
    ARM,
    END,
    LONGEST_ROUND_TRIP,
    PROCESS,
    SIZE,
    STOP,
    CellReader,
    CellWriter,
)
from teleop.safety import Fault
from teleop.trial.page_requests import PagePointer, PageRequests
from teleop.trial.stop_switch import StopSwitch

PAGE = -1
"""Stands for the confirmations of the page, which are no counter."""


class Page:
    """The live process and a page that beat, on a time of their own."""

    def __init__(self):
        self.now = 0.0
        buffer = mmap.mmap(-1, SIZE)
        self.writer, self.reader = CellWriter(buffer), CellReader(buffer)

    def begin(self, by_page=True, stops=0):
        self.switch = StopSwitch()
        self.switch.page = PageRequests(self.reader, by_page, stops, lambda: self.now)
        return self

    def after(self, seconds, *beats, delay=0.0):
        """Advance in steps of 10 ms with these heartbeats; return the last request.

        The data that the page confirms were sent `delay` before.
        """
        for _ in range(round(seconds * 100)):
            self.now += 0.01
            for cell in beats:
                if cell == PAGE:
                    self.writer.confirm(self.now - delay)
                else:
                    self.writer.count(cell)
            request = self.switch.request(True)
        return request

    def press(self, cell):
        self.writer.count(cell)
        return self.after(0.01, PROCESS, PAGE)


@pytest.fixture
def one():
    return Page().begin()


def test_the_drives_are_armed_only_after_start(one):
    assert not one.after(5.0, PROCESS, PAGE).arm
    assert one.press(ARM).arm


def test_requests_before_the_trial_have_no_effect():
    one = Page().begin()
    for cell in (STOP, END, ARM):
        one.press(cell)
    later = one.begin().after(0.1, PROCESS, PAGE)
    assert (later.arm, later.stop, later.faults) == (False, "", ())


def test_stop_while_a_trial_armed_at_the_terminal_is_prepared_stops_it():
    one = Page().begin()
    one.press(STOP)
    assert one.begin(by_page=False, stops=0).after(0.01).faults
    assert not one.begin(by_page=False, stops=1).after(0.01).faults


def test_stop_is_an_emergency_stop_and_end_a_ramp(one):
    one.press(ARM)
    assert one.press(END).stop == "ended from the live page"
    assert one.switch.interrupted
    assert [fault.fault for fault in one.press(STOP).faults] == [Fault.EMERGENCY_STOP]


@pytest.mark.parametrize(("beats", "most"), [((), 0.31), ((PAGE,), 0.31), ((PROCESS,), 1.01)])
def test_silence_of_process_or_page_stops_a_trial_that_the_page_armed(one, beats, most):
    one.press(ARM)
    assert not one.after(most - 0.02, *beats).faults
    (fault,) = one.after(0.03, *beats).faults
    assert fault.fault is Fault.PAGE_LOST


@pytest.mark.parametrize(("delay", "stops"), [(0.9, False), (1.1, True)])
def test_a_page_that_is_far_behind_stops_a_trial_although_it_beats(one, delay, stops):
    one.press(ARM)
    faults = one.after(5.0, PROCESS, PAGE, delay=delay).faults
    assert [fault.fault for fault in faults] == [Fault.PAGE_LOST] * stops
    assert not stops or "confirmed no data of the last 1 s" in faults[0].source


@pytest.mark.parametrize("seen", [1e-3, 1e9, math.inf, math.nan])
def test_a_confirmation_at_an_impossible_time_does_not_hide_the_loss_of_the_page(one, seen):
    one.press(ARM)
    one.writer.confirm(one.now + 0.01 + seen)
    assert [fault.fault for fault in one.after(0.01, PROCESS).faults] == [Fault.PAGE_LOST]


@pytest.mark.parametrize("seen", [1.0, math.nan])
def test_start_and_the_hand_need_a_confirmation_at_a_possible_time(one, seen):
    pointer = PagePointer(one.reader, lambda: one.now)
    one.after(0.1, PROCESS, PAGE)
    one.writer.confirm(one.now + seen)
    one.writer.count(ARM)
    one.writer.point(0.004, True)
    assert not one.after(0.01, PROCESS).arm
    assert not pointer()[1]


def test_the_fault_remains_when_the_process_is_back(one):
    one.press(ARM)
    one.after(0.4)
    assert one.after(1.0, PROCESS, PAGE).faults


def test_a_trial_that_waits_for_start_ends_without_a_fault_if_the_process_is_lost(one):
    assert one.after(3.0, PROCESS).stop == ""  # no page needs to be open yet
    assert one.after(4.9).stop == ""  # a busy machine
    request = one.after(0.2)
    assert "live process was silent" in request.stop
    assert not request.faults


def test_start_from_a_live_process_that_was_silent_does_not_arm_the_drives(one):
    one.after(1.0)
    one.writer.count(ARM)
    assert not one.after(0.01).arm
    assert not one.after(1.0, PROCESS, PAGE).arm  # it is not carried out later
    assert one.press(ARM).arm


def test_a_trial_armed_at_the_terminal_does_not_need_the_page():
    one = Page().begin(by_page=False)
    request = one.after(5.0)
    assert request.arm
    assert (request.stop, request.faults) == ("", ())
    assert one.press(STOP).faults


def test_the_pointer_lets_go_after_silence_and_at_release():
    one = Page()
    pointer = PagePointer(one.reader, lambda: one.now)
    one.writer.confirm(0.0)
    assert pointer() == (0.0, False)
    one.writer.point(0.004, True)
    assert pointer() == (0.004, True)
    one.now = 0.14
    assert pointer() == (0.004, True)
    one.now = 0.16
    assert pointer() == (0.004, False)
    one.writer.point(0.005, True)
    assert pointer() == (0.005, True)
    one.writer.point(0.005, False)
    assert pointer() == (0.005, False)


def test_a_pointer_that_was_held_before_the_trial_is_not_held_in_it():
    one = Page()
    one.writer.point(0.004, True)
    assert PagePointer(one.reader, lambda: one.now)() == (0.0, False)


def test_the_hand_does_not_hold_the_handle_while_the_page_is_behind():
    one = Page()
    pointer = PagePointer(one.reader, lambda: one.now)

    def hold(delay):
        one.now += 0.1
        one.writer.confirm(one.now - delay)
        one.writer.point(0.004, True)
        return pointer()[1]

    assert hold(0.9 * LONGEST_ROUND_TRIP)
    assert not hold(1.1 * LONGEST_ROUND_TRIP)
    assert hold(0.0)
