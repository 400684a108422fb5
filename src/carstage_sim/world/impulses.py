"""What a collision does to the bodies: impulses at their points of contact, in the plane.

The usual sequential impulses of rigid bodies (Mirtich and Canny, "Impulse-based simulation of rigid
bodies", 1995): along the normal so much that the bodies part with a small share of the speed with
which they met, along the surface as much as dry friction transmits, at most so much that they no
longer slide. An impulse beside a centre of mass makes the body spin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.contacts import TOWN, Contact

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
    total = np.zeros((len(contacts), 2))
    along = [0.0] * len(contacts)
    leaving = [max(_closing(contact, bodies) - _BOUNCES_ABOVE, 0.0) for contact in contacts]
    for _ in range(_PASSES):
        for index, contact in enumerate(contacts):
            change = _impulse(contact, bodies, along[index], RESTITUTION * leaving[index])
            along[index] += float(change @ contact.normal)
            total[index] += change
    for contact in contacts:
        _part(contact, bodies)
    return total


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


def _levers(contact: Contact, bodies: Bodies) -> list[tuple[int, float, FloatArray]]:
    """Row, sign and arm to the point of contact, of the bodies that an impulse changes."""
    rows = [(contact.first, -1.0)]
    if contact.second != TOWN:
        rows.append((contact.second, 1.0))
    return [(row, sign, contact.point - bodies.center[row, :2]) for row, sign in rows]


def _parting_velocity(contact: Contact, bodies: Bodies) -> FloatArray:
    """Velocity (m/s) of the second body at the point of contact, as the first one sees it."""
    velocity = np.zeros(2)
    for row, sign, arm in _levers(contact, bodies):
        spin = bodies.spin[row]
        velocity += sign * (bodies.velocity[row] + spin * np.array([-arm[1], arm[0]]))
    return velocity


def _closing(contact: Contact, bodies: Bodies) -> float:
    return -float(_parting_velocity(contact, bodies) @ contact.normal)


def _impulse(contact: Contact, bodies: Bodies, so_far: float, leaving: float) -> FloatArray:
    """Applies one more impulse at a contact and returns it."""
    normal = contact.normal
    tangent = np.array([-normal[1], normal[0]])
    levers = _levers(contact, bodies)
    velocity = _parting_velocity(contact, bodies)
    give = [
        sum(
            bodies.inverse_mass[row]
            + (arm[0] * axis[1] - arm[1] * axis[0]) ** 2 * bodies.inverse_inertia[row]
            for row, _, arm in levers
        )
        for axis in (normal, tangent)
    ]
    if give[0] <= 0.0:
        return np.zeros(2)
    wanted = (leaving - float(velocity @ normal)) / give[0]
    push = max(so_far + wanted, 0.0) - so_far
    bound = FRICTION * abs(push)
    rub = min(max(-float(velocity @ tangent) / give[1], -bound), bound) if give[1] > 0.0 else 0.0
    impulse = push * normal + rub * tangent
    for row, sign, arm in levers:
        bodies.velocity[row] += sign * impulse * bodies.inverse_mass[row]
        torque = arm[0] * impulse[1] - arm[1] * impulse[0]
        bodies.spin[row] += sign * torque * bodies.inverse_inertia[row]
    return np.asarray(impulse)
