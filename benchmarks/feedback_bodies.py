"""Bodies of the benchmarks of force feedback, some of which the local model does not describe."""

from __future__ import annotations

from dataclasses import replace

from sim_backend import CUBES, Changing, Cube, Relaxing


def glued(cube: Cube, seed: int = 0) -> Cube:
    return cube


def loose(cube: Cube, seed: int = 0) -> Cube:
    return replace(cube, glued=False)


def relaxing(cube: Cube, seed: int = 0) -> Relaxing:
    """Return a cube in which a quarter of k1 relaxes with a time constant of 0.5 s."""
    return Relaxing(replace(cube, k1=0.75 * cube.k1), k=0.25 * cube.k1, tau=0.5)


def next_contact(cube: Cube, seed: int = 0) -> Changing:
    """Return a cube that is replaced by the hard cube before the third contact."""
    return Changing(loose(cube), loose(CUBES["hard"]), contact=3)


def while_indented(cube: Cube, seed: int = 0) -> Changing:
    """Return a cube that becomes the hard one while it is indented, at a time given by the seed."""
    return Changing(cube, CUBES["hard"], contact=1, delay=4.0 + 0.1 * seed)


BODIES = {
    "glued": glued,
    "loose": loose,
    "relaxing": relaxing,
    "stiffer at the next contact": next_contact,
    "stiffer while indented": while_indented,
}
