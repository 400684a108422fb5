"""Pedestrians: driven by a direction and a speed, or placed by the client's own navigation.

A walker's origin is at mid height, as the client's navigation assumes. Walkers that no navigation
places stop at walls, fall where there is no ground, and what runs into them knocks them aside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.ground import Ground
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.columns import Rotation
from carstage_sim.world.contacts.obstacles import Obstacles
from carstage_sim.world.vehicles.dynamics import GRAVITY
from carstage_sim.world.walkers.bystanders import Bystanders

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_MAX_PLAUSIBLE_SPEED = 15.0
_STILL = 1e-3
_STEP_M = 0.6
"""Ground that is nearer below the feet is stepped down to."""
_KNOCK_FRICTION = 6.0  # m/s^2: how fast a knocked walker comes to rest
_LONGEST_WAY_M = 0.15
"""How far a walker goes between two looks at the walls: less than half its width."""
_FASTEST = 40.96
"""m/s, CARLA's ``MaxWalkSpeed``: what it multiplies with the length of a direction."""
_JUMP_SPEED = 5.0
"""m/s upwards, CARLA's ``JumpZVelocity`` (``WalkerController.cpp``)."""
TERMINAL_SPEED = 40.0
"""m/s, Unreal's ``DefaultTerminalVelocity``."""


class WalkerMotion:
    """Moves walkers and derives their velocity from where they were a tick ago.

    Args:
        ground: what they stand on.
        obstacles: what they cannot walk through.
    """

    def __init__(self, ground: Ground, obstacles: Obstacles) -> None:
        self._ground = ground
        self._obstacles = obstacles
        self._ids: IntArray = np.zeros(0, np.int64)
        self._before: FloatArray = np.zeros((0, 3))
        self._knock: FloatArray = np.zeros((0, 2))
        self._fall: FloatArray = np.zeros(0)

    def falls(self, actor_id: int) -> bool:
        """Whether a walker was in the air after the last tick."""
        return bool(self._fall[self._ids == actor_id].any())

    def forget_way(self, walker_id: int, location: FloatArray) -> None:
        """Lets a walker's motion begin at a place, as if it had never been elsewhere."""
        others = self._ids != walker_id
        self._ids = np.append(self._ids[others], walker_id)
        self._before = np.vstack([self._before[others], location])
        self._knock = np.vstack([self._knock[others], np.zeros(2)])
        self._fall = np.append(self._fall[others], 0.0)

    def knock(self, walkers: Sequence[Actor], hit: Sequence[Actor], velocity: FloatArray) -> None:
        """Adds velocities that collisions gave to walkers.

        Args:
            walkers: all of them.
            hit: some of them.
            velocity: ``(len(hit), 2)`` m/s.
        """
        self._remember(walkers)
        row_of = {int(actor_id): row for row, actor_id in enumerate(self._ids)}
        self._knock[[row_of[walker.actor_id] for walker in hit]] += velocity

    def step(self, table: ActorTable, walkers: Sequence[Actor], delta_s: float) -> None:
        """One tick: walk on, stand on the ground, measure velocities."""
        rows = table.rows(walker.actor_id for walker in walkers)
        self._remember(walkers)
        if not walkers:
            return
        # CARLA disables the movement of who is in the air without gravity.
        own = np.array([walker.simulate_physics and walker.gravity for walker in walkers])
        self._fall[~own] = 0.0
        self._knock[~own] = 0.0
        # Who walks by itself and came or was put elsewhere since the last tick did not walk there.
        begins = table.location[rows]
        put = own & (begins != self._before).any(axis=1)
        stays = ~own[:, None] & ~np.isnan(self._before)
        self._before = np.where(stays, self._before, begins)
        if own.any():
            self._walk(table, walkers, np.flatnonzero(own), rows, delta_s)
        here = table.location[rows]
        velocity = (here - self._before) / delta_s
        placed = np.einsum("nk,nk->n", velocity, velocity) > _MAX_PLAUSIBLE_SPEED**2
        # Navigation places walkers that go; a replay or a client, elsewhere.
        velocity[placed & ~own] = 0.0
        velocity[put & (self._fall == 0.0), 2] = 0.0  # feet that come out of the ground
        table.acceleration[rows] = (velocity - table.velocity[rows]) / delta_s
        table.velocity[rows] = velocity
        self._before = here

    def _remember(self, walkers: Sequence[Actor]) -> None:
        """Brings the rows of what is remembered into the order of these walkers; NaN: new ones."""
        ids = np.fromiter((walker.actor_id for walker in walkers), np.int64, len(walkers))
        if np.array_equal(ids, self._ids):
            return
        known = {int(actor_id): row for row, actor_id in enumerate(self._ids)}
        old = np.array([known.get(int(actor_id), -1) for actor_id in ids], np.int64)
        self._knock = np.concatenate([self._knock, np.zeros((1, 2))])[old]
        self._fall = np.concatenate([self._fall, np.zeros(1)])[old]
        self._before = np.concatenate([self._before, np.full((1, 3), np.nan)])[old]
        self._ids = ids

    def _walk(
        self,
        table: ActorTable,
        walkers: Sequence[Actor],
        own: IntArray,
        rows: NDArray[np.intp],
        delta_s: float,
    ) -> None:
        """Walkers that no navigation places: along their direction, feet on the ground."""
        at = rows[own]
        direction = np.array([walkers[k].walker.direction for k in own], np.float64)
        speed = np.array([walkers[k].walker.speed for k in own], np.float64)
        # A negative speed turns Unreal's movement input round.
        direction *= np.where(speed < 0.0, -1.0, 1.0)[:, None]
        speed = np.abs(speed)
        length = np.linalg.norm(direction, axis=1)
        moving = (length > _STILL) & (speed > _STILL)
        unit = direction / np.where(moving, length, 1.0)[:, None]
        speed = np.minimum(speed * length, _FASTEST)
        way = (np.where(moving, speed, 0.0)[:, None] * unit)[:, :2] + self._knock[own]
        extent = np.array([walkers[k].box_extent for k in own])
        collides = np.array([walkers[k].collides for k in own])
        bystanders = Bystanders(table, walkers)
        self._go(table, at, way * delta_s, extent, collides, bystanders)
        knock = np.linalg.norm(self._knock[own], axis=1)
        left = np.maximum(knock - _KNOCK_FRICTION * delta_s, 0.0) / np.maximum(knock, 1e-9)
        self._knock[own] *= left[:, None]

        flat = moving & (np.hypot(unit[:, 0], unit[:, 1]) > _STILL)
        yaw = np.degrees(np.arctan2(unit[:, 1], unit[:, 0]))
        table.rotation_deg[at, Rotation.YAW] = np.where(
            flat, yaw, table.rotation_deg[at, Rotation.YAW]
        )
        jumps = np.array([walkers[k].walker.jump for k in own], np.bool_)
        self._stand(table, own, at, extent[:, 2], jumps, delta_s)

    def _go(
        self,
        table: ActorTable,
        at: NDArray[np.intp],
        way: FloatArray,
        extent: FloatArray,
        collides: NDArray[np.bool_],
        bystanders: Bystanders,
    ) -> None:
        """Moves walkers over the plane in short steps, out of all that they get into."""
        longest = float(np.linalg.norm(way, axis=1).max())
        if longest == 0.0:
            return
        steps = min(max(int(np.ceil(longest / _LONGEST_WAY_M)), 1), 100)
        bumps = np.flatnonzero(collides & (np.abs(way) > 0.0).any(axis=1)).astype(np.int64)
        for _ in range(steps):
            table.location[at, :2] += way / steps
            feet = table.location[at] - [0.0, 0.0, 1.0] * extent
            yaw = np.radians(table.rotation_deg[at, Rotation.YAW])
            for contact in self._obstacles.contacts(bumps, feet, extent[:, :2], yaw):
                table.location[at[contact.first], :2] -= contact.normal * contact.depth_m
            bystanders.push_out(at[bumps], extent[bumps])

    def _stand(
        self,
        table: ActorTable,
        own: IntArray,
        at: NDArray[np.intp],
        half_height: FloatArray,
        jumps: NDArray[np.bool_],
        delta_s: float,
    ) -> None:
        """Feet on the ground where it is near, free fall where it is not, or after a jump."""
        feet = table.location[at].copy()
        feet[:, 2] -= half_height
        ground = self._ground.height_below(feet)
        stands = (self._fall[own] == 0.0) & (feet[:, 2] - ground < _STEP_M)
        speed = np.where(jumps & stands, -_JUMP_SPEED, self._fall[own])
        drop = speed * delta_s + 0.5 * GRAVITY * delta_s**2
        lands = ~np.isnan(ground) & ((stands & ~jumps) | (feet[:, 2] - drop <= ground))
        self._fall[own] = np.where(
            lands, 0.0, np.minimum(speed + GRAVITY * delta_s, TERMINAL_SPEED)
        )
        table.location[at, 2] = np.where(lands, ground, feet[:, 2] - drop) + half_height
