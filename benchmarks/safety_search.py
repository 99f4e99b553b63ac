"""Search at random for violations of the safety rules.

    python benchmarks/safety_search.py --trials 20000

Hypothesis runs a controller on the simulated rig with one or more faults at random ticks: wrong
measurements, calls of the rig that fail before or after their effect, exceptions in the condition,
a rig whose time stands still or jumps, skipped periods of the loop, and
requests in every mode. Each trial has drives that accept velocities, forces or positions, a law of
force feedback, a channel between master and slave,
and a live page that can arm the drives, that only watches, or none. Page, live process and channel
fail too, and the page makes requests at any time. After every tick, the rules in
`SafetySearch.check` must hold for the simulated plant. A trial that violates a rule is reduced to
the shortest such trial, and printed. Without a violation, a table of what the trials contained is
printed.
"""

from __future__ import annotations

import argparse
import math
import shlex
import sys
import time
from collections import Counter, defaultdict
from datetime import date
from functools import cache
from typing import Any, ClassVar

import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    precondition,
    rule,
    run_state_machine_as_test,
)
from page_in_process import InProcess
from private_stream import private_stream
from search_rig import BOUND, LIMITS, PERIOD, Pushing, SearchRig

from drivers import CHANNELS, STANDSTILL, RigError
from estimation import paper_preset
from sim_backend import ForceMaster, ForceSlave
from sim_backend.faults import Frozen, Replaced, Reported, RigFault, Runaway, Shifted
from teleop.control.bilateral import BilateralLink
from teleop.control.channel import ChannelSettings
from teleop.control.clock import Tick
from teleop.control.controller import Controller
from teleop.control.feedback.settings import FeedbackSettings
from teleop.live.cells import ARM, END, LONGEST_ROUND_TRIP, PROCESS, STOP
from teleop.safety import Fault, Mode, stops_immediately
from teleop.safety.channels import DetectedFault
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.assembly import make_layout, make_link
from teleop.trial.page_requests import PAGE_AGE, PROCESS_SILENCE
from teleop.trial.stop_switch import StopSwitch

AXES = (
    *(("velocity", "velocity"), ("force", "velocity"), ("velocity", "force")),
    *(("velocity", "position"), ("force", "force"), ("force", "position")),
)
"""What the drives of master and slave accept."""
LAWS = ("none", "position-force", "model-mediated")
CHANNELS_BETWEEN = (
    None,
    ChannelSettings(0.025, 5e-3, 0.05),
    ChannelSettings(0.2, 0.1, 0.5),
    ChannelSettings(max_silence=0.01),
)
PAGES = ("none", "watches", "arms")
"""What the live page may do: there is none, it watches and stops, or it also arms the drives."""
STORED = 500
"""Number of ticks in the stream."""
DEPTHS = (0.0, 2e-3, 0.012, -0.05, 0.1, 1e6, -1e300, 9e15, math.nan, math.inf)
"""Positions of the pointer [m]."""
MESSAGES = (
    *("", "null", "{", '{"type": "beat"}', '{"type": "hello", "token": "", "view": "main"}'),
    *(f'{{"type": "beat", "seen": {seen}, "at": 0}}' for seen in (-1, 0, 1e9, "NaN", "1e999")),
)
"""Messages of a page that are not valid requests, and confirmations of what it has not received."""


@cache
def settings_of(law: str, channel: ChannelSettings | None) -> TrialSettings:
    return TrialSettings(
        condition="free",
        cube="soft",
        clock="virtual",
        feedback=FeedbackSettings(law),  # type: ignore[arg-type]
        channel=channel,
        custom_limits=LIMITS,
    )


class SafetySearch(RuleBasedStateMachine):
    """Runs a controller with the events that hypothesis chooses, and checks each tick."""

    counts: ClassVar[defaultdict[tuple[str, str], Counter[str]]] = defaultdict(Counter)
    """What the trials contained, by the kinds of the axes and what the page may do."""

    @initialize(
        force=st.sampled_from([1.5, -1.0]),
        ticks=st.sampled_from([0, 3, 8, 60, 60, 60]),
        arm=st.sampled_from([True, True, True, False]),
        law=st.sampled_from(LAWS),
        channel=st.sampled_from(CHANNELS_BETWEEN),
        may=st.sampled_from(PAGES),
        pointer=st.booleans(),
        press=st.sampled_from([True, True, True, False]),
        axes=st.sampled_from(AXES),
        latency=st.sampled_from([1, 1, 2]),
    )
    def start(
        self,
        force: float,
        ticks: int,
        arm: bool,
        law: str,
        channel: ChannelSettings | None,
        may: str,
        pointer: bool,
        press: bool,
        axes: tuple[str, str],
        latency: int,
    ) -> None:
        self.n = 0
        self.settings = settings_of(law, channel)
        self.layout = make_layout(self.settings, paper_preset("soft").bank())
        self.unknown = np.full((1, len(self.layout.schema.estimation)), np.nan)
        """Estimates of a tick: there is no estimation."""
        self.page: InProcess | None = None
        self.by_page = may == "arms"
        if may != "none":
            self.page = InProcess(self.by_page, pointer, self.now)
        operator = self.page.make_operator() if self.page else None
        master = ForceMaster(max_force=200.0, latency=latency) if axes[0] == "force" else None
        slave = ForceSlave(latency=latency) if axes[1] == "force" else axes[1]
        self.rig = SearchRig(self.now, operator, master, slave)  # type: ignore[arg-type]
        self.condition = Pushing()
        self.condition.force = None if operator else force
        self.link = make_link(self.settings)
        self.controller = Controller(
            self.rig,
            self.condition,
            self.link,
            PERIOD,
            LIMITS,
        )
        self.rig.open()
        self.switch = StopSwitch()
        self.arm, self.halt, self.skipped = arm, False, 0
        self.faults: tuple[DetectedFault, ...] = ()
        self.tripped = math.inf
        """True time at which the mode fault began [s]; infinite in any other mode."""
        self.energised = False
        self.command, self.still = STANDSTILL, 0.0
        """The last command, and the time for which the rig's time has stood still [s]."""
        self.cut = [0.0, 0.0]
        """Time for which each direction of the channel has been interrupted while the drives were
        armed [s]."""
        self.count = self.counts[" ".join(axes), may]
        self.count[law] += 1
        self.count["trials"] += 1
        self.count["channel"] += channel is not None
        self.begin()
        self.tick(ticks)
        if self.by_page and press:
            self.tick(30)  # until the page shows that the trial can be started
            self.page_arms(ticks)

    def now(self) -> float:
        return self.n * PERIOD

    def begin(self) -> None:
        """Begin a trial in the live page."""
        if self.page:
            at_begin = [*self.page.counts]
            if not self.by_page:
                at_begin[STOP] = self.page._stops  # a STOP between two trials stops the next one
            self.at_begin = at_begin
            self.stream = private_stream(self.layout, STORED, self.now)
            self.estimates = self.stream.reader().estimates_writer()
            self.switch.page = self.page.begin(self.settings, self.stream)
            self.beats = self.page.counts[PROCESS]
            self.heard = self.now()

    @rule(ticks=st.sampled_from([1, 2, 5, 20, 60, 130, 400]))
    def run_ticks(self, ticks: int) -> None:
        self.tick(ticks)

    @rule(channel=st.sampled_from(CHANNELS), data=st.data())
    def sensor(self, channel: str, data: Any) -> None:
        values = [math.nan, math.inf, -math.inf, 1e300, 3.0, 0.3, -0.02, 0.016, 90.0, -200.0]
        fault: RigFault = data.draw(
            st.one_of(
                st.builds(Replaced, st.just(channel), st.sampled_from(values)),
                st.builds(
                    Shifted,
                    st.just(channel),
                    st.sampled_from([0.0, 1e-3, 0.02, 30.0]),
                    st.sampled_from([0.0, 0.1, 1e3]),
                ),
                st.builds(Frozen, st.just(channel), st.booleans()),
            )
        )
        self.rig.faulty.inject(fault)
        self.tick(1)

    @rule(
        fault=st.one_of(
            st.just(Reported("over-current")),
            st.just(Reported(emergency_stop=True)),
            st.builds(Runaway, st.sampled_from([-0.1, 0.02, 0.2])),
        )
    )
    def report(self, fault: RigFault) -> None:
        self.rig.faulty.inject(fault)
        self.tick(1)

    @rule()
    def clear_faults(self) -> None:
        self.rig.faulty.inject(RigFault())
        self.rig.failing.clear()
        self.rig.standing = False
        self.condition.error = None
        self.halt, self.faults = False, ()
        self.switch.count, self.switch.reason, self.switch.key.pressed = 0, "", False
        self.interrupt(False, False)
        if self.page:
            self.page.resume()
            self.page.beats, self.page.delay = True, 0.0
            self.page.connect()
        self.tick(1)

    @rule(
        calls=st.sampled_from([["read"], ["enable"], ["write"], ["idle"], ["write", "idle"]]),
        when=st.sampled_from(["before", "after"]),
    )
    def calls_fail(self, calls: list[str], when: str) -> None:
        self.rig.failing |= dict.fromkeys(calls, when)
        self.tick(1)

    @rule(jump=st.sampled_from([None, -1e-9, -1.0, 0.01, 0.05, 0.2, 1e9, math.nan]))
    def rig_time(self, jump: float | None) -> None:
        if jump is None:
            self.rig.standing = True
        else:
            self.rig.offset += jump
        self.tick(1)

    @rule(skipped=st.sampled_from([1, 3, 30, 200]))
    def loop_skips(self, skipped: int) -> None:
        self.skipped = skipped
        self.tick(1)

    @rule(force=st.sampled_from([0.0, 3.0, -3.0, 1e6, math.nan, math.inf]), fails=st.booleans())
    def condition_does(self, force: float, fails: bool) -> None:
        self.condition.force = force
        self.condition.error = ZeroDivisionError("condition") if fails else None
        self.tick(1)

    @rule(
        arm=st.booleans(),
        stop=st.sampled_from(["", "Ctrl-C"]),
        halt=st.sampled_from([False, False, True]),
        fault=st.sampled_from([None, None, *Fault]),
    )
    def request(self, arm: bool, stop: str, halt: bool, fault: Fault | None) -> None:
        self.arm, self.halt = arm, halt
        self.switch.count, self.switch.reason = bool(stop) + halt, stop
        self.faults = (DetectedFault(fault, "key", math.nan, math.nan, math.nan),) if fault else ()
        self.tick(1)

    @precondition(lambda self: isinstance(self.link, BilateralLink))
    @rule(reports=st.booleans(), motions=st.booleans(), ticks=st.sampled_from([1, 60, 450]))
    def interrupt_channel(self, reports: bool, motions: bool, ticks: int) -> None:
        self.interrupt(reports, motions)
        self.wait(ticks)

    def wait(self, ticks: int) -> None:
        """Run the ticks after which a failure must be detected; few, if nothing can move soon."""
        self.tick(ticks if self.controller.mode in (Mode.READY, Mode.ACTIVE) else min(ticks, 20))

    def interrupt(self, reports: bool, motions: bool) -> None:
        if isinstance(self.link, BilateralLink):
            self.link.reports.cut, self.link.motions.cut = reports, motions

    @precondition(lambda self: self.by_page)
    @rule(ticks=st.sampled_from([1, 20, 100]))
    def start_in_page(self, ticks: int) -> None:
        self.page_arms(ticks)

    def page_arms(self, ticks: int) -> None:
        """Do what a person does who starts the trial in the page."""
        assert self.page
        self.page.arm()
        self.tick(ticks)

    @precondition(lambda self: self.page)
    @rule(
        kind=st.sampled_from(
            ["stop", "stop", "end", "control", "release", "unlock", "start", "next"]
        ),
        ticks=st.sampled_from([1, 1, 20]),
    )
    def page_requests(self, kind: str, ticks: int) -> None:
        assert self.page
        self.page.send(kind, **({"prompt": 0} if kind == "next" else {}))
        self.tick(ticks)

    @precondition(lambda self: self.page)
    @rule(message=st.sampled_from(MESSAGES))
    def page_sends(self, message: str) -> None:
        assert self.page
        self.page.send_text(message)
        self.tick(1)

    @precondition(lambda self: self.page and self.page._has_pointer)
    @rule(
        depths=st.lists(st.sampled_from(DEPTHS), min_size=1, max_size=8),
        grip=st.booleans(),
        raw=st.booleans(),
        ticks=st.sampled_from([1, 5, 40, 200]),
    )
    def pointer_moves(self, depths: list[float], grip: bool, raw: bool, ticks: int) -> None:
        """Move the pointer, in the page or in the cells."""
        assert self.page
        for depth in depths:
            if raw:
                self.page.cells.point(depth, grip)
            else:
                self.page.send("control")
                self.page.send("pointer", depth=depth, grip=grip)
            self.tick(ticks)

    @precondition(lambda self: self.page)
    @rule(
        cells=st.lists(st.sampled_from([STOP, END, ARM, PROCESS]), min_size=1, max_size=4),
        trial=st.booleans(),
        hung=st.sampled_from([0, 0, 320]),
    )
    def cells_change(self, cells: list[int], trial: bool, hung: int) -> None:
        """Write to the cells, as a live process that has gone wrong may do.

        If `trial` is False, they are written after the end of a trial, before the next one. The
        controller is the same in both trials. Before, the live process hangs for some ticks.
        """
        assert self.page
        if hung:
            self.page.suspend()
            self.wait(hung)
        if not trial:
            self.page.end_trial()
        for cell in cells:
            self.page.cells.count(cell)
        if not trial and self.controller.mode in (Mode.IDLE, Mode.READY):
            self.begin()
        self.tick(1)

    @precondition(lambda self: self.by_page)
    @rule(
        age=st.sampled_from([0.9, 1.1, -1e-3, -1e9, -math.inf, math.nan]),
        start=st.booleans(),
    )
    def confirmation_is_wrong(self, age: float, start: bool) -> None:
        """Confirm data of an age that may be negative or NaN; press START, if wanted."""
        assert self.page
        self.page.cells.confirm(self.now() + PERIOD - age)
        if start:
            self.page.cells.count(ARM)
        self.tick(1)

    @precondition(lambda self: self.page)
    @rule(
        failure=st.sampled_from(["silent", "behind", "closed", "floods", "process"]),
        ticks=st.sampled_from([1, 20, 320, 2100]),
    )
    def page_fails(self, failure: str, ticks: int) -> None:
        assert self.page
        if failure == "silent":
            self.page.silence()
        elif failure == "behind":
            self.page.slow_down()
        elif failure == "closed":
            self.page.disconnect()
        elif failure == "floods":
            self.page.flood()
        else:
            self.page.kill()
        self.wait(ticks)

    @precondition(lambda self: self.page)
    @rule(delay=st.sampled_from([0.0, 0.1, 0.2, 0.45]), ticks=st.sampled_from([1, 20, 320]))
    def connection_delays(self, delay: float, ticks: int) -> None:
        """Change the delay of the connection to the page."""
        assert self.page
        self.page.delay = delay
        self.wait(ticks)

    @precondition(lambda self: self.by_page)
    @rule(ticks=st.sampled_from([20, 320, 1500]))
    def start_waits(self, ticks: int) -> None:
        """Start the trial in the page while the live process hangs, which then continues."""
        assert self.page
        self.page.suspend()
        self.page.arm()
        self.wait(ticks)
        self.page.resume()
        self.tick(20)

    @precondition(lambda self: self.page)
    @rule(new=st.booleans())
    def page_returns(self, new: bool) -> None:
        """Continue the live process and the page; with `new`, a new page is opened."""
        assert self.page
        self.page.resume()
        self.page.beats, self.page.delay = True, 0.0
        if new:
            self.page.connect()
        self.tick(1)

    @precondition(lambda self: self.controller.mode is Mode.FAULT)
    @rule()
    def rearm(self) -> None:
        """Begin a new trial after a fault."""
        self.controller.rearm()
        self.tripped = math.inf
        if self.page:
            self.page.end_trial()
        self.begin()
        self.tick(1)

    def teardown(self) -> None:
        """Run until every time limit has passed."""
        if hasattr(self, "controller") and (self.rig.standing or self.tripped < math.inf):
            self.tick(round(2 * BOUND / PERIOD))
        if getattr(self, "page", None):
            self.page.end()  # type: ignore[union-attr]

    def tick(self, count: int) -> None:
        """Run ticks, each followed by the check."""
        for _ in range(count):
            before = self.controller.mode
            for _ in range(1 + self.skipped):
                self.n += 1
                if self.page:
                    self.page.advance()
            self.rig.calls.clear()
            if self.page:
                self.look()
            request = self.switch.request(self.arm)
            self.requested = request._replace(
                halt=request.halt or self.halt, faults=(*request.faults, *self.faults)
            )
            try:
                record = self.controller.tick(
                    Tick(0.0, self.skipped > 0, self.skipped), self.requested
                )
            except RigError:
                if self.controller._measurement is not None:
                    raise
                self.skipped = 0
                continue  # the very first reading may fail: nothing was enabled
            self.skipped = 0
            if self.page:
                self.stream.write(record)
                self.estimates.write(self.unknown)
                for event in record.events:
                    self.stream.event(event)
            self.check(record, before)
            self.count["ticks"] += 1
            self.count["active"] += record.mode is Mode.ACTIVE
            self.count["armed"] += record.mode is Mode.ACTIVE and before is Mode.READY
            self.count["faults"] += record.mode is Mode.FAULT and before is not Mode.FAULT

    def look(self) -> None:
        """Store when the live process was heard."""
        assert self.page
        beats = self.page.counts[PROCESS]
        if beats != self.beats:
            self.beats, self.heard = beats, self.now()

    def check(self, record: Any, before: Mode) -> None:
        """Check the safety rules."""
        calls = [name for name, _ in self.rig.calls]
        written = [command for name, command in self.rig.calls if name == "write"]
        now, m, mode = self.n * PERIOD, record.measurement, record.mode

        # Every command is finite and within its limits, and changes at most as fast as a ramp.
        limits = (
            (LIMITS.max_master_velocity, LIMITS.max_master_acceleration),
            (LIMITS.max_velocity, LIMITS.max_acceleration),
        )
        for command in written:
            for new, old, (speed, rate) in zip(command, self.command, limits, strict=True):
                assert abs(new) <= speed * (1 + 1e-9), command
                change = rate * record.dt if record.dt > 0.0 else 0.0
                slowed = abs(new - old) <= change * (1 + 1e-9) + 1e-12
                assert slowed or command == STANDSTILL, (self.command, command)
            self.command = command

        # The drives are enabled in ready mode only, and never while a stop is requested.
        if "enable" in calls:
            assert before is Mode.READY
            assert mode in (Mode.READY, Mode.ACTIVE)
            assert self.arm
            assert not self.requested.stop
            assert not self.requested.halt
            assert not self.requested.faults
            if self.page and self.by_page:
                assert self.page.counts[ARM] != self.at_begin[ARM], "nobody pressed START"
            self.check_page()
            self.energised = True

        # A dangerous measurement or request stops the drives in the same tick, in every mode.
        low, high = LIMITS.hard_position
        if "read" not in self.rig.failing:
            x, f, v = m.slave_position, m.contact_force, m.slave_velocity
            dangerous = (
                self.halt
                or any(stops_immediately(fault.fault) for fault in self.faults)
                or (self.page and self.page.counts[STOP] != self.at_begin[STOP])
                or m.emergency_stop
                or bool(m.drive_error)
                or LIMITS.hard_force < abs(f) < math.inf
                or high < x < math.inf
                or -math.inf < x < low
                or 2.0 * LIMITS.max_velocity < abs(v) < math.inf
            )
            if dangerous:
                assert all(command == STANDSTILL for command in written)
                assert not self.energised or "idle" in calls

        # A call that fails also stops the drives in the same tick.
        if self.energised and any(name in self.rig.failing for name in calls):
            assert "idle" in calls
            assert mode is Mode.FAULT or "read" not in self.rig.failing
        if "idle" in calls and "idle" not in self.rig.failing:
            self.energised = False

        # The drives of a rig whose time stands still are disabled within the time limit.
        self.still = self.still + PERIOD if self.rig.standing else 0.0
        if self.still > BOUND:
            assert not self.rig.sim._enabled

        # After a fault the drives are not enabled, and within the time limit they are disabled.
        if mode is Mode.FAULT:
            self.tripped = min(self.tripped, now)
            assert "enable" not in calls
            if now - self.tripped > BOUND:
                assert not self.rig.sim._enabled
                assert self.rig.sim._applied == STANDSTILL
        else:
            assert self.tripped == math.inf

        # Motors with a force input exert no force when the drives are disabled.
        if not self.rig.sim._enabled:
            assert not self.rig.pushes

        # No trial continues after a request to stop, a silent channel, an active law of force
        # feedback, or the loss of the live page that armed the drives.
        if mode is Mode.ACTIVE:
            assert not self.requested.stop
            assert not self.requested.faults
            self.check_page()
            self.check_link(record)
        else:
            self.cut = [0.0, 0.0]

        # Commands are zero except in the modes active, stopping and fault.
        if mode in (Mode.DISCONNECTED, Mode.IDLE, Mode.READY):
            assert all(command == STANDSTILL for command in written)

    def check_page(self) -> None:
        """Check the rules of a live page while the drives are armed."""
        if not self.page:
            return
        counts, now = self.page.counts, self.now()
        assert counts[STOP] == self.at_begin[STOP]
        assert counts[END] == self.at_begin[END]
        if self.by_page:
            assert now - self.heard <= PROCESS_SILENCE
            assert 0.0 <= now - self.page.seen <= PAGE_AGE
            assert self.page.armed_behind <= LONGEST_ROUND_TRIP

    def check_link(self, record: Any) -> None:
        """Check the rules of a channel and of force feedback while the drives are armed."""
        link = self.link
        if isinstance(link, BilateralLink):
            channel = self.settings.channel or ChannelSettings()
            longest = channel.max_silence + channel.delay + channel.jitter + 2 * PERIOD
            for i, direction in enumerate((link.reports, link.motions)):
                self.cut[i] = self.cut[i] + record.dt if direction.cut else 0.0
            assert max(self.cut) <= longest
            assert not link.values.port_energy < -link._master.law.allowance


def search(trials: int, seed: int | None = None) -> None:
    """Run a number of trials; raise AssertionError with a short trial if a rule is violated."""
    run_state_machine_as_test(
        SafetySearch if seed is None else seeded(seed)(SafetySearch),
        settings=settings(
            max_examples=trials,
            stateful_step_count=12,
            deadline=None,
            database=None,
            phases=[Phase.generate, Phase.shrink],
            suppress_health_check=list(HealthCheck),
        ),
    )


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    started = time.perf_counter()
    search(options.trials, options.seed)
    took = time.perf_counter() - started
    print(f"# python {shlex.join(sys.argv)}, {date.today()}")
    print(f"{options.trials} trials from seed {options.seed} in {took:.0f} s: no law was broken")
    print(f"{'master, slave':<20}{'page':<9}{'trials':>8}{'channel':>9}{'armed':>7}{'faults':>8}"
          f"{'time [s]':>10}{'active [s]':>12}")  # fmt: skip
    for (axes, may), count in sorted(SafetySearch.counts.items()):
        print(f"{axes:<20}{may:<9}{count['trials']:>8}{count['channel']:>9}{count['armed']:>7}"
              f"{count['faults']:>8}{count['ticks'] * PERIOD:>10.1f}"
              f"{count['active'] * PERIOD:>12.1f}")  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
