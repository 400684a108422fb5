"""The world of one episode: actors, their motion, lights, weather, and the tick.

Actor ids, frame numbers and simulated time start anew with every episode, so that the same commands
give the same frames. One thread owns a world.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from carstage_sim.geometry import rotation_matrix
from carstage_sim.maps.street_lamps import street_lamps
from carstage_sim.maps.town import Town
from carstage_sim.world.actors import Actor, ActorTable, VehicleStatus
from carstage_sim.world.arm_probe import ArmProbe
from carstage_sim.world.attachments import Attachments
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.blueprints.given_values import actor_attributes
from carstage_sim.world.blueprints.walkers import seated
from carstage_sim.world.contacts.overlap import is_blocked
from carstage_sim.world.controls import (
    STANDING,
    AckermannControl,
    AckermannSettings,
    PhysicsStep,
    VehicleControl,
    WalkerControl,
)
from carstage_sim.world.debug_shapes import DebugDrawing
from carstage_sim.world.errors import (
    ActorError,
    ActorNotFoundError,
    ActorTypeError,
    SpawnError,
    WorldError,
)
from carstage_sim.world.freezing import SiteColumns, freeze, site_columns
from carstage_sim.world.lane_index import LaneIndex
from carstage_sim.world.mechanics import Mechanics, Terrain, terrain_of
from carstage_sim.world.pose import Pose, Vector3, compose, normalised
from carstage_sim.world.signals.approaches import Approaches
from carstage_sim.world.signals.arm_turns import ArmTurns
from carstage_sim.world.signals.traffic_light_actors import traffic_light_actor, traffic_sign_actor
from carstage_sim.world.signals.traffic_lights import TrafficLightSystem
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.sockets import actor_from_socket
from carstage_sim.world.spring_arm import RIGID, Attachment, arm_for
from carstage_sim.world.state import ActorKind, Collision, Weather
from carstage_sim.world.street_lights import StreetLights
from carstage_sim.world.town_changes import TownChangeTracker
from carstage_sim.world.town_objects import TownObjects
from carstage_sim.world.v2x import V2xStations
from carstage_sim.world.vehicles.ackermann import AckermannController
from carstage_sim.world.vehicles.fleet import VehicleFleet
from carstage_sim.world.vehicles.parameters import VehicleParameters
from carstage_sim.world.vehicles.poses import VehicleMotion

_REMEMBERED_DEAD = 4096
_LARGEST_WANTED_ID = 0x7FFF_FFFF
"""Ids have 32 bits, and actors that come later need higher ones."""
_FIRST_STREAM = 1
_OF_THE_MAP = frozenset({ActorKind.TRAFFIC_LIGHT, ActorKind.TRAFFIC_SIGN})
_SPECTATOR_HEIGHT_M = 20.0
LIFE_SPAN_AFTER_DEATH_S = 10.0
_M2_PER_CM2 = 1e-4
COLLISION_TEXT = "Spawn failed because of collision at spawn position"


class World:
    """One episode on one town.

    Args:
        town: the map.
        episode_id: differs from the ids of all other episodes of this server.
        previous: the world that this one replaces; its actors are remembered as destroyed ones, so
            that a client that still asks for them gets an answer.
        before_spawn: called with blueprint id and attributes before an actor is spawned; it raises
            :class:`SpawnError` to refuse it.

    Attributes:
        frame: number of the last frame; an episode starts with frame 1, before any tick.
        elapsed_s: simulated seconds since the episode began.
        weather: current weather.
        actors: the live actors.
        fleet: dynamics of the vehicles.
        lights: signal control.
        arm_turns: who enters junctions without lights.
        street_lights: lamps that clients and dusk switch.
        objects: what clients changed about the town's own objects.
        debug_drawing: what clients drew into the world.
        town_changes: gives what clients have changed about the town so far.
        v2x: what V2X sensors send.
        stream_id: stream of this episode's snapshots.
        lanes, terrain: lookups of the map.
    """

    def __init__(
        self,
        town: Town,
        episode_id: int,
        *,
        previous: World | None = None,
        before_spawn: Callable[[str, Mapping[str, str]], None] | None = None,
        wet_grip: bool = True,
    ) -> None:
        self.town = town
        self._wet_grip = wet_grip
        self.episode_id = episode_id
        self.frame = 1
        self.elapsed_s = 0.0
        self.weather = Weather()
        self.actors = ActorTable()
        self.lights = TrafficLightSystem(town.traffic_lights)
        self._sites: SiteColumns = site_columns(town, self.lights)
        self.street_lights = StreetLights(street_lamps(town.static_mesh))
        self.objects = TownObjects(town.level_objects)
        self.debug_drawing = DebugDrawing()
        self.town_changes = TownChangeTracker(self.objects, self.street_lights)
        # Numbers of streams are never used again: a client may still listen to an old one.
        self.next_stream_id: int = _FIRST_STREAM if previous is None else previous.next_stream_id
        self.stream_id = self.take_stream_id()
        self._before_spawn = before_spawn
        self.light_ids: tuple[int, ...] = ()
        neighbour = previous if previous is not None and previous.town is town else None
        self.lanes: LaneIndex = neighbour.lanes if neighbour else LaneIndex(town.lanes)
        self._approaches: Approaches = (
            neighbour._approaches if neighbour else Approaches(town.traffic_lights, town.lanes)
        )
        lit = {site.junction_id for site in town.traffic_lights}
        self.arm_turns = ArmTurns(town.lanes, lit)
        self.terrain: Terrain = neighbour.terrain if neighbour else terrain_of(town)
        self._mechanics = Mechanics(self.terrain, self.actors, self.objects)
        self.fleet: VehicleFleet = self._mechanics.fleet
        self.v2x = V2xStations()
        self._attachments: Attachments | None = None
        self._arm_probe: ArmProbe | None = neighbour._arm_probe if neighbour else None
        self._dead: OrderedDict[int, Actor] = OrderedDict()
        self._dying: dict[int, float] = {}
        self._next_actor_id = 1
        self._last_delta_s = 0.0
        if previous is not None:
            for actor in [*previous._dead.values(), *previous.actors]:
                self._remember(actor)
        self._populate()

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """What touched in the last tick."""
        return self._mechanics.collisions

    def _populate(self) -> None:
        for site in self.town.traffic_lights:
            self._add(*traffic_light_actor(self._new_id(), site))
        self.light_ids = tuple(actor.actor_id for actor in self.actors)
        x, y, z = self.town.entrance
        spectator = Actor(
            actor_id=self._new_id(),
            type_id="spectator",
            kind=ActorKind.OTHER,
            attributes={"role_name": "spectator"},
            box_center=(0.0, 0.0, 0.0),
            box_extent=(0.0, 0.0, 0.0),
            semantic_tags=(),
            collides=False,
        )
        self.spectator = spectator
        self._add(spectator, Pose((x, y, z + _SPECTATOR_HEIGHT_M), (-45.0, 0.0, 0.0)))
        signs = [traffic_sign_actor(self._new_id(), site) for site in self.town.traffic_signs]
        for sign, pose in signs:
            self._add(sign, pose)
        self.sign_ids = tuple(sign.actor_id for sign, _ in signs)

    def _new_id(self) -> int:
        self._next_actor_id += 1
        return self._next_actor_id - 1

    def _id_for(self, wanted_id: int) -> int:
        """The wanted id where it is free, as CARLA's ``ActorRegistry`` gives it, else a new one."""
        if not 0 < wanted_id <= _LARGEST_WANTED_ID or wanted_id in self.actors:
            return self._new_id()
        self._next_actor_id = max(self._next_actor_id, wanted_id + 1)
        return wanted_id

    def _add(self, actor: Actor, pose: Pose) -> None:
        self.actors.add(actor, pose)
        self._dead.pop(actor.actor_id, None)
        self._attachments = None

    def _remember(self, actor: Actor) -> None:
        self._dead[actor.actor_id] = actor
        while len(self._dead) > _REMEMBERED_DEAD:
            self._dead.popitem(last=False)

    # Looking up ----------------------------------------------------------------------------------

    def live(self, actor_id: int) -> Actor:
        """The live actor of that id.

        Raises:
            ActorNotFoundError: it does not live.
        """
        actor = self.actors.get(actor_id)
        if actor is None:
            raise ActorNotFoundError(actor_id)
        return actor

    def live_or_dead(self, actor_id: int) -> Actor:
        """The actor of that id, also when it was destroyed a while ago.

        Clients' background threads ask for actors that were just destroyed, and an error would end
        the client's process.

        Raises:
            ActorNotFoundError: there never was one, or too many died since.
        """
        actor = self.actors.get(actor_id) or self._dead.get(actor_id)
        if actor is None:
            raise ActorNotFoundError(actor_id)
        return actor

    def known_actors(self) -> dict[int, Actor]:
        """What :meth:`live_or_dead` finds now, by actor id."""
        return {**self._dead, **{actor.actor_id: actor for actor in self.actors}}

    # Spawning and destroying ---------------------------------------------------------------------

    def spawn(
        self,
        type_id: str,
        attributes: Mapping[str, str],
        pose: Pose,
        *,
        parent_id: int = 0,
        attachment: Attachment = RIGID,
        wanted_id: int = 0,
    ) -> Actor:
        """Bring an actor into the world; it appears in the next frame.

        Args:
            type_id: blueprint id.
            attributes: values that override the blueprint's, see :func:`actor_attributes`.
            pose: in the world, or in the parent's frame when there is a parent.
            parent_id: actor to attach it to; 0 for none.
            attachment: how it follows its parent.
            wanted_id: id that a recording knows it by, taken if no living actor has it; such an
                actor may be where others are.

        Raises:
            SpawnError: no such blueprint, parent or socket, an attribute's value is not of its
                type, or something is in the way.
        """
        blueprint = catalogue().get(type_id)
        if blueprint is None:
            raise SpawnError(f"unknown blueprint {type_id!r}")
        if parent_id and parent_id not in self.actors:
            raise SpawnError(f"unable to attach actor: parent actor {parent_id} not found")
        if parent_id and attachment.socket:
            self._check_socket(parent_id, attachment.socket)
        placed = compose(self.actors.pose(parent_id), pose) if parent_id else normalised(pose)
        merged = actor_attributes(blueprint, attributes)
        blueprint = seated(blueprint, merged)
        solid = blueprint.kind in (ActorKind.VEHICLE, ActorKind.WALKER)
        free = parent_id or wanted_id
        if blueprint.kind is ActorKind.WALKER and not free:
            placed = self._mechanics.lifted(placed, blueprint.box_extent[2])
        if solid and not free and is_blocked(self.actors, blueprint, placed):
            raise SpawnError(COLLISION_TEXT)
        if self._before_spawn is not None:
            self._before_spawn(type_id, merged)
        arm, relative = arm_for(attachment, pose) if parent_id else (None, Pose())
        actor = Actor(
            actor_id=self._id_for(wanted_id),
            type_id=type_id,
            kind=blueprint.kind,
            attributes=merged,
            box_center=blueprint.box_center,
            box_extent=blueprint.box_extent,
            semantic_tags=blueprint.semantic_tags,
            blueprint=blueprint,
            parent_id=parent_id,
            relative=relative,
            attachment=attachment,
            arm=arm,
            collides=solid or type_id.startswith("static."),
        )
        if blueprint.kind is ActorKind.SENSOR:
            actor.stream_id = self.take_stream_id()
        self._add(actor, placed)
        if blueprint.vehicle is not None:
            actor.vehicle = VehicleStatus(sticky=merged["sticky_control"].lower() == "true")
            self.fleet.add(actor.actor_id, blueprint.vehicle, placed.location, placed.rotation_deg)
            if parent_id:
                self.set_simulate_physics(actor.actor_id, False)
        return actor

    def _check_socket(self, parent_id: int, socket: str) -> None:
        """Refuse a bone that the parent does not have; UE would attach to the parent's origin."""
        if actor_from_socket(self.actors, self.live(parent_id), socket) is None:
            raise SpawnError(f"unable to attach actor: parent {parent_id} has no bone {socket!r}")

    def destroy(self, actor_id: int) -> bool:
        """Take an actor out of the world; whether it lived. What rode on it stays in place."""
        actor = self.actors.get(actor_id)
        if actor is None or actor is self.spectator or actor.kind in _OF_THE_MAP:
            return False
        self.actors.remove(actor_id)
        if actor.vehicle is not None:
            self.fleet.remove(actor_id)
        self._mechanics.let_fall(actor_id, falls=False)
        self.objects.forget_prop(actor_id)
        self._dying.pop(actor_id, None)
        self._remember(actor)
        self._attachments = None
        orphans = [one for one in self.actors if one.parent_id == actor_id]
        for orphan in orphans:
            orphan.parent_id = 0  # the id may be given again
        self.actors.stop(orphan.actor_id for orphan in orphans)
        return True

    def kill_walker(self, actor_id: int) -> None:
        """Let a walker lie where it was hit; it goes after ten seconds (CARLA's ``WalkerBase.h``).

        Raises:
            ActorNotFoundError: it does not live.
            ActorTypeError: it is no walker.
        """
        walker = self.live(actor_id)
        if walker.kind is not ActorKind.WALKER:
            raise ActorTypeError(actor_id)
        walker.walker = STANDING
        self._dying.setdefault(actor_id, self.elapsed_s + LIFE_SPAN_AFTER_DEATH_S)

    def _bury(self) -> None:
        """Take out the walkers that have lain long enough."""
        ends = self.elapsed_s + 1e-6  # time is a sum of steps
        for actor_id in [one for one, end_s in self._dying.items() if end_s <= ends]:
            self.destroy(actor_id)

    # Commands ------------------------------------------------------------------------------------

    def set_weather(self, weather: Weather) -> None:
        """Change the weather; dusk and dawn switch the street lights."""
        self.weather = weather
        self.street_lights.follow_sun(weather.sun_altitude_angle)

    def set_pose(self, actor_id: int, pose: Pose) -> None:
        """Teleport an actor; of an attached one, move it within its parent's frame."""
        actor = self.live(actor_id)
        if actor.parent_id in self.actors:
            actor.relative = pose
            self._attachments = None
            return
        pose = normalised(pose)
        if actor.kind is ActorKind.WALKER and actor.simulate_physics:
            pose = self._mechanics.lifted(pose, actor.box_extent[2])
        self.actors.set_pose(actor_id, pose)
        if actor.vehicle is not None:
            self.fleet.set_transform(actor_id, pose.location, pose.rotation_deg)

    def put(self, actor_id: int, pose: Pose, velocity: Vector3) -> None:
        """As :meth:`set_pose`, but the way there is not motion, also of who has no physics.

        Args:
            actor_id: an actor that is attached to none.
            pose: in the world.
            velocity: what it was until now, m/s, world.
        """
        self.set_pose(actor_id, pose)
        self._mechanics.forget_way(self.live(actor_id), velocity)

    def set_location(self, actor_id: int, location: Vector3) -> None:
        """Teleport an actor without turning it; of an attached one, within its parent's frame."""
        actor = self.live(actor_id)
        attached = actor.parent_id in self.actors
        pose = actor.relative if attached else self.actors.pose(actor_id)
        self.set_pose(actor_id, pose._replace(location=location))

    def control_vehicle(self, actor_id: int, control: VehicleControl) -> None:
        """Set a vehicle's pedals and wheel; other actors ignore it."""
        vehicle = self.live(actor_id).vehicle
        if vehicle is not None:
            vehicle.control, vehicle.ackermann, vehicle.commanded = control, None, True
            self.fleet.set_control(actor_id, control)

    def control_ackermann(self, actor_id: int, control: AckermannControl) -> None:
        """Let the vehicle's own controller follow a steering angle and a speed."""
        vehicle = self.live(actor_id).vehicle
        if vehicle is None:
            return
        if vehicle.ackermann is None:
            vehicle.ackermann = AckermannController(control, vehicle.ackermann_settings)
        vehicle.ackermann.target = control

    def set_ackermann_settings(self, actor_id: int, settings: AckermannSettings) -> None:
        """Set the gains of a vehicle's own controller."""
        vehicle = self.live(actor_id).vehicle
        if vehicle is not None:
            vehicle.ackermann_settings = settings
            if vehicle.ackermann is not None:
                vehicle.ackermann.gains = settings

    def control_walker(self, actor_id: int, control: WalkerControl) -> None:
        """Set where a walker goes and how fast; one that was killed ignores it."""
        walker = self.live(actor_id)
        if actor_id not in self._dying:
            walker.walker = control

    def place_walker(self, actor_id: int, pose: Pose, speed: float) -> None:
        """Put a walker where the client's navigation says; its speed drives the animation.

        Navigation gives the place of the feet, an actor's origin is at mid height.

        Raises:
            ActorNotFoundError: it does not live.
            ActorError: it was killed.
        """
        walker = self.live(actor_id)
        if actor_id in self._dying:
            raise ActorError("Walker is already dead", actor_id)
        (x, y, z), (pitch_deg, yaw_deg, _) = pose
        middle = (x, y, z + walker.box_extent[2])
        self.actors.set_pose(actor_id, normalised(Pose(middle, pose.rotation_deg)))
        pitch, yaw = math.radians(pitch_deg), math.radians(yaw_deg)
        ahead = (math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), 0.0)
        walker.walker = WalkerControl(ahead, speed)

    def set_simulate_physics(self, actor_id: int, enabled: bool) -> None:
        """Whether the dynamics move an actor; props fall and lie, nothing else moves them."""
        actor = self.live(actor_id)
        actor.simulate_physics = enabled
        if enabled and actor.kind is ActorKind.WALKER:
            actor.gravity = True  # it moves again, as by CARLA's SetDefaultMovementMode
        if actor.type_id.startswith("static.prop."):
            self._mechanics.let_fall(actor_id, falls=enabled)
            if not enabled:
                self.actors.stop([actor_id])
        if actor.vehicle is not None:
            self.fleet.set_simulate_physics(actor_id, enabled)

    def set_collides(self, actor_id: int, enabled: bool) -> None:
        """Whether an actor is in the way of others; one that was destroyed may be named."""
        actor = self.live_or_dead(actor_id)
        actor.collides = enabled
        if actor.vehicle is not None and actor_id in self.actors:
            self.fleet.set_collides(actor_id, enabled)

    def set_target_velocity(self, actor_id: int, velocity: Vector3) -> None:
        """Give a vehicle a velocity (m/s, world) at once; other actors ignore it."""
        if self.live(actor_id).vehicle is not None:
            self.fleet.set_target_velocity(actor_id, velocity)

    def set_target_angular_velocity(self, actor_id: int, velocity_deg: Vector3) -> None:
        """Give a vehicle a spin (deg/s, world) at once; other actors ignore it."""
        if self.live(actor_id).vehicle is not None:
            self.fleet.set_target_angular_velocity(actor_id, velocity_deg)

    def set_constant_velocity(self, actor_id: int, velocity: Vector3 | None) -> None:
        """Hold a vehicle at a velocity (m/s, its own frame) whatever its pedals say."""
        if self.live(actor_id).vehicle is not None:
            self.fleet.set_constant_velocity(actor_id, velocity)

    def set_enable_gravity(self, actor_id: int, enabled: bool) -> None:
        """Whether an actor falls; one that was destroyed may be named.

        A walker hangs in the air from then on. On the ground it walks on as before, as on CARLA
        (``FWalkerActor::SetActorEnableGravity``).
        """
        actor = self.live_or_dead(actor_id)
        walks = actor.kind is ActorKind.WALKER and not self._mechanics.walker_falls(actor_id)
        actor.gravity = enabled or (actor.gravity and walks)
        if actor.vehicle is not None and actor_id in self.actors:
            self.fleet.set_gravity(actor_id, enabled)

    def add_impulse(self, actor_id: int, impulse: Vector3, location: Vector3 | None = None) -> None:
        """Push a vehicle (N s, world), off its middle if a place in the world is given."""
        if self.live(actor_id).vehicle is not None:
            self.fleet.add_impulse(actor_id, impulse, location)

    def add_force(self, actor_id: int, force: Vector3, location: Vector3 | None = None) -> None:
        """Push a vehicle with a force (N, world) during the next tick."""
        if self.live(actor_id).vehicle is not None:
            self.fleet.add_force(actor_id, force, location)

    def add_angular_impulse(self, actor_id: int, impulse: Vector3) -> None:
        """Make a vehicle spin about the vertical, in CARLA's unit of kg cm^2 degrees per second.

        Unreal's ``AddAngularImpulseInDegrees`` gets the client's vector as it is. Vehicles keep to
        the road plane: the other two axes have no effect.
        """
        if self.live(actor_id).vehicle is not None:
            self.fleet.add_angular_impulse(actor_id, math.radians(impulse[2]) * _M2_PER_CM2)

    def add_torque(self, actor_id: int, torque: Vector3) -> None:
        """Turn a vehicle about the vertical during the next tick (kg cm^2 degrees per s^2)."""
        if self.live(actor_id).vehicle is not None:
            self.fleet.add_torque(actor_id, math.radians(torque[2]) * _M2_PER_CM2)

    def set_parameters(self, actor_id: int, parameters: VehicleParameters) -> None:
        """Replace a vehicle's physics."""
        vehicle = self.live(actor_id).vehicle
        if vehicle is not None:
            vehicle.parameters = parameters
            self.fleet.set_parameters(actor_id, parameters)

    # Asking --------------------------------------------------------------------------------------

    def parameters(self, actor: Actor) -> VehicleParameters:
        """Physics of a vehicle, live or not.

        Raises:
            WorldError: it is no vehicle.
        """
        if actor.vehicle is not None and actor.vehicle.parameters is not None:
            return actor.vehicle.parameters
        if actor.blueprint is None or actor.blueprint.vehicle is None:
            raise WorldError(f"actor {actor.actor_id} is not a vehicle")
        return actor.blueprint.vehicle

    def parameters_in_effect(self, actor: Actor) -> VehicleParameters:
        """As :meth:`parameters`, with the tyre friction of a trigger that the vehicle is in.

        Raises:
            WorldError: it is no vehicle.
        """
        own = self.parameters(actor)
        if actor.actor_id not in self.actors:
            return own
        imposed = self._mechanics.zone_friction(actor.actor_id)
        if imposed is None:
            return own
        wheels = tuple(replace(wheel, tire_friction=imposed) for wheel in own.wheels)
        return replace(own, wheels=wheels)

    def last_pose(self, actor: Actor) -> Pose:
        """Pose in the world; the origin for an actor that is gone."""
        return self.actors.pose(actor.actor_id) if actor.actor_id in self.actors else Pose()

    def motion(self, actor: Actor) -> VehicleMotion:
        """Motion of a vehicle in the last frame; at rest for one that is gone."""
        if actor.actor_id not in self.actors or actor.vehicle is None:
            return VehicleMotion()
        row = self.fleet.row(actor.actor_id)
        forward, right, _ = rotation_matrix(self.fleet.rotation_deg[row]).T
        throttle, steer, brake = self.fleet.control[row].tolist()
        return VehicleMotion(
            speed=float(self.fleet.velocity[row] @ forward),
            forward_acceleration=float(self.fleet.acceleration[row] @ forward),
            lateral_acceleration=float(self.fleet.acceleration[row] @ right),
            throttle=throttle,
            steer=steer,
            brake=brake,
            wheel_angle_deg=float(self.fleet.wheel_angle_deg[row]),
            gear=int(self.fleet.gear[row]),
        )

    def light_index(self, actor_id: int) -> int:
        """Index of a traffic light in :attr:`lights`.

        Raises:
            WorldError: the actor is no traffic light.
        """
        try:
            return self.light_ids.index(actor_id)
        except ValueError:
            raise WorldError(f"actor {actor_id} is not a traffic light") from None

    def take_stream_id(self) -> int:
        """A stream number that no other stream of this server has or had."""
        self.next_stream_id += 1
        return self.next_stream_id - 1

    # The tick ------------------------------------------------------------------------------------

    def tick(self, delta_s: float, substeps: int = 1, *, moving_s: float | None = None) -> Snapshot:
        """Advance the world and freeze the new frame.

        Args:
            delta_s: simulated seconds.
            substeps: physics steps, at least.
            moving_s: seconds that vehicles move for; all by default.
        """
        self.frame += 1
        self.elapsed_s += delta_s
        self._last_delta_s = delta_s
        physics = PhysicsStep(delta_s if moving_s is None else moving_s, substeps)
        self._release_pedals()
        steered = [
            (actor, actor.vehicle, actor.vehicle.ackermann)
            for actor in self.actors.of_kind(ActorKind.VEHICLE)
            if actor.vehicle is not None and actor.vehicle.ackermann is not None
        ]

        def steer(part_s: float) -> None:
            for actor, vehicle, controller in steered:
                speed = float(self.fleet.speed[self.fleet.row(actor.actor_id)])
                vehicle.control = controller.step(speed, self.parameters(actor), part_s)
                self.fleet.set_control(actor.actor_id, vehicle.control)

        puddles_percent = self.weather.precipitation_deposits if self._wet_grip else 0.0
        self._mechanics.step(delta_s, physics, puddles_percent, steer if steered else None)
        for actor_id in self._mechanics.fallen():
            self.destroy(actor_id)
        self._bury()
        self._follow()
        self._control_traffic(delta_s)
        self.debug_drawing.step(self.elapsed_s)
        self.street_lights.step()
        self.v2x.step(self.actors, self.frame, self.elapsed_s)
        return self.freeze(delta_s)

    def _release_pedals(self) -> None:
        """Let go of the pedals and wheels of vehicles whose control is not sticky."""
        for actor in self.actors.of_kind(ActorKind.VEHICLE):
            vehicle = actor.vehicle
            if vehicle is None or vehicle.sticky:
                continue
            if not vehicle.commanded and vehicle.ackermann is None:
                self.control_vehicle(actor.actor_id, VehicleControl())
            vehicle.commanded = False

    def _control_traffic(self, delta_s: float) -> None:
        """Let lights and turns follow who is on the lanes; who is parked beside them is not."""
        fleet, lanes = self.fleet, self.town.lanes
        samples = self.lanes.nearest(fleet.location)
        fleet.see_signs(lanes.speed_limit_kmh[samples], lanes.posted_kmh[samples])
        on_lane = np.flatnonzero(self.lanes.is_on_lane(fleet.location, samples))
        self.lights.step(delta_s, self._approaches.queues(samples[on_lane]))
        _, half_size, _ = fleet.footprints()
        self.arm_turns.step(
            delta_s,
            fleet.ids[on_lane],
            samples[on_lane],
            fleet.speed[on_lane],
            half_size[on_lane, 0],
        )

    def _follow(self) -> None:
        if self._attachments is None:
            self._attachments = Attachments(self.actors)
        self._attachments.follow(self.actors, self._last_delta_s, self._arm_obstacle)
        for vehicle in self.actors.of_kind(ActorKind.VEHICLE):
            if vehicle.parent_id and vehicle.parent_id in self.actors:
                pose = self.actors.pose(vehicle.actor_id)
                self.fleet.set_transform(vehicle.actor_id, pose.location, pose.rotation_deg)

    def _arm_obstacle(self, start: Vector3, end: Vector3) -> float | None:
        if self._arm_probe is None:  # few episodes have spring arms
            self._arm_probe = ArmProbe(self.town.static_mesh)
        return self._arm_probe(start, end)

    def freeze(self, delta_s: float) -> Snapshot:
        """The current frame as an immutable snapshot."""
        return freeze(self, self._sites, delta_s)
