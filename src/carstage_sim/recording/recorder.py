"""Writes what happens in a world to a log, one frame per tick."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carstage_sim.geometry import pose_matrix
from carstage_sim.recording.changes import Changes
from carstage_sim.recording.errors import RecordingError
from carstage_sim.recording.events import (
    CM_PER_M,
    ActorAdded,
    PhysicsRecord,
    WheelPose,
    actors_added_packet,
    bones_packet,
    physics_packet,
    wheels_packet,
)
from carstage_sim.recording.layout import (
    FRAME,
    NO_ACTOR,
    UNKNOWN_DURATION_S,
    VERSION,
    LogInfo,
    Packet,
    packet,
    rows_packet,
)
from carstage_sim.world.actors import Actor
from carstage_sim.world.blueprints.model import AttributeType
from carstage_sim.world.columns import Control, Rotation
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.state import ActorKind, Collision
from carstage_sim.world.world import World

_SYMBOLIC_DATE = 0


class Recorder:
    """One recording of one episode.

    The first tick is the log's frame 1, at 0 s. As the same commands shall give the same bytes, no
    wall time is written: the date is 0, and the platform's time is the simulated one.

    Args:
        path: the file, which is replaced.
        world: the episode.
        additional_data: also write velocities, boxes, physics, lights' times.

    Raises:
        RecordingError: the file cannot be written.
    """

    def __init__(self, path: Path, world: World, *, additional_data: bool) -> None:
        self.path = path
        self._world = world
        self._additional = additional_data
        self._known: NDArray[np.uint32] = np.zeros(0, np.uint32)
        self._rolled_deg: dict[int, NDArray[np.float64]] = {}
        self._changes = Changes(world.street_lights)
        self._collision_count = 0
        self._frames = 0
        self._elapsed_s = 0.0
        self._held: bytes = b""
        info = LogInfo(VERSION, _SYMBOLIC_DATE, f"Carla/Maps/{world.town.name}")
        with self._writing():
            self._file = path.open("wb")
            self._file.write(info.encode())

    def record(self, snapshot: Snapshot) -> None:
        """Add a frame: the one that the world has just frozen.

        Raises:
            RecordingError: the disk is full, or the file gone.
        """
        delta_s = snapshot.state.delta_s if self._frames else 0.0
        self._write_held(delta_s)
        self._frames += 1
        self._elapsed_s += delta_s
        self._held = b"".join(self._packets(snapshot))

    def flush(self) -> None:
        """Let readers of the file see all frames but the last.

        Raises:
            RecordingError: the disk is full, or the file gone.
        """
        with self._writing():
            self._file.flush()

    def close(self) -> None:
        """Write the last frame and give the file back; may be called twice.

        Raises:
            RecordingError: the end could not be written; the file is given back all the same.
        """
        if self._file.closed:
            return
        with self._writing(), self._file:
            self._write_held(UNKNOWN_DURATION_S)

    def _write_held(self, duration_s: float) -> None:
        """The last frame, now that the next one tells how long it was."""
        if not self._held:
            return
        frame = FRAME.pack(self._frames, duration_s, self._elapsed_s)
        with self._writing():
            self._file.write(packet(Packet.FRAME_START, frame) + self._held)
        self._held = b""

    @contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise RecordingError(f"cannot write {self.path}: {error.strerror}") from error

    def _packets(self, snapshot: Snapshot) -> list[bytes]:
        state = snapshot.state
        ids = state.actor_id
        added = [
            actor
            for actor_id in np.setdiff1d(ids, self._known).tolist()
            if (actor := self._world.actors.get(actor_id)) is not None
        ]
        gone = np.setdiff1d(self._known, ids)
        self._known = ids
        attached = [actor for actor in added if actor.parent_id in self._world.actors]
        parts = [
            packet(Packet.VISUAL_TIME, struct.pack("<d", state.timestamp_s)),
            actors_added_packet([self._added(actor) for actor in added]),
            rows_packet(Packet.EVENT_DEL, id=gone),
            rows_packet(
                Packet.EVENT_PARENT,
                id=[actor.actor_id for actor in attached],
                parent=[actor.parent_id for actor in attached],
            ),
            self._collisions(state.collisions),
            self._positions(snapshot),
            self._lights(snapshot),
            *self._vehicles(snapshot),
            *self._changes.since_the_last_frame(snapshot),
        ]
        if self._additional:
            parts += self._additional_data(snapshot, added)
        return [*parts, packet(Packet.FRAME_END, b"")]

    def _added(self, actor: Actor) -> ActorAdded:
        blueprint = actor.blueprint
        types = {a.id: a.type for a in blueprint.attributes} if blueprint is not None else {}
        pose = self._world.actors.pose(actor.actor_id)
        if actor.parent_id in self._world.actors:
            # A replay attaches rigidly, also what an arm carries.
            pose = actor.relative
            pose = pose._replace(location=actor.arm.end) if actor.arm is not None else pose
        return ActorAdded(
            actor.actor_id,
            int(actor.kind),
            pose,
            blueprint.uid if blueprint is not None else 0,
            actor.type_id,
            tuple(
                (int(types.get(name, AttributeType.STRING)), name, value)
                for name, value in actor.attributes.items()
            ),
        )

    def _collisions(self, collisions: Sequence[Collision]) -> bytes:
        pairs = [self._pair(collision) for collision in collisions]
        first = self._collision_count
        self._collision_count += len(pairs)
        return rows_packet(
            Packet.COLLISION,
            id=np.arange(first, self._collision_count),
            first=[pair[0] for pair in pairs],
            second=[pair[1] for pair in pairs],
            first_is_hero=[self._is_hero(pair[0]) for pair in pairs],
            second_is_hero=[self._is_hero(pair[1]) for pair in pairs],
        )

    def _pair(self, collision: Collision) -> tuple[int, int]:
        """Who hit whom: the hero before others, vehicles before walkers, the town last.

        In CARLA the first one is who carries the sensor, and queries name it first.
        """
        if not collision.second_id:
            return collision.first_id, NO_ACTOR
        first, second = sorted((collision.first_id, collision.second_id), key=self._rank)
        return first, second

    def _rank(self, actor_id: int) -> tuple[bool, int, int]:
        actor = self._world.actors.get(actor_id)
        kind = int(actor.kind) if actor is not None else int(ActorKind.SENSOR)
        return (not self._is_hero(actor_id), kind, actor_id)

    def _is_hero(self, actor_id: int) -> bool:
        actor = self._world.actors.get(actor_id)
        return actor is not None and actor.attributes.get("role_name") == "hero"

    @staticmethod
    def _positions(snapshot: Snapshot) -> bytes:
        """Poses of vehicles, walkers and others; sensors and lights have none in a log."""
        state = snapshot.state
        rows = np.isin(state.kind, (ActorKind.OTHER, ActorKind.VEHICLE, ActorKind.WALKER))
        return rows_packet(
            Packet.POSITION,
            id=state.actor_id[rows],
            location=state.location[rows] * CM_PER_M,
            rotation=state.rotation_deg[rows][:, [Rotation.ROLL, Rotation.PITCH, Rotation.YAW]],
        )

    @staticmethod
    def _lights(snapshot: Snapshot) -> bytes:
        lights = snapshot.traffic_lights
        return rows_packet(
            Packet.STATE,
            id=snapshot.state.actor_id[lights.rows],
            frozen=lights.frozen,
            elapsed=lights.elapsed_s,
            state=lights.state,
        )

    def _vehicles(self, snapshot: Snapshot) -> list[bytes]:
        """Controls, speeds of walkers, lamps and wheels."""
        state, vehicles, walkers = snapshot.state, snapshot.vehicles, snapshot.walkers
        ids = state.actor_id[vehicles.rows]
        return [
            rows_packet(
                Packet.ANIM_VEHICLE,
                id=ids,
                steer=vehicles.control[:, Control.STEER],
                throttle=vehicles.control[:, Control.THROTTLE],
                brake=vehicles.control[:, Control.BRAKE],
                hand_brake=vehicles.hand_brake,
                gear=vehicles.gear,
            ),
            rows_packet(Packet.ANIM_WALKER, id=state.actor_id[walkers.rows], speed=walkers.speed),
            rows_packet(Packet.VEHICLE_LIGHT, id=ids, state=state.light_state[vehicles.rows]),
            wheels_packet(
                (actor_id, self._wheels(snapshot, row, actor_id))
                for row, actor_id in zip(vehicles.rows.tolist(), ids.tolist(), strict=True)
            ),
        ]

    def _wheels(self, snapshot: Snapshot, row: int, actor_id: int) -> list[WheelPose]:
        state, wheels = snapshot.state, self._world.parameters(self._world.live(actor_id)).wheels
        yaw_rad = np.radians(state.rotation_deg[row, Rotation.YAW])
        speed = float(state.velocity[row, :2] @ (np.cos(yaw_rad), np.sin(yaw_rad)))
        turned = np.degrees(speed * state.delta_s / np.array([w.radius_m for w in wheels]))
        rolled = (self._rolled_deg.get(actor_id, 0.0) + turned) % 360.0
        self._rolled_deg[actor_id] = rolled
        angle_deg = float(state.wheel_angle_deg[row])
        return [
            WheelPose(number, angle_deg if wheel.max_steer_angle_deg else 0.0, turned_deg)
            for number, (wheel, turned_deg) in enumerate(zip(wheels, rolled.tolist(), strict=True))
        ]

    def _additional_data(self, snapshot: Snapshot, added: list[Actor]) -> list[bytes]:
        """What CARLA writes when a client asks for additional data."""
        state, lights = snapshot.state, self._world.lights
        moving = np.isin(state.kind, (ActorKind.VEHICLE, ActorKind.WALKER))
        parts = [
            rows_packet(
                Packet.KINEMATICS,
                id=state.actor_id[moving],
                linear=state.velocity[moving],
                angular=state.angular_velocity_deg[moving],
            ),
            self._boxes(Packet.BOUNDING_BOX, added),
            self._boxes(Packet.TRIGGER_VOLUME, added),
            packet(Packet.PLATFORM_TIME, struct.pack("<d", self._elapsed_s)),
            physics_packet([self._physics(a) for a in added if a.vehicle is not None]),
        ]
        new_lights = [a.actor_id for a in added if a.kind is ActorKind.TRAFFIC_LIGHT]
        index = [self._world.light_index(actor_id) for actor_id in new_lights]
        return [
            *parts,
            rows_packet(
                Packet.TRAFFIC_LIGHT_TIME,
                id=new_lights,
                green=lights.green_s[index],
                yellow=lights.yellow_s[index],
                red=lights.red_s[index],
            ),
            bones_packet(
                [
                    (walker.actor_id, list(walker.bones.relative.items()))
                    for walker in self._world.actors.of_kind(ActorKind.WALKER)
                    if walker.bones is not None and walker.bones.blend > 0.0
                ]
            ),
        ]

    def _boxes(self, kind: Packet, added: list[Actor]) -> bytes:
        """Boxes in the actor's frame, or the lights' trigger volumes in the world."""
        volumes = kind is Packet.TRIGGER_VOLUME
        actors = [a for a in added if (a.kind is ActorKind.TRAFFIC_LIGHT) is volumes]
        centers = [
            self._in_world(actor, actor.box_center) if volumes else actor.box_center
            for actor in actors
        ]
        return rows_packet(
            kind,
            id=[actor.actor_id for actor in actors],
            origin=np.array(centers).reshape(-1, 3) * CM_PER_M,
            extent=np.array([actor.box_extent for actor in actors]).reshape(-1, 3) * CM_PER_M,
        )

    def _physics(self, actor: Actor) -> PhysicsRecord:
        parameters = self._world.parameters(actor)
        places = [self._in_world(actor, wheel.position_m) for wheel in parameters.wheels]
        return PhysicsRecord.of(actor.actor_id, parameters, places)

    def _in_world(
        self, actor: Actor, place: tuple[float, float, float]
    ) -> tuple[float, float, float]:
        pose = self._world.actors.pose(actor.actor_id)
        x, y, z, _ = (pose_matrix(pose.location, pose.rotation_deg) @ [*place, 1.0]).tolist()
        return (x, y, z)
