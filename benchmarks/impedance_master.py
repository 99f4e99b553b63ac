"""A force-commanded master: which couplings are accepted, and what the hand feels at the handle.

    python benchmarks/impedance_master.py --part gate --rigs 500 --seed 7
    python benchmarks/impedance_master.py --part release --rigs 100 --seed 7
    python benchmarks/impedance_master.py --part feedback --seeds 20 --first-seed 5000 [--rigid]

`gate` draws rigs at random and finds, for five hands, the largest stiffness of the coupling that is
stable. The loop is discretised with scipy.linalg.expm and shares no code with the check that
accepts a coupling. `release` lets go of a handle whose coupling has three times the accepted
stiffness, and measures when the rig reports it. `feedback` runs trials with model-mediated feedback
on the simulated rig, with delays of the channel of 0 to 250 ms; `--rigid` without lost motion.
"""

from __future__ import annotations

import argparse
import itertools
import math
import random
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from drivers.coupling import CouplingParameters
from sim_backend import CUBES, RIGID, ForceMaster, OperatorModel, paper_setup
from sim_backend.force_master import FreeHandle, make_axis
from teleop.control.channel import ChannelSettings
from teleop.control.feedback.settings import FeedbackSettings
from teleop.settings.trial_settings import TrialSettings
from teleop.trial.run import run_trial

HANDS = {
    "released": (0.0, 0.0, 0.0),
    "light": (150.0, 3.0, 0.1),
    "usual": (400.0, 12.0, 0.4),
    "firm": (1500.0, 25.0, 1.0),
    "blocked": (20000.0, 100.0, 2.0),
}
"""Stiffness [N/m], damping [N s/m] and mass [kg] of the hand that holds the handle."""
ARMS = (250.0, 400.0, 1500.0)
DELAYS = (0.0, 0.05, 0.1, 0.25)
AIM = 15.0
"""Force at which the hand reverses its motion [N], as in palpation by a person."""


class DrawnRig(NamedTuple):
    """A rig of the part `gate`."""

    mass: float
    friction: float
    latency: int
    damping: float
    bandwidth: float
    period: float

    def coupling(self, stiffness: float) -> CouplingParameters:
        return CouplingParameters(
            stiffness, self.damping, self.bandwidth, latency=self.latency, friction=self.friction
        )


def drawn_rig(draw: random.Random) -> DrawnRig:
    friction = math.exp(draw.uniform(math.log(0.1), math.log(10.0)))
    return DrawnRig(
        mass=math.exp(draw.uniform(math.log(0.03), math.log(1.0))),
        friction=friction,
        latency=draw.randrange(4),
        damping=draw.choice((0.0, draw.uniform(0.0, 0.7) * friction)),
        bandwidth=draw.choice((50.0, 100.0, 300.0)),
        period=draw.choice((2e-3, 1e-3, 0.25e-3)),
    )


def is_linearly_stable(rig: DrawnRig, stiffness: float, hand: tuple[float, float, float]) -> bool:
    """Whether the loop of handle, hand, latency and coupling with a fixed proxy is stable."""
    k, b, m = hand
    mass, period = rig.mass + m, rig.period
    continuous = np.array(
        [[0.0, 1.0, 0.0], [-k / mass, -(b + rig.friction) / mass, 1.0 / mass], [0.0, 0.0, 0.0]]
    )
    plant = expm(continuous * period)
    kept = math.exp(-2.0 * math.pi * rig.bandwidth * period)
    # State: position, velocity, last position, filtered velocity, delayed forces (newest last).
    size = 4 + rig.latency

    def step(state: Any) -> Any:
        x, _, last, filtered = state[:4]
        filtered = kept * filtered + (1.0 - kept) * (x - last) / period
        force = -stiffness * x - rig.damping * filtered
        forces = [*state[4:], force]
        moved = plant @ [x, state[1], forces[0]]
        return np.array([moved[0], moved[1], x, filtered, *forces[1:]])

    loop = np.array([step(unit) for unit in np.eye(size)]).T
    return bool(np.max(np.abs(np.linalg.eigvals(loop))) < 1.0)


def stable_limit(rig: DrawnRig) -> float:
    """Largest stiffness below which the loop is stable with each hand [N/m], on a fine grid."""
    for stiffness in np.geomspace(1.0, 1e6, 600):
        if not all(is_linearly_stable(rig, stiffness, hand) for hand in HANDS.values()):
            return float(stiffness)
    return math.inf


def gate(rigs: int, seed: int) -> None:
    draw = random.Random(seed)
    unstable, ratios = 0, []
    for _ in range(rigs):
        rig = drawn_rig(draw)
        accepted = rig.coupling(1.0).largest_stiffness(rig.period)
        if accepted < 2.0:
            continue
        ratios.append(accepted / stable_limit(rig))
        for share, hand in itertools.product((0.3, 0.7, 0.999), HANDS.values()):
            unstable += not is_linearly_stable(rig, share * accepted, hand)
    low, median, high = np.quantile(ratios, (0.0, 0.5, 1.0))
    print(f"{len(ratios)} of {rigs} rigs with a coupling of at least 2 N/m, {len(HANDS)} hands")
    print(f"accepted and unstable: {unstable} of {3 * len(HANDS) * len(ratios)}")
    print(f"accepted / largest stable stiffness: {low:.2f} to {high:.2f}, median {median:.2f}")
    print(f"accepted at least half of it: {np.mean(np.array(ratios) >= 0.5):.1%} of the rigs")


def released(master: ForceMaster, pull: float) -> float:
    """Time from the release of a handle to the error of the rig [s]; NaN if there is none."""
    handle, period = FreeHandle(master.mass, master.friction), 1e-3
    axis = make_axis(master, handle, 1.0, 0.02)
    axis.coupling.measure(0.0, -period)
    axis.enable()
    # The hand has pulled the handle by a slow motion, and lets go.
    stretch = pull / master.stiffness
    moving = 400
    for k in range(moving + 1000):
        if k < moving:
            handle.x, handle.v = stretch * k / moving, 0.0
        axis.coupling.measure(round(handle.x / 1e-6) * 1e-6, k * period)
        axis.error = axis.coupling.error
        if axis.error and k >= moving:
            return (k - moving) * period
        axis.command(0.0, k * period)
        if k >= moving:
            handle.advance(0.0, period, None, None)  # type: ignore[arg-type]
    return math.nan


def release(rigs: int, seed: int) -> None:
    draw = random.Random(seed)
    times, calm = [], 0
    for _ in range(rigs):
        friction, latency = draw.uniform(0.3, 3.0), draw.randrange(1, 4)
        limit = CouplingParameters(1.0, latency=latency, friction=friction).largest_stiffness(1e-3)
        mass, pull = draw.uniform(0.05, 0.5), draw.uniform(0.5, 4.0)
        for factor in (1.0, 3.0):
            master = ForceMaster(factor * limit, 0.0, mass, friction, latency, max_force=8.0)
            took = released(master, pull)
            if factor == 1.0:
                calm += math.isnan(took)
            else:
                times.append(took)
    missing = int(np.isnan(times).sum())
    print(f"{rigs} handles released with 0.5 to 4 N at 1 to 3 periods of latency")
    print(f"at the accepted stiffness: {calm} without an error")
    print(
        f"at three times: reported after {np.nanmedian(times) * 1e3:.0f} ms, "
        f"at most {np.nanmax(times) * 1e3:.0f} ms; {np.mean(np.array(times) < 0.2):.1%} within "
        f"0.2 s, {missing} not within 1 s"
    )


def felt(case: tuple[str, float, float, int, bool]) -> tuple[Any, ...]:
    cube, arm, delay, seed, rigid = case
    setup = replace(paper_setup("hand", cube), transmission=RIGID) if rigid else None
    settings = TrialSettings(
        condition="free",
        cube=cube,  # type: ignore[arg-type]
        clock="virtual",
        seed=seed,
        custom_setup=setup,
        force_master=ForceMaster(max_force=700.0 if rigid else 125.0),
        feedback=FeedbackSettings("model-mediated"),
        channel=ChannelSettings(delay=delay, max_silence=1.0),
        operator_model=OperatorModel(arm_stiffness=arm, aim_force=AIM),
        estimators=("rls",),
    )
    feedback = run_trial(settings).summary()["feedback"]
    return (*case, feedback["stable"], feedback["rendered_k_error"], feedback["felt_force_error"])


def feedback(seeds: int, first: int, rigid: bool) -> None:
    cases = list(itertools.product(CUBES, ARMS, DELAYS, range(first, first + seeds), [rigid]))
    with ProcessPoolExecutor() as pool:
        rows = list(pool.map(felt, cases, chunksize=4))
    print("cube    trials  stable  |k error| median, 95 %, max   within 3 %   force error median")
    for cube in CUBES:
        of_cube = [row for row in rows if row[0] == cube]
        errors = np.abs([row[6] for row in of_cube])
        forces = [row[7] for row in of_cube]
        middle, high, most = np.nanquantile(errors, (0.5, 0.95, 1.0))
        print(
            f"{cube:7} {len(of_cube):6} {sum(row[5] is True for row in of_cube):7}"
            f"  {middle:8.1%} {high:8.1%} {most:8.1%}  {np.mean(errors <= 0.03):14.1%}"
            f"  {np.nanmedian(forces):14.1%}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--part", choices=("gate", "release", "feedback"), required=True)
    parser.add_argument("--rigs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first-seed", type=int, default=5000)
    parser.add_argument("--rigid", action="store_true")
    options = parser.parse_args()
    if options.part == "gate":
        gate(options.rigs, options.seed)
    elif options.part == "release":
        release(options.rigs, options.seed)
    else:
        feedback(options.seeds, options.first_seed, options.rigid)


if __name__ == "__main__":
    main()
