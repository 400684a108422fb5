"""Plays a log back into a world, tick by tick.

As in CARLA, replayed vehicles and walkers lose their physics and their collisions, and get both
back at the end, where vehicles are left standing with free pedals for whoever drives them next.
Otherwise than in CARLA, whose replay is one recorded frame late, the frame at a recorded time shows
the poses of that time.
"""

from __future__ import annotations

import bisect
import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage_sim.recording.events import ActorAdded, actors_added, bones, pose_of_ue, wheels
from carstage_sim.recording.layout import GAMMA, Packet, records
from carstage_sim.recording.log import RecordingLog
from carstage_sim.world.controls import VehicleControl, WalkerControl
from carstage_sim.world.errors import SpawnError
from carstage_sim.world.pose import ZERO, Pose, compose
from carstage_sim.world.state import ActorKind, Weather
from carstage_sim.world.street_lights import LightState
from carstage_sim.world.walker_bones import pose_bones
from carstage_sim.world.world import World

logger = logging.getLogger(__name__)

FOLLOWING = Pose((-10.0, 0.0, 5.0), (-25.0, 0.0, 0.0))
"""Where the spectator is to the actor that it follows, unless a client says otherwise."""


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


class Replayer:
    """One replay in one episode; it owns the log.

    Args:
        log: what to play; closed by :meth:`stop`.
        world: where.
        options: from when to when, and what to leave out.
    """

    def __init__(self, log: RecordingLog, world: World, options: ReplayOptions) -> None:
        self._log = log
        self._world = world
        self._options = options
        self._elapsed_s = [frame.elapsed_s for frame in log.frames]
        self._time_s, self._end_s = options.span_s(log.duration_s)
        self._mapped: dict[int, int] = {}
        self._created: list[int] = []
        self._next = 0
        self._poses: tuple[int, Mapping[int, NDArray[np.float32]]] = (-1, {})
        self.running = bool(log.frames)
        world.lights.led = self.running
        self._play_events_until(self._frame_at(self._time_s))

    def advance(self, delta_s: float) -> None:
        """Bring the world to the recorded moment ``delta_s`` later, before it ticks."""
        if not self.running:
            return
        self._time_s += delta_s
        frame = self._frame_at(self._time_s)
        self._play_events_until(frame)
        self._show(frame)
        self._place(frame)
        self._follow()

    def finish_if_over(self) -> None:
        """End the replay after the tick that showed its last moment."""
        if self.running and self._time_s >= self._end_s - 1e-6:
            self.stop(keep_actors=True)

    def stop(self, *, keep_actors: bool) -> None:
        """End the replay where it is; may be called twice.

        Args:
            keep_actors: leave the actors that the replay brought; otherwise they are destroyed.
        """
        self._log.close()
        if not self.running:
            return
        self.running = False
        self._world.lights.led = False
        self._world.lights.adopt_states()
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
            world.control_walker(actor_id, replace(actor.walker, speed=0.0))
            world.set_simulate_physics(actor_id, True)
        elif actor.parent_id not in world.actors:
            world.set_simulate_physics(actor_id, True)
            world.set_target_velocity(actor_id, ZERO)
            world.control_vehicle(actor_id, VehicleControl(gear=1))

    def _frame_at(self, time_s: float) -> int:
        """Index of the last frame that is not after a time; -1 for an empty log."""
        return bisect.bisect_right(self._elapsed_s, time_s + 1e-9) - 1

    # Who comes and goes --------------------------------------------------------------------------

    def _play_events_until(self, last: int) -> None:
        """Add and remove actors up to and with a frame; nothing is added twice."""
        while self._next <= last:
            packets = list(self._log.packets(self._next))
            self._next += 1
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
                elif kind == Packet.EVENT_DEL:
                    for row in records(Packet.EVENT_DEL, payload):
                        self._remove(int(row["id"]))
                elif kind == Packet.VEHICLE_DOOR:
                    self._move_doors(records(Packet.VEHICLE_DOOR, payload))
                elif kind == Packet.SCENE_LIGHT:
                    self._switch_lamps(records(Packet.SCENE_LIGHT, payload))
                elif kind == Packet.WEATHER:
                    for row in records(Packet.WEATHER, payload):
                        self._world.set_weather(Weather(*row["values"].tolist()))

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

    def _remove(self, recorded_id: int) -> None:
        actor_id = self._mapped.pop(recorded_id, 0)
        if actor_id:
            self._world.destroy(actor_id)

    def _move_doors(self, rows: NDArray[np.void]) -> None:
        for row in rows:
            actor = self._world.actors.get(self._mapped.get(int(row["id"]), 0))
            if actor is not None and actor.vehicle is not None:
                bit = 1 << int(row["door"])
                doors = actor.vehicle.open_doors & ~bit
                actor.vehicle.open_doors = doors | bit if row["open"] else doors

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

    # What a frame shows --------------------------------------------------------------------------

    def _show(self, frame: int) -> None:
        """Everything of a frame but poses."""
        for kind, payload in self._log.packets(frame):
            if kind == Packet.STATE:
                self._show_lights(records(Packet.STATE, payload))
            elif kind == Packet.ANIM_VEHICLE:
                for row in records(Packet.ANIM_VEHICLE, payload):
                    self._control(row)
            elif kind == Packet.ANIM_VEHICLE_WHEELS:
                for recorded_id, seen in wheels(payload):
                    actor = self._world.actors.get(self._mapped.get(recorded_id, 0))
                    if actor is not None and actor.vehicle is not None and seen:
                        angle_deg = max((wheel.steer_deg for wheel in seen), key=abs)
                        self._world.fleet.set_wheel_angle(actor.actor_id, angle_deg)
            elif kind == Packet.VEHICLE_LIGHT:
                for row in records(Packet.VEHICLE_LIGHT, payload):
                    actor = self._world.actors.get(self._mapped.get(int(row["id"]), 0))
                    if actor is not None and actor.vehicle is not None:
                        actor.vehicle.light_state = int(row["state"])
            elif kind == Packet.ANIM_WALKER:
                for row in records(Packet.ANIM_WALKER, payload):
                    self._walk(row)
            elif kind == Packet.WALKER_BONES:
                for recorded_id, posed in bones(payload):
                    actor = self._world.actors.get(self._mapped.get(recorded_id, 0))
                    if actor is not None and actor.kind is ActorKind.WALKER:
                        pose_bones(actor, posed, blend=1.0)

    def _show_lights(self, rows: NDArray[np.void]) -> None:
        lights = self._world.lights
        for row in rows:
            actor_id = self._mapped.get(int(row["id"]), 0)
            if actor_id in self._world.light_ids:
                index = self._world.light_index(actor_id)
                lights.show(index, int(row["state"]), float(row["elapsed"]))
                lights.frozen[index] = bool(row["frozen"])

    def _control(self, row: Any) -> None:
        actor_id = self._mapped.get(int(row["id"]), 0)
        if actor_id not in self._world.actors:
            return
        gear = int(row["gear"])
        control = VehicleControl(
            float(row["throttle"]),
            float(row["steer"]),
            float(row["brake"]),
            bool(row["hand_brake"]),
            reverse=gear < 0,
            gear=gear,
        )
        self._world.control_vehicle(actor_id, control)

    def _walk(self, row: Any) -> None:
        actor_id = self._mapped.get(int(row["id"]), 0)
        if actor_id not in self._world.actors:
            return
        yaw_rad = np.radians(self._world.actors.pose(actor_id).rotation_deg[1])
        direction = (float(np.cos(yaw_rad)), float(np.sin(yaw_rad)), 0.0)
        self._world.control_walker(actor_id, WalkerControl(direction, float(row["speed"])))

    def _place(self, frame: int) -> None:
        """Poses between this frame and the next one."""
        here = self._positions(frame)
        last = frame + 1 >= len(self._elapsed_s)
        after = here if last else self._positions(frame + 1, keep=False)
        lasts_s = 1.0 if last else self._elapsed_s[frame + 1] - self._elapsed_s[frame]
        share = (self._time_s - self._elapsed_s[frame]) / lasts_s if lasts_s > 0.0 else 0.0
        for recorded_id, numbers in here.items():
            actor = self._world.actors.get(self._mapped.get(recorded_id, 0))
            if actor is None or actor.parent_id in self._world.actors:
                continue
            pose = _between(numbers, after.get(recorded_id, numbers), min(max(share, 0.0), 1.0))
            self._world.set_pose(actor.actor_id, pose)

    def _positions(self, frame: int, *, keep: bool = True) -> Mapping[int, NDArray[np.float32]]:
        """Recorded poses of a frame by recorded id: six numbers in UE's units."""
        if self._poses[0] == frame:
            return self._poses[1]
        found = {
            int(row["id"]): np.concatenate([row["location"], row["rotation"]])
            for kind, payload in self._log.packets(frame)
            if kind == Packet.POSITION
            for row in records(Packet.POSITION, payload)
        }
        if keep:
            self._poses = (frame, found)
        return found

    def _follow(self) -> None:
        target = self._mapped.get(self._options.follow_id, 0)
        if target in self._world.actors:
            pose = compose(self._world.actors.pose(target), self._options.follow_offset)
            self._world.set_pose(self._world.spectator.actor_id, pose)


def _between(first: NDArray[np.float32], second: NDArray[np.float32], share: float) -> Pose:
    """A pose on the way from one to another; angles take the short way."""
    start, step = first.astype(np.float64), second.astype(np.float64) - first
    step[3:] = (step[3:] + 180.0) % 360.0 - 180.0
    return pose_of_ue((start + share * step).tolist())
