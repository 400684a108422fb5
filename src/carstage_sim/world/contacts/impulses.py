"""What a collision does to the bodies: impulses at their points of contact, in the plane.

The usual sequential impulses of rigid bodies (Mirtich and Canny, "Impulse-based simulation of rigid
bodies", 1995): along the normal so much that the bodies part with a small share of the speed with
which they met, along the surface as much as dry friction transmits, at most so much that they no
longer slide. An impulse off the centre of mass makes the body spin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.contacts.boxes import TOWN, Contact

FloatArray = NDArray[np.float64]

RESTITUTION = 0.1
FRICTION = 0.4
_BOUNCES_ABOVE = 1.0  # m/s; what meets slower stays together, or parked cars would tremble
_PASSES = 3


@dataclass(frozen=True, slots=True)
class Bodies:
    """Boxes that may touch, one row each; positions, velocities and spins are changed in place.

    Attributes:
        center: ``(N, 3)`` world metres.
        half_size: ``(N, 2)`` metres.
        yaw_rad: ``(N,)``.
        velocity: ``(N, 2)`` m/s of the centre.
        spin: ``(N,)`` rad/s.
        inverse_mass, inverse_inertia: ``(N,)``; 0 for what cannot be pushed.
    """

    center: FloatArray
    half_size: FloatArray
    yaw_rad: FloatArray
    velocity: FloatArray
    spin: FloatArray
    inverse_mass: FloatArray
    inverse_inertia: FloatArray


def resolve(contacts: Sequence[Contact], bodies: Bodies) -> FloatArray:
    """Pushes bodies apart and changes their velocities, in place.

    Returns:
        ``(len(contacts), 2)`` impulse (N s, world) that the second body of each contact got; zero
        where none closed in.
    """
    state: dict[int, list[float]] = {}
    solvers = [_Solver(contact, state, bodies) for contact in contacts]
    for _ in range(_PASSES):
        for solver in solvers:
            solver.apply()
    for row, (x, y, spin) in state.items():
        bodies.velocity[row] = x, y
        bodies.spin[row] = spin
    for contact in contacts:
        _part(contact, bodies)
    return np.array([solver.impulse for solver in solvers]).reshape(-1, 2)


def _part(contact: Contact, bodies: Bodies) -> None:
    mass_i, mass_j = _inverse_masses(contact, bodies)
    if mass_i + mass_j > 0.0:
        push = contact.normal * (contact.depth_m / (mass_i + mass_j))
        bodies.center[contact.first, :2] -= push * mass_i
        if contact.second != TOWN:
            bodies.center[contact.second, :2] += push * mass_j


def _inverse_masses(contact: Contact, bodies: Bodies) -> tuple[float, float]:
    second = 0.0 if contact.second == TOWN else float(bodies.inverse_mass[contact.second])
    return float(bodies.inverse_mass[contact.first]), second


class _Solver:
    """One contact, with its bodies' state in plain floats: there are few, and numpy is slow at one.

    Args:
        contact: the contact.
        state: velocity x, y and spin of each body that is touched, by row; shared by all contacts.
        bodies: gives places, masses and inertias.
    """

    def __init__(self, contact: Contact, state: dict[int, list[float]], bodies: Bodies) -> None:
        self._normal: tuple[float, float] = tuple(contact.normal.tolist())
        self._levers: list[tuple[list[float], float, float, float, float, float]] = []
        self.push_so_far = 0.0
        self.impulse = [0.0, 0.0]
        x, y = contact.point.tolist()
        for row, sign in ((contact.first, -1.0), (contact.second, 1.0)):
            if row == TOWN:
                continue
            if row not in state:
                state[row] = [*bodies.velocity[row].tolist(), float(bodies.spin[row])]
            arm_x = x - float(bodies.center[row, 0])
            arm_y = y - float(bodies.center[row, 1])
            mass, inertia = float(bodies.inverse_mass[row]), float(bodies.inverse_inertia[row])
            self._levers.append((state[row], sign, arm_x, arm_y, mass, inertia))
        nx, ny = self._normal
        self._give = self._yielding(nx, ny)
        self._give_aside = self._yielding(-ny, nx)
        self._leaving = RESTITUTION * max(self._closing() - _BOUNCES_ABOVE, 0.0)

    def _yielding(self, x: float, y: float) -> float:
        """How much velocity at the point of contact an impulse along an axis gives, 1/kg."""
        return sum(
            mass + (arm_x * y - arm_y * x) ** 2 * inertia
            for _, _, arm_x, arm_y, mass, inertia in self._levers
        )

    def _parting(self) -> tuple[float, float]:
        """Velocity of the second body at the point of contact, as the first one sees it, m/s."""
        x = y = 0.0
        for (vx, vy, spin), sign, arm_x, arm_y, _, _ in self._levers:
            x += sign * (vx - spin * arm_y)
            y += sign * (vy + spin * arm_x)
        return x, y

    def _closing(self) -> float:
        x, y = self._parting()
        return -(x * self._normal[0] + y * self._normal[1])

    def apply(self) -> None:
        """Adds the impulse that this contact still needs; it never pulls."""
        if self._give <= 0.0:
            return
        nx, ny = self._normal
        x, y = self._parting()
        wanted = (self._leaving - (x * nx + y * ny)) / self._give
        push = max(self.push_so_far + wanted, 0.0) - self.push_so_far
        self.push_so_far += push
        bound = FRICTION * abs(push)
        rub = min(max(-(y * nx - x * ny) / self._give_aside, -bound), bound)
        jx, jy = push * nx - rub * ny, push * ny + rub * nx
        for body, sign, arm_x, arm_y, mass, inertia in self._levers:
            body[0] += sign * jx * mass
            body[1] += sign * jy * mass
            body[2] += sign * (arm_x * jy - arm_y * jx) * inertia
        self.impulse[0] += jx
        self.impulse[1] += jy
