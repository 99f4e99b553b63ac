"""Define the kinds of fault of the campaign: injection, permitted reports, and time limit."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fault_case import FLUSHED, Case
from fault_evidence import (
    accelerated,
    after_stall,
    at_once,
    handle_moved,
    moved,
    moves_on,
    over_force,
)
from fault_links import CHANNEL, activate, gave_energy, silence

from drivers import CHANNELS
from sim_backend import Cube
from sim_backend.body import root
from sim_backend.faults import (
    Disobedient,
    Frozen,
    Replaced,
    Reported,
    RigFault,
    Runaway,
    Shifted,
    Unplugged,
)
from sim_backend.plant import Intention
from teleop.safety import Fault
from teleop.settings.simulated_rig_limits import BRAKING_TIME
from teleop.trial.page_requests import PAGE_AGE, PROCESS_SILENCE

PERIOD = 1e-3
RAMP = BRAKING_TIME + PERIOD
WATCHDOG = 0.1
FOUND = 2 * FLUSHED * PERIOD
"""Longest time until the recorder notices that it cannot write [s]: it writes when it flushes."""

Inject = Callable[[Case], Any]
Evidence = Callable[[Case, float, float], bool]
"""Function that returns whether a fault can be detected. Its arguments are the case, and the
commanded travel [m] and change of velocity [m/s] since the injection."""


@dataclass
class Kind:
    """A kind of fault."""

    inject: Inject
    faults: frozenset[Fault | None]
    """Faults that may be reported; contains None if the run may continue without a fault."""
    bound: float
    """Longest time from when the fault can be detected to a commanded speed of zero [s]."""
    source: str = ""
    """Source that must be reported with the fault; empty for any source."""
    evidence: Evidence = at_once
    """Function that returns whether the fault can be detected yet."""
    notes: bool = False
    """Whether an event must state that there are no estimates."""
    ends: bool = False
    """Whether the run must end with a stop that is not a fault."""
    obeys: bool = True
    """Whether the drive obeys a stop. If not, the contact force is not checked."""
    linked: bool = False
    """Whether the kind needs force feedback over a channel."""
    paged: bool = False
    """Whether the kind needs a live page that armed the drives."""


def rig_fault(make: Callable[[Case], RigFault]) -> Inject:
    return lambda case: case.rig.inject(make(case))


def raiser(*arguments: Any) -> Any:
    raise ZeroDivisionError("injected")


def break_estimator(case: Case) -> None:
    case.bank["rls"].state = None  # type: ignore[assignment]


def break_condition(case: Case) -> None:
    case.controller._condition.drive_force = raiser


def runaway(case: Case) -> RigFault:
    fastest = case.limits.max_velocity
    return Runaway(case.random.choice((-1.0, 1.0)) * case.random.uniform(0.3, 1.0) * fastest)


def disobey(case: Case) -> None:
    """Press the stop key; the drive moves on, and may report that it is disabled."""
    velocity = case.random.choice((-1.0, 1.0)) * case.random.uniform(0.1, 1.0)
    fault = Disobedient(velocity * case.limits.max_velocity, case.random.random() < 0.5)
    case.rig.inject(fault)
    press(case)


class Shove:
    """An operator who pushes to three times the depth, at half of the maximum speed."""

    def __init__(self, case: Case) -> None:
        self.before, self.start = case.sim._operator, case.clock.now() - case.sim._start
        self.depth, self.speed = 3.0 * case.settings.setup.depth, 0.5 * case.limits.max_velocity

    def intention(self, t: float) -> Intention:
        base = self.before.intention(t)
        push = min(self.speed * (t - self.start), self.depth)
        return Intention(base.position + push, base.velocity)

    def feel(self, t: float, position: float, force: float) -> None:
        self.before.feel(t, position, force)


def shove(case: Case) -> None:
    if case.sim._operator:
        case.sim._operator = Shove(case)
        return
    injected = case.controller._condition.drive_force
    case.controller._condition.drive_force = lambda t, m: 4.0 * injected(t, m)


class Inclusion(Cube):
    """A cube with an inclusion. Below a certain depth, it adds a stiffness of ten times k1."""

    def force(self, x: float, v: float) -> float:
        hard = max(x - self.inside, 0.0) * self.stiffness_inside  # type: ignore[attr-defined]
        return super().force(x, v) + hard

    def stiffness(self, x: float) -> float:
        inside = x > self.inside  # type: ignore[attr-defined]
        return super().stiffness(x) + (self.stiffness_inside if inside else 0.0)  # type: ignore[attr-defined]

    def compressed(self, x: float, compliance: float) -> float:
        y = super().compressed(x, compliance)
        if y <= self.inside:  # type: ignore[attr-defined]
            return y
        added = compliance * self.stiffness_inside  # type: ignore[attr-defined]
        linear = 1.0 + compliance * self.k1 + added
        return root(linear, compliance * self.k3, x + added * self.inside)  # type: ignore[attr-defined]


def include(case: Case) -> None:
    slave = case.sim.plant.slave
    law = slave.law
    cube = Inclusion(law.k1, law.k3, law.b)
    object.__setattr__(cube, "inside", max(slave.x, 0.3 * case.settings.setup.depth))
    object.__setattr__(cube, "stiffness_inside", 10.0 * cube.k1)
    slave.palpate(cube)


def interrupt(times: int) -> Inject:
    def signal(case: Case) -> None:
        case.switch.count, case.switch.reason = times, "Ctrl-C"

    return signal


def press(case: Case) -> None:
    case.switch.key.pressed = True


def lose(once: int, always: int) -> Inject:
    def stall(case: Case) -> None:
        case.clock.once, case.clock.losing = once, always

    return stall


def sensor_kinds() -> dict[str, Kind]:
    kinds = {}
    for channel in CHANNELS:
        quantity = channel.rpartition("_")[2]
        step = {"force": 120.0, "position": 0.1, "velocity": 1.5}[quantity]
        beyond = {"force": 3000.0, "position": 3.0, "velocity": 9.0}[quantity]

        def kind(
            make: Callable[[], RigFault], fault: Fault, bound: float, c: str = channel, **more: Any
        ) -> Kind:
            return Kind(rig_fault(lambda case: make()), frozenset({fault}), bound, c, **more)

        force = quantity == "force"
        kinds |= {
            f"{channel} NaN": kind(
                lambda c=channel: Replaced(c, math.nan), Fault.NOT_A_NUMBER, RAMP
            ),
            f"{channel} infinite": kind(
                lambda c=channel: Replaced(c, -math.inf), Fault.INFINITE, RAMP
            ),
            f"{channel} out of range": kind(
                lambda c=channel, b=beyond: Replaced(c, b), Fault.OUT_OF_RANGE, RAMP
            ),
            f"{channel} jump": kind(lambda c=channel, s=step: Shifted(c, s), Fault.JUMP, RAMP),
            f"{channel} stale": kind(
                lambda c=channel: Frozen(c, ageing=True), Fault.STALE, 0.02 + RAMP + PERIOD
            ),
            f"{channel} frozen": kind(
                lambda c=channel: Frozen(c, ageing=False),
                Fault.FROZEN,
                (0.05 if force else 0.0) + RAMP + 2 * PERIOD,
                evidence={
                    "master_position": handle_moved,
                    "slave_position": moved,
                    "slave_velocity": accelerated,
                }.get(channel, at_once),
            ),
        }
    return kinds


def late_jumps() -> None:
    """Allow a limit fault for a jump in real time.

    If the next tick is late, the jump is possible as a motion in this time. It is then not detected
    as a jump, but as a value that exceeds a limit.
    """
    for channel, fault in (
        ("contact_force", Fault.FORCE_LIMIT),
        ("slave_position", Fault.POSITION_LIMIT),
        ("slave_velocity", Fault.VELOCITY_LIMIT),
    ):
        KINDS[f"{channel} jump"].faults |= {fault}


def recorder(failure: str) -> Inject:
    return lambda case: getattr(case.readers, failure)()


def die(case: Case) -> None:
    case.killed = True


def page_kinds() -> dict[str, Kind]:
    """Return the faults of the live page in which the drives were armed, and of its process."""

    def page(action: str, *arguments: str) -> Inject:
        return lambda case: getattr(case.page, action)(*arguments)

    lost, alone = frozenset({Fault.PAGE_LOST}), PAGE_AGE + RAMP + PERIOD
    process = {"bound": PROCESS_SILENCE + RAMP + PERIOD, "paged": True}
    return {
        "page: STOP": Kind(
            page("send", "stop"),
            frozenset({Fault.EMERGENCY_STOP}),
            PERIOD,
            "live page",
            paged=True,
        ),
        "page: END": Kind(page("send", "end"), CONTINUES, RAMP, ends=True, paged=True),
        "page silent": Kind(page("silence"), lost, alone, paged=True),
        "page far behind": Kind(page("slow_down"), lost, alone, paged=True),
        "page closed": Kind(page("disconnect"), lost, alone, paged=True),
        "page floods": Kind(page("flood"), lost, alone, paged=True),
        "another page floods": Kind(page("flood_another"), CONTINUES, math.inf, paged=True),
        "live process killed": Kind(page("kill"), lost, **process),
        "live process suspended": Kind(page("suspend"), lost, **process),
    }


CONTINUES: frozenset[Fault | None] = frozenset({None})
KINDS = sensor_kinds() | {
    "drive error": Kind(
        rig_fault(lambda case: Reported("overcurrent")), frozenset({Fault.DRIVE_ERROR}), PERIOD
    ),
    "emergency-stop input": Kind(
        rig_fault(lambda case: Reported(emergency_stop=True)),
        frozenset({Fault.EMERGENCY_STOP}),
        PERIOD,
    ),
    "emergency-stop key": Kind(press, frozenset({Fault.EMERGENCY_STOP}), PERIOD),
    "contact force over limit": Kind(
        rig_fault(lambda case: Shifted("contact_force", 0.0, 3000.0)),
        # the drive does not deflect under this force, which may be detected first
        frozenset({Fault.FORCE_LIMIT, Fault.NOT_FOLLOWING}),
        PERIOD,
        evidence=over_force,
    ),
    "inclusion in the tissue": Kind(
        include, frozenset({None, Fault.FORCE_LIMIT}), PERIOD, evidence=over_force
    ),
    "operator pushes past limits": Kind(shove, CONTINUES, math.inf),
    "runaway plant": Kind(
        rig_fault(runaway),
        frozenset({Fault.NOT_FOLLOWING, Fault.VELOCITY_LIMIT, Fault.FROZEN}),
        0.1,
    ),
    "drive does not obey a stop": Kind(
        disobey,
        frozenset({Fault.MOVES_AFTER_STOP}),
        math.inf,
        evidence=moves_on,
        obeys=False,
    ),
    "rig unplugged": Kind(
        rig_fault(lambda case: Unplugged()), frozenset({Fault.RIG_FAILURE}), PERIOD
    ),
    "loop stalls 200 ms": Kind(
        lose(200, 0), frozenset({Fault.OVERRUN}), PERIOD, evidence=after_stall
    ),
    "loop skips 3 of 4 periods": Kind(lose(0, 3), frozenset({Fault.OVERRUN}), 0.5),
    "exception in an estimator": Kind(break_estimator, CONTINUES, math.inf, notes=True),
    "exception in the condition": Kind(break_condition, frozenset({Fault.CONTROL_FAILURE}), RAMP),
    "disk full": Kind(recorder("fill"), CONTINUES, FOUND + RAMP, ends=True),
    "recorder killed": Kind(recorder("kill"), CONTINUES, RAMP + 2 * PERIOD, ends=True),
    "controller killed": Kind(die, CONTINUES, WATCHDOG + PERIOD),
    "channel silent": Kind(
        silence,
        frozenset({Fault.CHANNEL_SILENT}),
        CHANNEL.max_silence + CHANNEL.delay + CHANNEL.jitter + RAMP + 2 * PERIOD,
        linked=True,
    ),
    "active feedback law": Kind(
        activate,
        frozenset({Fault.PORT_ENERGY}),
        RAMP + PERIOD,
        evidence=gave_energy,
        linked=True,
    ),
    **page_kinds(),
    "Ctrl-C": Kind(interrupt(1), CONTINUES, RAMP, ends=True),
    "Ctrl-C twice": Kind(interrupt(2), CONTINUES, PERIOD, ends=True),
}
