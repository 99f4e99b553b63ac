"""Evaluate each step of a protocol: relaxation, creep, k' and k'', or stiffness and damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from estimation.arrays import Floats
from estimation.filters import Play
from estimation.transmission import TransmissionCalibration
from teleop.errors import InputError
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.protocol.dynamic import dynamic_stiffness
from teleop.evaluation.protocol.exponentials import fit_decay
from teleop.evaluation.reading.signals import Signals

SETTLING = {"relaxation": 0.25, "creep": 0.5}
"""Time at the start of a hold that is not evaluated: the slave, or the force, settles [s]."""
HELD_WITHIN = 0.005
"""Slow error of a force that is held, relative to its change: noise hides it from the regression.
It changes the depth by the same share, which the intervals of creep contain."""
SMOOTHING = 0.2
"""Time over which a force that is held is averaged [s]."""
NEAR = 0.02
"""Deviation of the controlled quantity, relative to its change in the ramp, that counts as held."""
FEWEST = 100
"""Smallest number of samples of a step."""


class StepPart(NamedTuple):
    """A step of a protocol, as the recording states it."""

    phase: int
    """Number of the phase to which the step belongs, from 1."""
    kind: str
    """What is evaluated: relaxation, creep, cyclic, sweep or random; other kinds are not."""
    text: str
    """Short description."""
    by: str
    """Controlled quantity: position or force."""
    frequency: float
    """Frequency of a sine [Hz]; NaN otherwise."""


def step_results(
    t: Floats,
    x: Floats,
    f: Floats,
    number: Floats,
    steps: Sequence[StepPart],
    known: TransmissionCalibration,
    resolution: float = 0.0,
) -> list[dict[str, Any]]:
    """Return the results of the steps that were performed, in their order.

    Parameters
    ----------
    t, x, f
        Time [s], position [m] and contact force [N] at the n ticks with a new force, shape (n,).
    number
        Number of the step at each of these ticks, from 0, shape (n,).
    steps
        All steps of the protocol.
    known
        Calibrated transmission between encoder and tip.
    resolution
        Smallest step of the measured position [m].
    """
    played = Play(known.lost_motion).run(x) if known.lost_motion else x
    found = []
    for index, step in enumerate(steps):
        part = np.flatnonzero(number == index)
        if len(part) < FEWEST:
            continue
        begin = float(t[part[0]])
        if step.kind in ("relaxation", "creep") and index and steps[index - 1].kind == "move":
            part = np.flatnonzero((number == index) | (number == index - 1))
        result: dict[str, Any] = {
            "step": index,
            "phase": step.phase,
            "kind": step.kind,
            "text": step.text,
            "start_s": begin,
            "end_s": float(t[part[-1]]),
            **evaluated(step, t[part], played[part], f[part], begin, known, resolution),
        }
        found.append(result)
    return found


def evaluated(
    step: StepPart,
    t: Floats,
    x: Floats,
    f: Floats,
    begin: float,
    known: TransmissionCalibration,
    resolution: float,
) -> dict[str, Any]:
    """Return the result of one step; empty if the step is not evaluated.

    The step starts at the time `begin` [s]. The samples of a hold begin with the ramp before it.
    """
    tip = x - known.compliance * f
    if step.kind in ("relaxation", "creep"):
        u, y = (tip, f) if step.kind == "relaxation" else (smoothed(f, t), tip)
        duration = float(t[-1]) - begin
        settling = max(min(SETTLING[step.kind], 0.2 * duration), settled(t - begin, u, resolution))
        if settling > 0.5 * duration:
            return {"reason": f"the {step.by} was not held: it changed until the end of the step"}
        error, change = 0.5 * resolution, abs(tip[-1] - tip[0])
        if step.kind == "relaxation":
            error *= abs(f[-1] - f[0]) / max(change, error, 1e-9)
        else:
            error += HELD_WITHIN * change
        sign = 1.0 if step.kind == "relaxation" else -1.0
        decay = fit_decay(t - begin, u, y, settling, error, sign)
        return {"held": float(u[t >= begin + settling].mean()), step.kind: asdict(decay)}
    if step.kind == "cyclic":
        rise = 1.0 / step.frequency
        steady = (t - t[0] >= rise) & (t[-1] - t >= rise)
        dynamic = dynamic_stiffness(t[steady], x[steady], f[steady], step.frequency, known)
        mean = {"mean_depth": float(tip.mean()), "mean_force": float(f.mean())}
        if dynamic is None:
            return {**mean, "reason": "fewer than three whole cycles with a change of the position"}
        return {**mean, "dynamic": asdict(dynamic)}
    if step.kind in ("sweep", "random"):
        return of_motion(t, x, f, known)
    return {}


def settled(t: Floats, u: Floats, resolution: float) -> float:
    """Return the time from which the controlled quantity stays near its value in the second half.

    `t` is the time since the start of the hold [s], negative in the ramp before it.
    """
    value = float(np.median(u[t >= 0.5 * t[-1]]))
    change = abs(value - float(u[0]))
    width = max(round(SMOOTHING * len(t) / float(t[-1] - t[0])), 1)
    averaged = uniform_filter1d(u, width)
    noise = float(np.std(averaged[t >= 0.5 * t[-1]]))
    near = max(NEAR * change, 4.0 * noise, 2.0 * resolution)  # without a ramp, nothing changes
    far = np.flatnonzero(np.abs(averaged - value) > near)
    return float(t[far[-1]]) if len(far) else 0.0


def smoothed(f: Floats, t: Floats) -> Floats:
    """Return the moving average of the controlled force over `SMOOTHING`.

    The true force varies more slowly, and noise of a regressor would bias its coefficient.
    """
    width = max(round(SMOOTHING * (len(t) - 1) / float(t[-1] - t[0])), 1)
    return np.asarray(uniform_filter1d(f, width, mode="nearest"))


def of_motion(t: Floats, x: Floats, f: Floats, known: TransmissionCalibration) -> dict[str, Any]:
    """Return the stiffness and damping of a motion with many frequencies."""
    dt = np.diff(t, prepend=2.0 * t[0] - t[1])
    try:
        result = analyse(Signals(t, x, f, dt, "position"), known).result
    except (InputError, ValueError) as error:
        return {"reason": str(error)}
    return {"result": result.summary()}
