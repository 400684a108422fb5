"""Which mesh stands for which actor: world state in, placements for the scene store out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import astuple, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from carstage_sim.content.doors import open_doors_mesh
from carstage_sim.content.figures import Dress
from carstage_sim.content.pedestrians import pedestrian_mesh, walking_meshes
from carstage_sim.content.people import colours_of, dress_of, has_umbrella, stoop_m
from carstage_sim.content.posing import Pose as Joints
from carstage_sim.content.props import prop_mesh
from carstage_sim.content.street_furniture import traffic_light_mesh
from carstage_sim.content.vehicles import Vehicle, vehicle_of
from carstage_sim.content.walking import PHASES, WALK_PHASES
from carstage_sim.content.wheelchairs import wheelchair_mesh, wheelchair_meshes
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import Town
from carstage_sim.mesh import Material, TriangleMesh, merge_meshes
from carstage_sim.render.rolling import Drift
from carstage_sim.render.scene import PASSING, QUICK, Frame, Placement
from carstage_sim.sensors.loose_wheels import BODY, WHEEL, LooseWheels
from carstage_sim.sensors.mesh_store import MeshStore
from carstage_sim.world.blueprints import Blueprint, catalogue
from carstage_sim.world.blueprints.props import has_shape
from carstage_sim.world.columns import Rotation
from carstage_sim.world.state import ActorKind, WorldState
from carstage_sim.world.walkers.gait import roll_phase, walk_phase

_UMBRELLA = "+umbrella"
"""Ends the figure in the keys of who has an open umbrella."""
WHEELCHAIR = "+wheelchair"
"""Ends the blueprint and the figure of who sits in one."""
_RAIN_PERCENT = 10.0
"""Precipitation above which umbrellas are open."""
_BARE_STEEL = (152, 156, 160)


Colour = tuple[int, int, int]


@lru_cache(maxsize=4096)
def _colours(type_id: str, actor_id: int, walker: bool, own: Colour) -> tuple[Colour, ...]:
    """Paint, clothes, skin and hair of an actor; what no attribute says follows from its id."""
    body = colours_of(type_id, actor_id)
    return (
        own if any(own) else _BARE_STEEL,
        own if walker and any(own) else body["upper"],
        body["lower"],
        body["skin"],
        body["hair"],
        body["accent"],
        body["shoes"],
        body["bag"],
    )


class ActorModels:
    """Gives every visible actor a model key, and every model key its mesh.

    Args:
        town: its n-th traffic light is the state's n-th row of that kind.
        meshes: replaces the built-in meshes: called with a key.
        cache: folder of stored meshes.
    """

    def __init__(
        self,
        town: Town,
        meshes: Callable[[str], TriangleMesh] | None = None,
        *,
        cache: Path,
    ) -> None:
        self._town = town
        self._catalogue = catalogue()
        heads = [site.head for site in town.traffic_lights]
        self._light_keys = [f"traffic_light#{heads.index(head)}" for head in heads]
        self._figures: dict[str, str] = {}
        self._posed: dict[str, Joints] = {}
        self._raining = False
        self._made: tuple[str, Vehicle] | None = None
        self._walking: dict[str, TriangleMesh] = {}
        self._stand_ins: dict[tuple[Dress, float, tuple[float, float, float]], str] = {}
        stored = MeshStore(self._built_in, self._identity, cache)
        self.mesh: Callable[[str], TriangleMesh] = meshes if meshes is not None else stored
        self._wheels = LooseWheels(self._catalogue, self.mesh)

    @property
    def keys_of_lights(self) -> Sequence[str]:
        """Model keys of the town's traffic lights."""
        return self._light_keys

    def keys_of(self, type_id: str) -> tuple[str, ...]:
        """Model keys that an actor of a blueprint begins with; none if it has no shape.

        Args:
            type_id: blueprint id, followed by :data:`WHEELCHAIR` where it sits in one.
        """
        name, mark, _ = type_id.partition(WHEELCHAIR)
        blueprint = self._catalogue.get(name)
        if blueprint is None:
            return ()
        if blueprint.kind == ActorKind.WALKER:
            return self.beside(f"{self._carried(name, sits=bool(mark))}{QUICK}0")
        if blueprint.kind == ActorKind.VEHICLE:
            return (type_id, f"{type_id}{BODY}", *self._wheels.keys(type_id))
        return (type_id,) if has_shape(type_id) else ()

    def beside(self, key: str) -> tuple[str, ...]:
        """Model keys that are soon needed where one is: those of a walk or of a run."""
        figure, mark, phase = key.partition(QUICK)
        if not mark:
            return ()
        walks = int(phase) <= WALK_PHASES
        phases = range(WALK_PHASES + 1) if walks else range(WALK_PHASES + 1, PHASES + 1)
        return tuple(f"{figure}{QUICK}{one}" for one in phases)

    def placements(self, state: WorldState) -> list[Placement]:
        """The actors of a frame that have a shape, in the state's order.

        Joints of figures that clients pose are kept until the next call: meshes are made before.
        """
        rotations = rotation_matrix(state.rotation_deg).reshape(-1, 3, 3)
        wheels = self._wheels.placements(state, rotations)
        self._raining = state.weather.precipitation > _RAIN_PERCENT
        self._posed = {}
        found: list[Placement] = []
        lights = 0
        changes = state.town_changes
        pictures = {} if changes is None else changes.prop_pictures
        # Whole columns and numbers at once: pictures wait for this, and an enum is slow to ask.
        vehicle, walker, light = map(
            int, (ActorKind.VEHICLE, ActorKind.WALKER, ActorKind.TRAFFIC_LIGHT)
        )
        actor_ids, light_states = state.actor_id.tolist(), state.light_state.tolist()
        own_colours = list(map(tuple, state.colour.tolist()))
        for row, kind in enumerate(state.kind.tolist()):
            if kind == vehicle:
                doors = 0 if state.doors is None else int(state.doors[row])
                key = f"{state.type_id[row]}#{doors}" if doors else state.type_id[row]
                key = f"{key}{BODY}" if row in wheels else key
            elif kind == walker:
                key = self._walker_key(state, row)
            elif kind == light:
                if lights >= len(self._light_keys):
                    continue
                key = self._light_keys[lights]
                lights += 1
            elif has_shape(state.type_id[row]):
                key = state.type_id[row]
                picture = pictures.get(actor_ids[row])
                key = key if picture is None else f"{key}{PASSING}{picture}"
            else:
                continue
            found.append(
                Placement(
                    actor_id=actor_ids[row],
                    model=key,
                    location=state.location[row],
                    rotation=rotations[row],
                    colours=_colours(
                        state.type_id[row], actor_ids[row], kind == walker, own_colours[row]
                    ),
                    light_state=light_states[row],
                )
            )
            found += wheels.get(row, ())
        return found

    def _walker_key(self, state: WorldState, row: int) -> str:
        actor_id, type_id = int(state.actor_id[row]), state.type_id[row]
        joints = state.figures.get(actor_id)
        sits = actor_id in state.wheelchairs
        phase = self._phase(state, row, sits=sits)
        if joints is None:
            return f"{self._carried(type_id, sits=sits)}{QUICK}{phase}"
        digest = hashlib.sha256(b"".join(np.asarray(j).tobytes() for j in astuple(joints)))
        figure = self._figure(type_id) + (f"{WHEELCHAIR}{phase}" if sits else "")
        key = f"{figure}{PASSING}{digest.hexdigest()[:16]}"
        self._posed[key] = joints
        return key

    def _carried(self, type_id: str, *, sits: bool) -> str:
        """The figure of a blueprint: in a wheelchair, or with its umbrella if it rains."""
        if sits:
            return self._figure(type_id) + WHEELCHAIR
        opens = self._raining and has_umbrella(type_id)
        return self._figure(type_id) + (_UMBRELLA if opens else "")

    def _figure(self, type_id: str) -> str:
        """A blueprint of the same size and dress: figures differ in little but their colours."""
        known = self._figures.get(type_id)
        if known is None:
            blueprint = self._catalogue.get(type_id)
            size = blueprint.box_extent if blueprint is not None else (0.0, 0.0, 0.0)
            kind = (dress_of(type_id), stoop_m(type_id), size)
            known = self._stand_ins.setdefault(kind, type_id)
            self._figures[type_id] = known
        return known

    def _phase(self, state: WorldState, row: int, *, sits: bool) -> int:
        if sits:
            return roll_phase(
                int(state.actor_id[row]),
                state.location[row],
                float(state.rotation_deg[row, Rotation.YAW]),
            )
        blueprint = self._catalogue.get(state.type_id[row])
        return walk_phase(
            int(state.actor_id[row]),
            state.location[row],
            float(state.rotation_deg[row, Rotation.YAW]),
            state.velocity[row],
            blueprint.box_extent if blueprint is not None else (0.0, 0.0, 0.0),
        )

    def _identity(self, key: str) -> str | None:
        """What the mesh of a key follows from, apart from the code; None if it is not stored."""
        name, _, number = key.partition("#")
        if PASSING in key or QUICK in key:
            return None
        if name == "traffic_light":
            return f"{name} {self._town.traffic_lights[int(number)].head}"
        blueprint = self._catalogue[name.partition("+")[0]]
        chassis = _chassis(blueprint)
        box, tags = (blueprint.box_extent, blueprint.box_center), blueprint.semantic_tags
        return f"{key} {box} {chassis} {tags}"

    def _built_in(self, key: str) -> TriangleMesh:
        if PASSING in key:
            name, _, picture = key.partition(PASSING)
            if has_shape(name):
                return _with_picture(prop_mesh(name, self._catalogue[name].box_extent), picture)
            figure, mark, phase = name.partition(WHEELCHAIR)
            if mark:
                return wheelchair_mesh(figure, self._posed[key], int(phase))
            return pedestrian_mesh(name, self._catalogue[name].box_extent, self._posed[key])
        if QUICK in key:
            return self._walking_mesh(key)
        name, _, number = key.partition("#")
        if name == "traffic_light":
            return traffic_light_mesh(self._town.traffic_lights[int(number)].head)
        if has_shape(name):
            return prop_mesh(name, self._catalogue[name].box_extent)
        return self._vehicle_mesh(name, int(number or 0))

    def _vehicle_mesh(self, name: str, doors: int) -> TriangleMesh:
        """A vehicle or a part of it; all parts of the last one are kept, as they are asked for."""
        type_id, _, part = name.partition("+")
        blueprint = self._catalogue[type_id]
        if self._made is None or self._made[0] != type_id:
            self._made = type_id, _vehicle(blueprint)
        vehicle = self._made[1]
        if not part:
            return _with_doors(vehicle.whole, blueprint, doors)
        number = name.partition(WHEEL)[2]
        return vehicle.wheel(int(number)) if number else vehicle.body

    def _walking_mesh(self, key: str) -> TriangleMesh:
        """The mesh of a phase; those beside it are made with it, as they are asked for next."""
        if key not in self._walking:
            figure, _, _ = key.partition(QUICK)
            keys = self.beside(key)
            phases = [int(one.partition(QUICK)[2]) for one in keys]
            name, _, _ = figure.partition("+")
            if figure.endswith(WHEELCHAIR):
                meshes = wheelchair_meshes(name, phases)
            else:
                extent, opens = self._catalogue[name].box_extent, figure.endswith(_UMBRELLA)
                meshes = walking_meshes(name, extent, phases, umbrella=opens)
            self._walking = dict(zip(keys, meshes, strict=True))
        return self._walking.pop(key)


def drift_of(state: WorldState, frame: Frame) -> Drift:
    """How the instances of a frame move, as its actors do."""
    rows = np.searchsorted(state.actor_id, frame.actor_id)
    rate = np.radians(state.angular_velocity_deg[rows])
    # Wheels are not where their vehicles turn about.
    velocity = state.velocity[rows] + np.cross(rate, frame.location - state.location[rows])
    return Drift(velocity, rate)


def _with_picture(mesh: TriangleMesh, row: str) -> TriangleMesh:
    """A prop all over in a picture; the number of its surfaces' object is the picture's row."""
    return replace(
        mesh,
        material=np.full_like(mesh.material, int(Material.PICTURE)),
        object_id=np.full_like(mesh.object_id, int(row)),
    )


def _chassis(blueprint: Blueprint) -> tuple[tuple[float, float], float] | None:
    """Where the axles are and how large the wheels, metres; None if it has no dynamics."""
    parameters = blueprint.vehicle
    if parameters is None:
        return None
    axles = (parameters.front_axle_x_m, parameters.rear_axle_x_m)
    return axles, parameters.wheels[0].radius_m


def _vehicle(blueprint: Blueprint) -> Vehicle:
    axles_m, wheel_radius_m = _chassis(blueprint) or (None, None)
    return vehicle_of(
        blueprint.id,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=axles_m,
        wheel_radius_m=wheel_radius_m,
    )


def _with_doors(body: TriangleMesh, blueprint: Blueprint, doors: int) -> TriangleMesh:
    """A vehicle with its open doors."""
    tag = CityObjectLabel(blueprint.semantic_tags[0])
    leaves = open_doors_mesh(blueprint.box_extent, blueprint.box_center, doors, tag)
    return body if leaves is None else merge_meshes([body, leaves])
