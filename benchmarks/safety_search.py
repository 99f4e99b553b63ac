"""Search at random for violations of the safety rules.

    python benchmarks/safety_search.py --trials 20000

Hypothesis runs a controller on the simulated rig with one or more faults at random ticks: wrong
measurements, calls of the rig that fail before or after their effect, exceptions in the condition
and in an estimator, a rig whose time stands still or jumps, skipped periods of the loop, and
requests in every mode. After every tick, the rules in `SafetySearch.check` must hold for the
simulated plant. A trial that violates a rule is reduced to the shortest such trial, and printed.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from typing import Any

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
from search_rig import BOUND, LIMITS, PERIOD, Pushing, SearchRig

from drivers import CHANNELS, STANDSTILL, RigError
from estimation import MatchedFilter, paper_preset
from sim_backend.faults import Frozen, Replaced, Reported, RigFault, Runaway, Shifted
from teleop.control.admittance import Admittance, AdmittanceParameters
from teleop.control.clock import Tick
from teleop.control.controller import Controller
from teleop.control.coupling import Coupling
from teleop.control.estimation import Estimation
from teleop.control.link import DirectLink
from teleop.safety import Fault, Mode, Request, stops_immediately
from teleop.safety.channels import DetectedFault


class SafetySearch(RuleBasedStateMachine):
    """Runs a controller with the events that hypothesis chooses, and checks each tick."""

    @initialize(
        force=st.sampled_from([1.5, -1.0]),
        ticks=st.sampled_from([0, 3, 8, 60, 60, 60]),
        arm=st.sampled_from([True, True, True, False]),
    )
    def start(self, force: float, ticks: int, arm: bool) -> None:
        self.n = 0
        self.rig = SearchRig(lambda: self.n * PERIOD)
        self.condition = Pushing()
        self.condition.force = force
        self.bank = paper_preset("soft").bank()
        self.controller = Controller(
            self.rig,
            self.condition,
            DirectLink(Admittance(AdmittanceParameters()), Coupling()),
            Estimation(MatchedFilter(), self.bank),
            PERIOD,
            LIMITS,
        )
        self.rig.open()
        self.arm, self.stop, self.halt, self.skipped = arm, "", False, 0
        self.faults: tuple[DetectedFault, ...] = ()
        self.tripped = math.inf
        """True time at which the mode fault began [s]; infinite in any other mode."""
        self.energised = False
        self.command, self.still = STANDSTILL, 0.0
        """The last command, and the time for which the rig's time has stood still [s]."""
        self.tick(ticks)

    @rule(ticks=st.sampled_from([1, 2, 5, 20, 60, 130]))
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
        self.bank.__dict__.pop("update", None)
        self.halt, self.stop, self.faults = False, "", ()
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

    @rule()
    def estimator_fails(self) -> None:
        def update(*arguments: Any) -> Any:
            raise ZeroDivisionError("estimator")

        self.bank.update = update  # type: ignore[method-assign]
        self.tick(1)

    @rule(
        arm=st.booleans(),
        stop=st.sampled_from(["", "Ctrl-C"]),
        halt=st.sampled_from([False, False, True]),
        fault=st.sampled_from([None, None, *Fault]),
    )
    def request(self, arm: bool, stop: str, halt: bool, fault: Fault | None) -> None:
        self.arm, self.stop, self.halt = arm, stop, halt
        self.faults = (DetectedFault(fault, "key", math.nan, math.nan, math.nan),) if fault else ()
        self.tick(1)

    @precondition(lambda self: self.controller.mode is Mode.FAULT)
    @rule()
    def rearm(self) -> None:
        self.controller.rearm()
        self.tripped = math.inf
        self.tick(1)

    def teardown(self) -> None:
        """Run until every time limit has passed."""
        if hasattr(self, "controller") and (self.rig.standing or self.tripped < math.inf):
            self.tick(round(2 * BOUND / PERIOD))

    def tick(self, count: int) -> None:
        """Run ticks, each followed by the check."""
        for _ in range(count):
            before = self.controller.mode
            self.n += 1 + self.skipped
            self.rig.calls.clear()
            try:
                record = self.controller.tick(
                    Tick(0.0, self.skipped > 0, self.skipped),
                    Request(self.arm, self.stop, self.halt, self.faults),
                )
            except RigError:
                if self.controller._measurement is not None:
                    raise
                self.skipped = 0
                continue  # the very first reading may fail: nothing was enabled
            self.skipped = 0
            self.check(record, before)

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
            assert not self.stop
            assert not self.halt
            assert not self.faults
            self.energised = True

        # A dangerous measurement or request stops the drives in the same tick, in every mode.
        low, high = LIMITS.hard_position
        if "read" not in self.rig.failing:
            x, f, v = m.slave_position, m.contact_force, m.slave_velocity
            dangerous = (
                self.halt
                or any(stops_immediately(fault.fault) for fault in self.faults)
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

        # Commands are zero except in the modes active, stopping and fault.
        if mode in (Mode.DISCONNECTED, Mode.IDLE, Mode.READY):
            assert all(command == STANDSTILL for command in written)


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
    print(f"{options.trials} trials from seed {options.seed} in {took:.0f} s: no law was broken")
    return 0


if __name__ == "__main__":
    sys.exit(main())
