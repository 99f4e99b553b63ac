"""Orders of trials: as listed, random, or balanced by a Latin square."""

from __future__ import annotations

import random
from typing import Literal

OrderName = Literal["listed", "random", "latin-square"]


def ordered(count: int, order: OrderName, seed: int, block: int) -> list[int]:
    """Return the order in which the cells of a block are run, as indices of the cells.

    A cell is a combination of levels of the factors, together with a repetition.

    Parameters
    ----------
    count
        Number of cells.
    order
        `listed`; `random`, a permutation for each block; or `latin-square`, the rows of a
        Williams square whose cells are permuted once.
    seed
        Seed of the permutations.
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

    If the number of cells is even, each cell directly follows each other cell once in `count`
    rows. If it is odd, each cell follows each other cell twice in `2 count` rows, of which every
    second row is reversed.

    Parameters
    ----------
    count
        Number of cells.
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
