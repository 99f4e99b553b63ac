"""Find the points at which a motion reverses."""

from __future__ import annotations

from estimation.compiled import Floats


def turning_points(x: Floats, least: float) -> list[int]:
    """Return 0, the indices of the samples at which the motion reverses, and n.

    Parameters
    ----------
    x
        Position [m], shape (n,).
    least
        Smallest distance of a motion in the opposite direction that counts as a reversal [m].
    """
    turns = [0]
    highest = lowest = 0
    direction = 0
    values = x.tolist()
    for i, value in enumerate(values):
        if value > values[highest]:
            highest = i
        if value < values[lowest]:
            lowest = i
        if direction >= 0 and values[highest] - value > least:
            if direction > 0 or highest > 0:
                turns.append(highest)
            direction, lowest = -1, i
            highest = i
        elif direction <= 0 and value - values[lowest] > least:
            if direction < 0 or lowest > 0:
                turns.append(lowest)
            direction, highest = 1, i
            lowest = i
    if turns[-1] < len(x):
        turns.append(len(x))
    return turns
