"""Determine the order of trials: as listed, random, or balanced by a Latin square."""

from __future__ import annotations

import random
from typing import Literal

OrderName = Literal["listed", "random", "latin-square"]


def ordered(count: int, order: OrderName, seed: int, block: int) -> list[int]:
    """Return the order of the trials of a block, as indices of the trials of the plan.

    A random permutation differs between blocks. For a Latin square, each block is a row of a
    Williams square, whose numbers are assigned to the trials at random, in the same way for all
    blocks.
    """
    if order == "listed":
        return list(range(count))
    if order == "random":
        shuffled = list(range(count))
        random.Random(f"{seed} {block}").shuffle(shuffled)
        return shuffled
    names = list(range(count))
    random.Random(seed).shuffle(names)
    return [names[cell] for cell in williams_row(count, block)]


def williams_row(count: int, row: int) -> list[int]:
    """Return a row of a Williams square, a Latin square balanced for first-order carry-over.

    First-order carry-over is the effect of a trial on the next trial. A row is the order of the
    trials in one block, and contains each of the numbers 0 to `count` - 1 once. If `count` is even,
    the square has `count` rows, and each number directly follows every other number in exactly one
    row. If `count` is odd, the square has 2 `count` rows, and each number directly follows every
    other number in exactly two rows. In this case, every second row is the previous row in reversed
    order.

    References
    ----------
    E. J. Williams, "Experimental designs balanced for the estimation of residual effects of
    treatments", Australian Journal of Scientific Research A 2, 1949.
    """
    first = [(step + 1) // 2 if step % 2 else -step // 2 for step in range(count)]
    mirrored = count % 2 == 1 and row % 2 == 1
    shift = (row // 2 if count % 2 else row) % count
    cells = [(cell + shift) % count for cell in first]
    return cells[::-1] if mirrored else cells
