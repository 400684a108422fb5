"""Actors and the table of their motion: one row per live actor, ascending ids."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from carstage_sim.world.blueprints import Blueprint
from carstage_sim.world.blueprints.walkers import uses_wheelchair
from carstage_sim.world.controls import (
    AckermannSettings,
    VehicleControl,
    WalkerControl,
)
from carstage_sim.world.pose import ZERO, Pose, Vector3
from carstage_sim.world.spring_arm import RIGID, Attachment, SpringArm
from carstage_sim.world.state import ActorKind
from carstage_sim.world.vehicles.ackermann import AckermannController
from carstage_sim.world.vehicles.parameters import VehicleParameters
from carstage_sim.world.walkers.bone_pose import BonePose

_HERO_ROLES = ("hero", "ego_vehicle")


@dataclass(slots=True, eq=False)
class VehicleStatus:
    """What clients commanded a vehicle apart from its motion.

    Attributes:
        control: pedals and wheel as last set, also by the Ackermann controller.
        sticky: whether they stay as they are; else they last for one tick.
        commanded: whether they were set since the last tick.
        ackermann: the controller that drives, None while pedals are set directly.
        ackermann_settings: its gains.
        light_state: ``carla.VehicleLightState`` bits.
        parameters: physics control that a client applied, None for the blueprint's.
        open_doors: a bit ``1 << carla.VehicleDoor`` for each open door.
        posed_wheels_deg: steering angles that clients gave wheels by their numbers; they show while
            the vehicle does not simulate physics.
        posed_wheel_pitch_deg: the same of the angles about the wheels' axles.
    """

    control: VehicleControl = field(default_factory=VehicleControl)
    sticky: bool = True
    commanded: bool = False
    ackermann: AckermannController | None = None
    ackermann_settings: AckermannSettings = field(default_factory=AckermannSettings)
    light_state: int = 0
    parameters: VehicleParameters | None = None
    open_doors: int = 0
    posed_wheels_deg: dict[int, float] = field(default_factory=dict)
    posed_wheel_pitch_deg: dict[int, float] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class Actor:
    """A live or lately destroyed actor.

    Attributes:
        actor_id: > 0.
        type_id: blueprint id; clients choose the actor's class by it.
        attributes: all attributes of the blueprint with the values that the client set.
        box_center, box_extent: bounding box in the actor's frame, half sizes, metres.
        blueprint: None for what only the map brings (lights, the spectator).
        parent_id: actor that it is attached to, 0 for none.
        relative: pose in the parent's frame, used while the parent lives; in the frame of the
            arm's end where an arm carries it.
        attachment: how it follows its parent.
        arm: the spring arm that carries it.
        stream_id: stream of its data, 0 for what is no sensor.
        client: number of the connection that spawned it, 0 for nobody's.
        ignored: of a sensor, the ids of actors that it looks through.
        gbuffers: of a camera, the streams of the renderer's buffers that clients asked for, by
            CARLA's number.
        simulate_physics: whether the dynamics move it.
        collides: whether spawning onto it is refused.
        bones: the pose that a client gave a walker's bones, None for its walk.
    """

    actor_id: int
    type_id: str
    kind: ActorKind
    attributes: Mapping[str, str]
    box_center: Vector3
    box_extent: Vector3
    semantic_tags: tuple[int, ...]
    blueprint: Blueprint | None = None
    parent_id: int = 0
    relative: Pose = field(default_factory=Pose)
    attachment: Attachment = RIGID
    arm: SpringArm | None = None
    stream_id: int = 0
    client: int = 0
    ignored: frozenset[int] = frozenset()
    gbuffers: dict[int, int] = field(default_factory=dict)
    simulate_physics: bool = True
    gravity: bool = True
    collides: bool = True
    vehicle: VehicleStatus | None = None
    walker: WalkerControl = field(default_factory=WalkerControl)
    bones: BonePose | None = None

    @property
    def uses_wheelchair(self) -> bool:
        """Whether it is a walker in a wheelchair."""
        return self.kind is ActorKind.WALKER and uses_wheelchair(self.attributes)

    @property
    def is_hero(self) -> bool:
        """Whether its ``role_name`` contains ``hero`` or ``ego_vehicle``."""
        role = self.attributes.get("role_name", "").lower()
        return any(name in role for name in _HERO_ROLES)

    @property
    def colour(self) -> tuple[int, int, int]:
        """Paint colour, black for none."""
        parts = self.attributes.get("color", "").split(",")
        if len(parts) != 3:
            return (0, 0, 0)
        red, green, blue = (int(float(part)) for part in parts)
        return (red, green, blue)


class ActorTable:
    """Live actors and the arrays of their motion, kept in the same order.

    Attributes:
        location, rotation_deg, velocity, angular_velocity_deg, acceleration: ``(N, 3)`` float64 in
            the world, one row per actor. Commands and dynamics write them in place.
        wheelchairs: ids of the walkers in wheelchairs.
        hero_id: the first actor with the role of a hero, 0 for none.
    """

    def __init__(self) -> None:
        self._actors: dict[int, Actor] = {}
        self._rows: dict[int, int] = {}
        self._groups: dict[ActorKind, tuple[Actor, ...]] = dict.fromkeys(ActorKind, ())
        self._rows_of_kind = dict.fromkeys(ActorKind, np.zeros(0, np.intp))
        self.location: NDArray[np.float64] = np.zeros((0, 3))
        self.rotation_deg: NDArray[np.float64] = np.zeros((0, 3))
        self.velocity: NDArray[np.float64] = np.zeros((0, 3))
        self.angular_velocity_deg: NDArray[np.float64] = np.zeros((0, 3))
        self.acceleration: NDArray[np.float64] = np.zeros((0, 3))
        self.actor_id: NDArray[np.uint32] = np.zeros(0, np.uint32)
        self.kind: NDArray[np.uint8] = np.zeros(0, np.uint8)
        self.colour: NDArray[np.uint8] = np.zeros((0, 3), np.uint8)
        self.type_id: tuple[str, ...] = ()
        self.wheelchairs: frozenset[int] = frozenset()
        self.hero_id = 0

    def __len__(self) -> int:
        return len(self._actors)

    def __contains__(self, actor_id: int) -> bool:
        return actor_id in self._actors

    def __iter__(self) -> Iterator[Actor]:
        return iter(self._actors.values())

    def get(self, actor_id: int) -> Actor | None:
        """The live actor of that id."""
        return self._actors.get(actor_id)

    def row(self, actor_id: int) -> int:
        """Row of a live actor.

        Raises:
            KeyError: it does not live.
        """
        return self._rows[actor_id]

    def rows(self, actor_ids: Iterable[int]) -> NDArray[np.intp]:
        """Rows of live actors."""
        return np.array([self._rows[actor_id] for actor_id in actor_ids], np.intp)

    def of_kind(self, kind: ActorKind) -> tuple[Actor, ...]:
        """The actors of a kind, ascending ids."""
        return self._groups[kind]

    def rows_of_kind(self, kind: ActorKind) -> NDArray[np.intp]:
        """Rows of the actors of a kind, in the order of :meth:`of_kind`; not to be written to."""
        return self._rows_of_kind[kind]

    def pose(self, actor_id: int) -> Pose:
        """Pose of a live actor in the world."""
        row = self._rows[actor_id]
        x, y, z = self.location[row].tolist()
        pitch, yaw, roll = self.rotation_deg[row].tolist()
        return Pose((x, y, z), (pitch, yaw, roll))

    def stop(self, actor_ids: Iterable[int]) -> None:
        """Let actors have no velocity, spin and acceleration, as what is carried no more."""
        rows = self.rows(actor_ids)
        for column in (self.velocity, self.angular_velocity_deg, self.acceleration):
            column[rows] = 0.0

    def set_pose(self, actor_id: int, pose: Pose) -> None:
        """Write an actor's row."""
        row = self._rows[actor_id]
        self.location[row] = pose.location
        self.rotation_deg[row] = pose.rotation_deg

    def add(self, actor: Actor, pose: Pose) -> None:
        """Insert an actor before those of higher ids."""
        row = int(np.searchsorted(self.actor_id, actor.actor_id))
        actors = list(self._actors.values())
        actors.insert(row, actor)
        self._actors = {one.actor_id: one for one in actors}
        for name in ("velocity", "angular_velocity_deg", "acceleration"):
            setattr(self, name, np.insert(getattr(self, name), row, ZERO, axis=0))
        self.location = np.insert(self.location, row, pose.location, axis=0)
        self.rotation_deg = np.insert(self.rotation_deg, row, pose.rotation_deg, axis=0)
        self._reindex()

    def remove(self, actor_id: int) -> Actor:
        """Take an actor out; its children stay where they are.

        Raises:
            KeyError: it does not live.
        """
        row = self._rows[actor_id]
        actor = self._actors.pop(actor_id)
        for name in ("location", "rotation_deg", "velocity", "angular_velocity_deg"):
            setattr(self, name, np.delete(getattr(self, name), row, axis=0))
        self.acceleration = np.delete(self.acceleration, row, axis=0)
        self._reindex()
        return actor

    def _reindex(self) -> None:
        actors = list(self._actors.values())
        self._rows = {actor.actor_id: row for row, actor in enumerate(actors)}
        groups: dict[ActorKind, list[Actor]] = {kind: [] for kind in ActorKind}
        for actor in actors:
            groups[actor.kind].append(actor)
        self._groups = {kind: tuple(group) for kind, group in groups.items()}
        self.actor_id = np.fromiter(self._rows, np.uint32, len(actors))
        self.kind = np.fromiter((actor.kind for actor in actors), np.uint8, len(actors))
        self._rows_of_kind = {kind: np.flatnonzero(self.kind == kind) for kind in ActorKind}
        self.colour = np.array([a.colour for a in actors], np.uint8).reshape(-1, 3)
        self.type_id = tuple(actor.type_id for actor in actors)
        self.wheelchairs = frozenset(a.actor_id for a in actors if a.uses_wheelchair)
        self.hero_id = next((a.actor_id for a in actors if a.is_hero), 0)
