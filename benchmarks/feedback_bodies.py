"""Bodies of the benchmarks of force feedback, some of which the local model does not describe."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from scipy.optimize import brentq

from sim_backend import CUBES, Changing, Cube, Relaxing
from sim_backend.bodies import AnyBody


@dataclass(frozen=True)
class HuntCrossley(Cube):
    """Body that is not glued, with the force k1 x^1.5 (1 + 0.3 s/m v); k1 is in N/m^1.5."""

    def force(self, x: float, v: float) -> float:
        return max(self.k1 * x**1.5 * (1.0 + 0.3 * v), 0.0) if x > 0.0 else 0.0

    def stiffness(self, x: float) -> float:
        return 1.5 * self.k1 * math.sqrt(x) if x > 0.0 else 0.0

    def compressed(self, x: float, compliance: float) -> float:
        if x <= 0.0 or compliance == 0.0:
            return x
        return float(brentq(lambda y: y + compliance * self.force(y, 0.0) - x, 0.0, x))


@dataclass(frozen=True)
class Inclusion(Cube):
    """Cube with a stiff inclusion: from the depth `depth` on, the stiffness is larger by `k2`."""

    k2: float = 0.0
    depth: float = 0.0

    def deeper(self, x: float) -> float:
        """Return the compression of the inclusion, with a smooth start [m]."""
        width = 0.1 * self.depth
        return width * math.log1p(math.exp(min((x - self.depth) / width, 500.0)))

    def force(self, x: float, v: float) -> float:
        return super().force(x, v) + self.k2 * self.deeper(x)

    def stiffness(self, x: float) -> float:
        share = 1.0 / (1.0 + math.exp(-(x - self.depth) / (0.1 * self.depth)))
        return super().stiffness(x) + self.k2 * share

    def compressed(self, x: float, compliance: float) -> float:
        if compliance == 0.0:
            return x
        near = 1e-3 + abs(x)
        return float(brentq(lambda y: y + compliance * self.force(y, 0.0) - x, x - near, x + near))


def loose(cube: Cube) -> Cube:
    return replace(cube, glued=False)


def relaxing(cube: Cube) -> Relaxing:
    """Return a cube in which a quarter of k1 relaxes with a time constant of 0.5 s."""
    return Relaxing(replace(cube, k1=0.75 * cube.k1), k=0.25 * cube.k1, tau=0.5)


def swapped(before: str, after: str) -> Changing:
    """Return a cube that is replaced by another one before the fifth contact."""
    return Changing(loose(CUBES[before]), loose(CUBES[after]), contact=5)


def body(name: str, cube: Cube, seed: int = 0) -> AnyBody:
    """Return the body with this name; `seed` varies the time of a change.

    Names: `spring K`, glued, loose, relaxing, hunt-crossley, inclusion; `A to B`, two cubes of
    which B replaces A while the tip is away; `A while indented to B`, where it does so in contact.
    """
    if " while indented to " in name:
        before, after = name.split(" while indented to ")
        return Changing(CUBES[before], CUBES[after], contact=1, delay=4.0 + 0.113 * (seed % 17))
    if " to " in name:
        return swapped(*name.split(" to "))
    if name.startswith("spring "):
        k = float(name.split()[1])
        return Cube(k, 0.0, 1e-3 * k)
    if name == "hunt-crossley":
        return HuntCrossley(3e4, 0.0, 1.0, glued=False)
    if name == "inclusion":
        return Inclusion(cube.k1, cube.k3, cube.b, k2=2.0 * cube.k1, depth=2e-3)
    return {"glued": cube, "loose": loose(cube), "relaxing": relaxing(cube)}[name]


def is_left(name: str) -> bool:
    """Return whether the tip leaves the body between two presses."""
    return name in ("loose", "hunt-crossley") or (" to " in name and "while" not in name)
