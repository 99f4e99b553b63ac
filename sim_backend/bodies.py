"""Bodies whose force relaxes, and bodies that change to another body during the trial.

After a fast indentation, the force of a `Relaxing` body decreases while the displacement is
constant. A body can contain other bodies. For example, a body with two relaxation times is a
`Relaxing` that contains a `Relaxing`, and a `Changing` can change from a cube to a `Relaxing`.
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
"""Shortest permitted relaxation time of `Relaxing` [s]. A shorter one would only add damping."""
LIFTED = 0.05
"""Shortest time between two contacts [s].

If the slave is outside of the body for a shorter time (because of tremor), the contact continues.
"""


@dataclass(frozen=True)
class PreloadedLaw(Law):
    """Law of the contact force with given parameters.

    The parameter `preload` is the reduction of the force by the deformation in the past.
    """

    k1: float
    k3: float
    b: float
    glued: bool
    preload: float


class Branch(NamedTuple):
    """State of a `Relaxing` body, which consists of a body and a Maxwell branch in parallel.

    The Maxwell branch is a spring in series with a dashpot.
    """

    body: Any
    """State of the body parallel to the branch."""
    surface: float = 0.0
    """Displacement of the surface [m]."""
    dashpot: float = 0.0
    """Displacement of the dashpot [m]."""


@dataclass(frozen=True)
class Relaxing(Body):
    """A body with a Maxwell branch (a spring in series with a dashpot) in parallel.

    The spring has the stiffness k, and the dashpot has the damping coefficient k tau. If the body
    is a cube of constant stiffness with negligible damping, the body and the branch together are
    the standard linear solid [1]. The force of the branch is k (x - z). x is the displacement of
    the surface, and z is the displacement of the dashpot, with z' = (x - z) / tau. While x changes
    with the constant velocity v, the stretch e = x - z of the spring is

        e(t + dt) = e(t) exp(-dt / tau) + v tau (1 - exp(-dt / tau))

    The state is advanced with this solution. If the displacement changes little in the time tau,
    the branch acts as a damper with the coefficient k tau. If the displacement changes in a much
    shorter time than tau, the branch acts as a spring with the stiffness k.

    If the body is not glued to the slave, the slave can leave the body. The surface then moves back
    while the branch relaxes. During this motion, the sum of the static force of the body and the
    force of the branch is zero. This condition determines the displacement of the surface.

    Parameters
    ----------
    body
        The body parallel to the branch.
    k
        Stiffness of the spring of the branch [N/m], > 0.
    tau
        Relaxation time of the branch [s], at least `SHORTEST_RELAXATION`.

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
        """State before the first contact: the displacements of surface and dashpot are zero."""
        return Branch(self.body.initial)

    def law(self, state: Branch) -> Law:
        """Return the contact force as a function of displacement and velocity, for a given state.

        In this function, the dashpot of the Maxwell branch has the constant displacement
        `state.dashpot`. The spring of the branch is then in parallel with the rest of the body.
        """
        law = self.body.law(state.body)
        preload = law.preload + self.k * state.dashpot
        return PreloadedLaw(law.k1 + self.k, law.k3, law.b, law.glued, preload)

    def advanced(self, state: Branch, surface: float, dt: float) -> Branch:
        """Return the state of the body after the time `dt` [s].

        `state` is the state before this time. During this time, the surface of the body moves at
        constant velocity to the displacement `surface` [m].
        """
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
        """Law of the contact force in slow motion.

        The Maxwell branch (spring and dashpot in series) is then a damper of coefficient k tau.
        """
        law = self.body.slow
        return PreloadedLaw(law.k1, law.k3, law.b + self.k * self.tau, law.glued, law.preload)

    @property
    def further_laws(self) -> dict[str, Law]:
        """Dictionary with one entry, `fast`: the law of the contact force in fast motion.

        The Maxwell branch (spring and dashpot in series) is then a spring of stiffness k.
        """
        return {"fast": self.fast}


class Progress(NamedTuple):
    """State of a `Changing` body, which is first the body `before` and later the body `after`."""

    before: Any
    """State of the body `before`."""
    after: Any
    """State of the body `after`. Both bodies always have the same displacement of the surface."""
    contacts: int = 0
    """Number of contacts since the start of the trial."""
    outside: float = math.inf
    """Time since the end of the last contact [s]."""
    elapsed: float = 0.0
    """Time since the contact number `Changing.contact` began [s]; 0 before this contact."""


@dataclass(frozen=True)
class Changing(Body):
    """A body that becomes another body, for example a specimen that is replaced between two pokes.

    The contacts between slave and body are numbered from 1. The change occurs `delay` seconds after
    the beginning of the contact number `contact`, even if this contact has ended by then. A new
    contact begins only if the slave was outside of the body for at least `LIFTED` seconds. At the
    change, the displacement of the surface remains the same. If the body is indented at this time,
    the force therefore changes suddenly. A change to a stiffer body then adds elastic energy.

    Parameters
    ----------
    before, after
        The body before and after the change. Either both bodies are glued to the slave's plate, or
        neither.
    contact
        Number of the contact at whose beginning the delay starts, >= 1. A glued body has only one
        contact, because the slave cannot leave the body.
    delay
        Time from the beginning of this contact to the change [s], >= 0.

    Raises
    ------
    ValueError
        A parameter is out of range, only one of the bodies is glued, or the change would be at the
        beginning of the first contact.
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
        """State before the first contact, and before the change to the body `after`."""
        return Progress(self.before.initial, self.after.initial)

    def changed(self, state: Progress) -> bool:
        """Return whether, in a given state, the body `before` has been replaced by `after`."""
        return state.contacts >= self.contact and state.elapsed >= self.delay

    def law(self, state: Progress) -> Law:
        """Return the contact force as a function of displacement and velocity, for a given state.

        This is the law of the body `before` or, if the change has occurred, of the body `after`.
        """
        if self.changed(state):
            return self.after.law(state.after)
        return self.before.law(state.before)

    def advanced(self, state: Progress, surface: float, dt: float) -> Progress:
        """Return the state of the body after the time `dt` [s].

        `state` is the state before this time. During this time, the surface of the body moves at
        constant velocity to the displacement `surface` [m].
        """
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
        """Law of the contact force in slow motion, before the change to the body `after`."""
        return self.before.slow

    @property
    def further_laws(self) -> dict[str, Law]:
        """All laws of the contact force, by name, except `slow` of the body `before`.

        The law `changed` is valid in slow motion after the change. Other names that begin with
        `changed`, such as `changed, fast`, also belong to the body `after`. All other names belong
        to the body `before`.
        """
        after = {f"changed, {name}": law for name, law in self.after.further_laws.items()}
        return {**self.before.further_laws, "changed": self.after.slow, **after}


def kind_of_body(value: Any) -> str:
    """Return the name of the class of a body: `Cube`, `Relaxing` or `Changing`.

    `value` is the body, or a dictionary of its parameters from a configuration file.
    """
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
"""Bodies that a configuration can contain. The keys of an entry determine the class of the body."""
