"""The actors of a replay: who comes, who goes, and which living actor plays which recorded one."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.recording.events import ActorAdded, actors_added
from carstage_sim.recording.layout import GAMMA, Packet, records
from carstage_sim.world.actors import Actor
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.errors import SpawnError
from carstage_sim.world.pose import ZERO, Pose
from carstage_sim.world.state import ActorKind, Weather
from carstage_sim.world.street_lights import LightState
from carstage_sim.world.world import World

logger = logging.getLogger(__name__)

FOLLOWING = Pose((-10.0, 0.0, 5.0), (-25.0, 0.0, 0.0))
"""Where the spectator is to the actor that it follows, unless a client says otherwise."""

_ALL_DOORS = 6
"""``carla.VehicleDoor.All``; no door has a higher number."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """What a client asks of a replay.

    Attributes:
        start_s: recorded time to begin at; negative counts from the end.
        duration_s: recorded time to play, 0 or less for the rest.
        follow_id: recorded id of the actor that the spectator follows, 0 for none.
        follow_offset: the spectator's pose in that actor's frame.
        sensors: whether recorded sensors are spawned too.
        ignore_hero: leave out vehicles whose ``role_name`` is ``hero``.
        ignore_spectator: leave the spectator alone.
    """

    start_s: float = 0.0
    duration_s: float = 0.0
    follow_id: int = 0
    follow_offset: Pose = FOLLOWING
    sensors: bool = False
    ignore_hero: bool = False
    ignore_spectator: bool = True

    def span_s(self, total_s: float) -> tuple[float, float]:
        """First and last recorded time of the replay of a log of that length."""
        start_s = self.start_s if self.start_s >= 0.0 else max(total_s + self.start_s, 0.0)
        return start_s, start_s + self.duration_s if self.duration_s > 0.0 else total_s


class ReplayCast:
    """Recorded actors and those that play them.

    As in CARLA, a living actor of the same id and type plays itself; others are spawned, with their
    recorded ids where these are free. Lights are found by their places.

    Args:
        world: where.
        options: whom to leave out.
    """

    def __init__(self, world: World, options: ReplayOptions) -> None:
        self._world = world
        self._options = options
        self._mapped: dict[int, int] = {}
        self._created: list[int] = []

    def actor(self, recorded_id: int) -> Actor | None:
        """The living actor that plays a recorded one."""
        return self._world.actors.get(self._mapped.get(recorded_id, 0))

    def play(self, packets: Sequence[tuple[int, bytes]]) -> set[int]:
        """What happens once in a frame: actors come and go, doors, lamps and weather change.

        Returns:
            Recorded ids of the actors that come.
        """
        newcomers: set[int] = set()
        parents = {
            int(row["id"]): int(row["parent"])
            for kind, payload in packets
            if kind == Packet.EVENT_PARENT
            for row in records(Packet.EVENT_PARENT, payload)
        }
        for kind, payload in packets:
            if kind == Packet.EVENT_ADD:
                for added in actors_added(payload):
                    self._add(added, parents.get(added.actor_id, 0))
                    newcomers.add(added.actor_id)
            elif kind == Packet.EVENT_DEL:
                for row in records(Packet.EVENT_DEL, payload):
                    self._world.destroy(self._mapped.pop(int(row["id"]), 0))
            elif kind == Packet.VEHICLE_DOOR:
                self._move_doors(records(Packet.VEHICLE_DOOR, payload))
            elif kind == Packet.SCENE_LIGHT:
                self._switch_lamps(records(Packet.SCENE_LIGHT, payload))
            elif kind == Packet.WEATHER:
                for row in records(Packet.WEATHER, payload):
                    self._world.set_weather(Weather(*row["values"].tolist()))
        return newcomers

    def dismiss(self, *, keep_actors: bool) -> None:
        """Give physics back to all.

        Args:
            keep_actors: whether those that the replay spawned stay.
        """
        if not keep_actors:
            for actor_id in reversed(self._created):
                self._world.destroy(actor_id)
        for actor_id in self._mapped.values():
            self._release(actor_id)

    def _release(self, actor_id: int) -> None:
        world, actor = self._world, self._world.actors.get(actor_id)
        if actor is None or actor.kind not in (ActorKind.VEHICLE, ActorKind.WALKER):
            return
        world.set_collides(actor_id, True)
        if actor.kind is ActorKind.WALKER:
            world.control_walker(actor_id, actor.walker._replace(speed=0.0))
            world.set_simulate_physics(actor_id, True)
        elif actor.parent_id not in world.actors:
            world.set_simulate_physics(actor_id, True)
            world.set_target_velocity(actor_id, ZERO)
            world.control_vehicle(actor_id, VehicleControl(gear=1))

    def _add(self, added: ActorAdded, recorded_parent: int) -> None:
        world, options = self._world, self._options
        if options.ignore_hero and added.is_hero:
            return
        if added.type_id == "spectator":
            if not options.ignore_spectator:
                self._mapped[added.actor_id] = world.spectator.actor_id
            return
        if added.type_id.startswith("traffic."):
            light = self._light_at(added.pose)
            if light:
                self._mapped[added.actor_id] = light
            return
        if added.type_id.startswith("sensor.") and not options.sensors:
            return
        if not np.isfinite(added.pose).all():
            logger.warning("not replayed: %s: its pose is not finite", added.type_id)
            return
        living = world.actors.get(added.actor_id)
        if living is not None and living.type_id == added.type_id:
            actor_id = living.actor_id
        else:
            parent_id = self._mapped.get(recorded_parent, 0)
            try:
                actor_id = world.spawn(
                    added.type_id,
                    {name: value for _, name, value in added.attributes},
                    added.pose,
                    parent_id=parent_id,
                    wanted_id=added.actor_id,
                ).actor_id
            except SpawnError as error:
                logger.warning("not replayed: %s: %s", added.type_id, error)
                return
            self._created.append(actor_id)
        self._mapped[added.actor_id] = actor_id
        if added.kind in (ActorKind.VEHICLE, ActorKind.WALKER):
            world.set_simulate_physics(actor_id, False)
            world.set_collides(actor_id, False)

    def _move_doors(self, rows: NDArray[np.void]) -> None:
        for row in rows:
            actor, door = self.actor(int(row["id"])), int(row["door"])
            if actor is None or actor.vehicle is None or door > _ALL_DOORS:
                continue
            bits = (1 << _ALL_DOORS) - 1 if door == _ALL_DOORS else 1 << door
            doors = actor.vehicle.open_doors & ~bits
            actor.vehicle.open_doors = doors | bits if row["open"] else doors

    def _switch_lamps(self, rows: NDArray[np.void]) -> None:
        lamps = []
        for row in rows:
            codes = np.rint(np.clip(row["colour"][:3], 0.0, 1.0) ** (1.0 / GAMMA) * 255.0)
            red, green, blue = codes.astype(int).tolist()
            lamps.append(
                LightState(
                    int(row["id"]),
                    float(row["intensity"]),
                    int(row["type"]),
                    (red, green, blue),
                    bool(row["on"]),
                )
            )
        self._world.street_lights.apply(lamps)

    def _light_at(self, pose: Pose) -> int:
        """The light at a recorded place, to the centimetre; 0 where the map has none."""
        place = np.array(pose.location)
        for actor_id in self._world.light_ids:
            if np.abs(np.array(self._world.actors.pose(actor_id).location) - place).max() < 0.011:
                return actor_id
        return 0
