"""Determine the order of trials: as listed, random, or balanced by a Latin square."""

from __future__ import annotations

import random
from typing import Literal

OrderName = Literal["listed", "random", "latin-square"]


def ordered(count: int, order: OrderName, seed: int, block: int) -> list[int]:
    """Return the order in which the cells of a block are run, as a list of cell indices.

    A cell is one trial of a block: a combination of levels of the factors, and the number of the
    repetition.

    Parameters
    ----------
    count
        Number of cells in the block.
    order
        `listed`: the order of the plan. `random`: a random permutation for each block.
        `latin-square`: the order in a block is a row of a Williams square. The numbers in the
        square are assigned to the cells at random. This assignment is the same for all blocks.
    seed
        Seed of the random permutation or assignment.
    block
        Number of the block, from 0.
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

    Each row contains each cell once. If the number of cells is even, the square has `count` rows,
    and each cell directly follows every other cell in exactly one row. If the number of cells is
    odd, the square has `2 count` rows, and each cell directly follows every other cell in exactly
    two rows. In this case, every second row is the previous row in reversed order.

    Parameters
    ----------
    count
        Number of cells in the block.
    row
        Number of the row, from 0.

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
