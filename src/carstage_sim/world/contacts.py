"""Contacts between vehicles: boxes that touch are pushed apart and lose their closing speed.

Deliberately simple: perfectly plastic, without friction or spin. It keeps a car from driving
through another one; it is no crash model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Contact:
    """Two boxes that are in each other.

    Attributes:
        first, second: their rows.
        normal: unit vector in the plane from the first to the second, along the least way out.
        depth_m: length of that way.
    """

    first: int
    second: int
    normal: FloatArray
    depth_m: float


def find_contacts(center: FloatArray, half_size: FloatArray, yaw_rad: FloatArray) -> list[Contact]:
    """All pairs of overlapping boxes, by separating axes, in ascending order of their rows.

    Args:
        center: ``(N, 3)`` centres of the boxes; those more than 2 m apart in height never touch.
        half_size: ``(N, 2)`` half length and half width, metres.
        yaw_rad: ``(N,)`` headings.
    """
    reach = np.linalg.norm(half_size, axis=1)
    offset = center[None] - center[:, None]
    near = (offset[..., 0] ** 2 + offset[..., 1] ** 2) < (reach[:, None] + reach[None]) ** 2
    near &= np.abs(offset[..., 2]) < 2.0
    first, second = np.nonzero(np.triu(near, k=1))
    if len(first) == 0:
        return []
    forward = np.stack([np.cos(yaw_rad), np.sin(yaw_rad)], axis=-1)
    axes_of = np.stack([forward, np.stack([-forward[:, 1], forward[:, 0]], axis=-1)], axis=1)
    between = offset[first, second, :2]
    axes = np.concatenate([axes_of[first], axes_of[second]], axis=1)
    reach_along = np.zeros(axes.shape[:2])
    for rows in (first, second):
        projected = np.abs(np.einsum("pak,pbk->pab", axes, axes_of[rows]))
        reach_along += np.einsum("pab,pb->pa", projected, half_size[rows])
    distance = np.einsum("pak,pk->pa", axes, between)
    depth = reach_along - np.abs(distance)
    best = depth.argmin(axis=1)
    pairs = np.arange(len(first))
    least = depth[pairs, best]
    normal = axes[pairs, best] * np.where(distance[pairs, best] < 0.0, -1.0, 1.0)[:, None]
    return [
        Contact(int(first[k]), int(second[k]), normal[k], float(least[k]))
        for k in np.flatnonzero(least > 0.0)
    ]


def resolve_contacts(
    contacts: list[Contact],
    location: FloatArray,
    speed: FloatArray,
    yaw_rad: FloatArray,
    inverse_mass: FloatArray,
) -> list[float]:
    """Pushes boxes apart and takes their closing speed, in place.

    Args:
        location: ``(N, 3)``, changed in x and y.
        speed: ``(N,)`` signed speed along the heading, changed.
        inverse_mass: ``(N,)`` 1/kg; 0 for what cannot be pushed.

    Returns:
        Impulse (N s) along each contact's normal that the second box got, 0 where none closed in.
    """
    impulses = [0.0] * len(contacts)
    for index, contact in enumerate(contacts):
        i, j, normal = contact.first, contact.second, contact.normal
        total = inverse_mass[i] + inverse_mass[j]
        if total == 0.0:
            continue
        push = normal * (contact.depth_m / total)
        location[i, :2] -= push * inverse_mass[i]
        location[j, :2] += push * inverse_mass[j]
        along_i = float(normal @ (np.cos(yaw_rad[i]), np.sin(yaw_rad[i])))
        along_j = float(normal @ (np.cos(yaw_rad[j]), np.sin(yaw_rad[j])))
        closing = speed[i] * along_i - speed[j] * along_j
        # Wheels move a car only along its heading: only that part of an impulse shows.
        give = inverse_mass[i] * along_i**2 + inverse_mass[j] * along_j**2
        if closing > 0.0 and give > 0.0:
            impulse = closing / give
            speed[i] -= impulse * inverse_mass[i] * along_i
            speed[j] += impulse * inverse_mass[j] * along_j
            impulses[index] = float(impulse)
    return impulses
