"""The mechanics of an episode: everything that moves in a tick, and what touches on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.maps.ground import STEP_UP_M, Ground
from carstage_sim.maps.town import Town
from carstage_sim.world.actors import Actor, ActorTable
from carstage_sim.world.contacts.collisions import collisions_of_tick
from carstage_sim.world.contacts.obstacles import Obstacles
from carstage_sim.world.contacts.solids import Solids
from carstage_sim.world.controls import PhysicsStep
from carstage_sim.world.pose import Pose, Vector3
from carstage_sim.world.state import ActorKind, Collision
from carstage_sim.world.town_objects import TownObjects
from carstage_sim.world.vehicles.dynamics import GRAVITY
from carstage_sim.world.vehicles.fleet import VehicleFleet
from carstage_sim.world.vehicles.friction_zones import TYPE_ID as FRICTION_TRIGGER
from carstage_sim.world.vehicles.friction_zones import zone_friction
from carstage_sim.world.walkers.walking import TERMINAL_SPEED, WalkerMotion

KILL_HEIGHT_M = -10485.75
"""What falls below is destroyed: Unreal's default ``KillZ`` of a level."""


@dataclass(frozen=True, slots=True)
class Terrain:
    """What of a town things stand on and run into; built once and shared by its episodes."""

    ground: Ground
    obstacles: Obstacles


def terrain_of(town: Town) -> Terrain:
    """Reads the terrain out of a town's mesh (some tenths of a second)."""
    ground = Ground(town.static_mesh)
    return Terrain(ground, Obstacles(town.static_mesh, ground))


class Mechanics:
    """Steps vehicles and walkers and writes their motion into the table of actors.

    Args:
        terrain: of the town.
        table: the actors.
        objects: tells which of the town's objects clients took away.

    Attributes:
        fleet: dynamics of the vehicles.
        collisions: what touched in the last tick.
    """

    def __init__(self, terrain: Terrain, table: ActorTable, objects: TownObjects) -> None:
        self.fleet = VehicleFleet(terrain.ground.height_below, terrain.obstacles)
        self.collisions: tuple[Collision, ...] = ()
        self._terrain = terrain
        self._obstacles = terrain.obstacles
        self._walkers = WalkerMotion(terrain.ground, terrain.obstacles)
        self._table = table
        self._objects = objects
        self._hidden: frozenset[int] = frozenset()
        self._hidden_version = -1
        self._falling: dict[int, float] = {}

    def let_fall(self, prop_id: int, *, falls: bool) -> None:
        """Whether a prop falls until it lies on something."""
        if falls:
            self._falling.setdefault(prop_id, 0.0)
        else:
            self._falling.pop(prop_id, None)

    def forget_way(self, actor: Actor, velocity: Vector3) -> None:
        """How a vehicle or walker came to where it is was not motion; its velocity was another."""
        if actor.kind is ActorKind.VEHICLE:
            self.fleet.forget_way(actor.actor_id, velocity)
        elif actor.kind is ActorKind.WALKER:
            row = self._table.row(actor.actor_id)
            self._table.velocity[row] = velocity
            self._walkers.forget_way(actor.actor_id, self._table.location[row])

    def step(
        self,
        delta_s: float,
        physics: PhysicsStep,
        puddles_percent: float,
        before_substep: Callable[[float], None] | None = None,
    ) -> None:
        """One tick.

        Args:
            delta_s: its duration.
            physics: how much of it vehicles move, and in how many parts.
            puddles_percent: water on the road.
            before_substep: called with the duration of each part before it, for controllers.
        """
        table, fleet = self._table, self.fleet
        self._hide_objects()
        solids = Solids(table)
        if len(fleet):
            self._set_grip(puddles_percent)
        fleet.step(
            delta_s,
            physics.substeps,
            moving_s=physics.duration_s,
            others=solids.others,
            before_substep=before_substep,
        )
        # The rows of the fleet ascend by id, as the table's do.
        rows = table.rows_of_kind(ActorKind.VEHICLE)
        table.location[rows] = fleet.location
        table.rotation_deg[rows] = fleet.rotation_deg
        table.velocity[rows] = fleet.velocity
        table.angular_velocity_deg[rows] = fleet.angular_velocity_deg
        table.acceleration[rows] = fleet.acceleration
        touches = fleet.crashes.touches
        self._drop(delta_s)
        walkers = table.of_kind(ActorKind.WALKER)
        if touches:
            self._walkers.knock(walkers, *solids.pushed(table))
        self._walkers.step(table, walkers, delta_s)
        ids = [*fleet.ids.tolist(), *(actor.actor_id for actor in solids.actors)]
        self.collisions = collisions_of_tick(touches, ids)

    def walker_falls(self, actor_id: int) -> bool:
        """Whether a walker was in the air after the last tick."""
        return self._walkers.falls(actor_id)

    def lifted(self, pose: Pose, half_height_m: float) -> Pose:
        """Where a walker stands that is put to a place with its feet in the ground.

        Programs spawn walkers at places of the navigation mesh, which are those of feet, though an
        actor's origin is at mid height. CARLA spawns them: Unreal moves them out of the ground.
        A surface that is higher than a foot can step up, seen from the origin, is above the walker.
        """
        x, y, z = pose.location
        (ground,) = self._terrain.ground.height_below(np.array([pose.location])).tolist()
        if not ground - (z - half_height_m) > STEP_UP_M:  # it may be NaN
            return pose
        return pose._replace(location=(x, y, ground + half_height_m))

    def _drop(self, delta_s: float) -> None:
        """Props that have physics: free fall, then rest."""
        table = self._table
        for prop_id, speed in list(self._falling.items()):
            prop = table.get(prop_id)
            if prop is not None and prop.gravity and prop.parent_id not in table:
                row = table.row(prop_id)
                low_m = prop.box_center[2] - prop.box_extent[2]
                bottom = table.location[row] + [0.0, 0.0, low_m]
                (ground,) = self._terrain.ground.height_below(bottom[None]).tolist()
                drop = speed * delta_s + 0.5 * GRAVITY * delta_s**2
                lies = bottom[2] - drop <= ground  # false where there is none
                table.location[row, 2] = ground - low_m if lies else table.location[row, 2] - drop
                speed = 0.0 if lies else min(speed + GRAVITY * delta_s, TERMINAL_SPEED)
                table.velocity[row] = 0.0, 0.0, -speed
                self._falling[prop_id] = speed

    def fallen(self) -> list[int]:
        """Ids of vehicles, walkers and falling props that have left the world downwards."""
        low = self._table.location[:, 2] < KILL_HEIGHT_M
        if not low.any():
            return []
        falls = np.isin(self._table.kind, (ActorKind.VEHICLE, ActorKind.WALKER))
        falls |= np.isin(self._table.actor_id, list(self._falling))
        return [int(actor_id) for actor_id in self._table.actor_id[low & falls]]

    def _hide_objects(self) -> None:
        # The obstacles are shared by episodes: what an earlier one hid is not hidden in this one.
        if self._objects.version == self._hidden_version:
            return
        self._hidden_version = self._objects.version
        self._obstacles.hide(self._objects.hidden())

    def zone_friction(self, actor_id: int) -> float | None:
        """Tyre friction that a trigger imposes on a vehicle where it is; None outside of all."""
        friction = self._zone_friction()
        if friction is None:
            return None
        imposed = float(friction[self.fleet.row(actor_id)])
        return None if math.isnan(imposed) else imposed

    def _set_grip(self, puddles_percent: float) -> None:
        self.fleet.set_grip(puddles_percent, self._zone_friction())

    def _zone_friction(self) -> NDArray[np.float64] | None:
        triggers = [
            actor
            for actor in self._table.of_kind(ActorKind.OTHER)
            if actor.type_id == FRICTION_TRIGGER
        ]
        if not triggers:
            return None
        return zone_friction(triggers, self._table, *self.fleet.footprints())
