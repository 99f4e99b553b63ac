"""Bodies that are not Kelvin-Voigt: they relax, or change while they are palpated.

A body can contain other bodies. For example, a body with two relaxation times is a `Relaxing` that
contains a `Relaxing`, and a `Changing` can change from a cube to a relaxing body.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from pydantic import Discriminator, Tag

from sim_backend.body import Body, Law
from sim_backend.cube import Cube

SHORTEST_RELAXATION = 0.01
"""Shortest relaxation time [s]. During palpation, a faster branch would act as a damping."""
LIFTED = 0.05
"""A new contact is counted only after this time out of contact [s]. Tremor causes shorter times."""


@dataclass(frozen=True)
class PreloadedLaw(Law):
    """Law of the contact force of a body that is not relaxed."""

    k1: float
    k3: float
    b: float
    glued: bool
    preload: float


class Branch(NamedTuple):
    """State of a Maxwell branch, and of the body parallel to it."""

    body: Any
    """State of the body parallel to the branch."""
    surface: float = 0.0
    """Displacement of the surface [m]."""
    dashpot: float = 0.0
    """Displacement of the dashpot [m]."""


@dataclass(frozen=True)
class Relaxing(Body):
    """A body with a parallel Maxwell branch: a spring k in series with a dashpot k tau.

    With a linear cube this is the standard linear solid [1]. The force of the branch is k (x - z),
    where z is the displacement of the dashpot, with z' = (x - z) / tau. While x moves linearly, the
    stretch e = x - z of the spring is

        e(t + dt) = e(t) exp(-dt / tau) + v tau (1 - exp(-dt / tau))

    The state is advanced with this solution. In motion much slower than tau the branch acts as a
    damping k tau, and in motion much faster than tau as a stiffness k.

    If the body is not glued, its surface recovers without contact. The surface is then where the
    total force of body and branch, without damping, is zero.

    Parameters
    ----------
    body
        The body parallel to the branch.
    k
        Stiffness of the spring of the branch [N/m], > 0.
    tau
        Relaxation time of the branch [s], at least 0.01.

    Raises
    ------
    ValueError
        A parameter is out of range.

    References
    ----------
    [1] Y. C. Fung, Biomechanics: Mechanical Properties of Living Tissues, 2nd ed., Springer, 1993,
        section 2.11.
    """

    body: AnyBody
    k: float
    tau: float

    def __post_init__(self) -> None:
        if not 0.0 < self.k < math.inf:
            raise ValueError(f"a relaxing body needs k > 0, got {self.k:g} N/m")
        if not SHORTEST_RELAXATION <= self.tau < math.inf:
            raise ValueError(
                f"a relaxing body needs tau >= {SHORTEST_RELAXATION:g} s, got {self.tau:g} s: "
                "expected a damping b of the cube instead of a faster branch"
            )

    @property
    def initial(self) -> Branch:
        """State in which the dashpot is at 0."""
        return Branch(self.body.initial)

    def law(self, state: Branch) -> Law:
        """Return the law of the body and the parallel spring k, for a constant dashpot position."""
        law = self.body.law(state.body)
        preload = law.preload + self.k * state.dashpot
        return PreloadedLaw(law.k1 + self.k, law.k3, law.b, law.glued, preload)

    def advanced(self, state: Branch, surface: float, dt: float) -> Branch:
        """Return the state after `dt` [s], in which the surface moves linearly to `surface` [m]."""
        decay = math.exp(-dt / self.tau)
        speed = (surface - state.surface) / dt
        stretch = (state.surface - state.dashpot) * decay + speed * self.tau * (1.0 - decay)
        inner = self.body.advanced(state.body, surface, dt)
        return Branch(inner, surface, surface - stretch)

    @property
    def glued(self) -> bool:
        """Whether the body is glued to the slave's plate."""
        return self.body.glued

    @property
    def slow(self) -> Law:
        """Law of the force in slow motion, in which the branch is a damping k tau."""
        law = self.body.slow
        return PreloadedLaw(law.k1, law.k3, law.b + self.k * self.tau, law.glued, law.preload)

    @property
    def further_laws(self) -> dict[str, Law]:
        """Law in fast motion."""
        return {"fast": self.fast}


class Progress(NamedTuple):
    """State of a `Changing` body."""

    before: Any
    """State of the body `before`."""
    after: Any
    """State of the body `after`. Its surface moves from the start of the trial, as for `before`."""
    contacts: int = 0
    """Number of contacts so far."""
    outside: float = math.inf
    """Time since the end of the last contact [s]."""
    elapsed: float = 0.0
    """Time since the beginning of the contact after which the body changes [s]."""


@dataclass(frozen=True)
class Changing(Body):
    """A body that becomes another body, for example a specimen that is replaced between two pokes.

    The change is `delay` seconds after the beginning of a contact, whether or not the contact is
    lost in the meantime. A contact begins when the slave enters the body after at least 0.05 s
    outside of it. The two bodies have the same surface, so the force steps if the body changes
    while it is indented. A change to a stiffer body then adds energy.

    Parameters
    ----------
    before, after
        The body before and after the change. Both are glued, or both are not.
    contact
        Number of the contact in or after which the body changes, >= 1. A glued body has only one
        contact.
    delay
        Time from the beginning of this contact to the change [s], >= 0.

    Raises
    ------
    ValueError
        A parameter is out of range, or the change would be at the beginning of the first contact.
    """

    before: AnyBody
    after: AnyBody
    contact: int = 1
    delay: float = 0.0

    def __post_init__(self) -> None:
        if self.before.glued != self.after.glued:
            raise ValueError("a changing body needs the same `glued` before and after the change")
        if self.contact < 1 or not 0.0 <= self.delay < math.inf:
            raise ValueError(
                f"a changing body needs contact >= 1 and delay >= 0, got contact {self.contact} "
                f"and delay {self.delay:g} s"
            )
        if self.glued and self.contact > 1:
            raise ValueError(
                f"a glued body has one contact, got contact {self.contact}: expected glued = false "
                "before and after the change, or a delay"
            )
        if self.contact == 1 and self.delay == 0.0:
            raise ValueError("a changing body needs contact > 1 or delay > 0")

    @property
    def initial(self) -> Progress:
        """State before the change."""
        return Progress(self.before.initial, self.after.initial)

    def changed(self, state: Progress) -> bool:
        """Return whether the body has changed."""
        return state.contacts >= self.contact and state.elapsed >= self.delay

    def law(self, state: Progress) -> Law:
        """Return the law of the body before or after the change."""
        if self.changed(state):
            return self.after.law(state.after)
        return self.before.law(state.before)

    def advanced(self, state: Progress, surface: float, dt: float) -> Progress:
        """Return the state after `dt` [s], in which the surface moves linearly to `surface` [m]."""
        began = state.contacts >= self.contact
        touches = surface > self.law(state).rest
        return Progress(
            self.before.advanced(state.before, surface, dt),
            self.after.advanced(state.after, surface, dt),
            state.contacts + (touches and state.outside >= LIFTED),
            0.0 if touches else state.outside + dt,
            state.elapsed + dt if began else 0.0,
        )

    @property
    def glued(self) -> bool:
        """Whether the body is glued to the slave's plate."""
        return self.before.glued

    @property
    def slow(self) -> Law:
        """Law of the force in slow motion before the change."""
        return self.before.slow

    @property
    def further_laws(self) -> dict[str, Law]:
        """Law in fast motion before the change, and the laws after the change."""
        after = {f"changed, {name}": law for name, law in self.after.further_laws.items()}
        return {**self.before.further_laws, "changed": self.after.slow, **after}


def kind_of_body(value: Any) -> str:
    """Return the name of the class of a body, from the body or from its keys in a configuration."""
    if isinstance(value, Body):
        return type(value).__name__
    keys = set(value) if isinstance(value, Mapping) else set()
    if keys & {"before", "after", "contact", "delay"}:
        return Changing.__name__
    return Relaxing.__name__ if keys & {"body", "k", "tau"} else Cube.__name__


AnyBody = Annotated[
    Annotated[Cube, Tag("Cube")]
    | Annotated[Relaxing, Tag("Relaxing")]
    | Annotated[Changing, Tag("Changing")],
    Discriminator(kind_of_body),
]
"""Bodies that a configuration can contain; the keys of a body determine its class."""
