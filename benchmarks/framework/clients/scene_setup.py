"""Scenes in a town's streets: actors without physics that are put before a camera, or away.

Vehicles stand on lanes and walkers on sidewalks and beside vehicles, so that they hide each other
and the town hides them, as it happens in traffic. Nothing moves: every picture of a scene shows
the same world.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import carla

LIFT_M = 1024.0
"""How far above the town an actor is isolated. Heights are multiples of :data:`STEP_M` and below
1 km: float32 holds a lifted height exactly, and camera and actor keep their relative pose."""

STEP_M = 2.0**-13
NEAREST_M, FARTHEST_M = 4.0, 70.0
_AWAY = carla.Location(0.0, 0.0, -5000.0)
_LANES_EVERY_M = 3.0
_PAVEMENT_PLACES = 600
_TRIES = 60
_GAP_M = 0.25
_SAME_LEVEL_M = 12.0

# Who is drawn from: every kind of vehicle; cars, which are most of the catalogue, are a third.
_VEHICLES = {"bicycle": 3, "motorcycle": 4, "bus": 2, "truck": 4, "van": 4, "car": 8}
_WALKERS = 14


Disc = tuple[float, float, float]
"""x, y and radius of ground that is taken (m)."""


@dataclass(frozen=True)
class Placed:
    """An actor and where it stands in a scene."""

    actor: Any
    transform: Any


@dataclass(frozen=True)
class PlacedScene:
    """One scene: where the camera is and who stands where."""

    camera: Any
    placed: Sequence[Placed]


def on_grid(height_m: float) -> float:
    """The nearest height that is still exact when it is lifted."""
    return round(height_m / STEP_M) * STEP_M


def lifted(transform: Any) -> Any:
    """The same pose high above the town."""
    at = transform.location
    return carla.Transform(carla.Location(at.x, at.y, at.z + LIFT_M), transform.rotation)


class SceneActors:
    """The actors of a town, spawned once and then only moved.

    Args:
        world: ``carla.World`` in synchronous mode.
        rng: draws blueprints, poses and places.
    """

    def __init__(self, world: Any, rng: random.Random) -> None:
        self._world = world
        self._rng = rng
        library = world.get_blueprint_library()
        self._slot = 0
        by_type: dict[str, list[Any]] = {}
        for blueprint in sorted(library.filter("vehicle.*"), key=lambda one: str(one.id)):
            kind = str(blueprint.get_attribute("base_type").as_str()).lower()
            by_type.setdefault(kind, []).append(blueprint)
        self.ego = self._spawn(library.find("vehicle.tesla.model3"))
        self.vehicles = [
            self._spawn(blueprint)
            for kind, count in _VEHICLES.items()
            for blueprint in self._some(by_type[kind], count)
        ]
        pedestrians = sorted(library.filter("walker.*"), key=lambda one: str(one.id))
        self.walkers = [self._spawn(blueprint) for blueprint in self._some(pedestrians, _WALKERS)]

    @property
    def actors(self) -> list[Any]:
        """Everybody, the ego too."""
        return [self.ego, *self.vehicles, *self.walkers]

    def _some(self, blueprints: Sequence[Any], count: int) -> list[Any]:
        whole, rest = divmod(count, len(blueprints))
        return [*list(blueprints) * whole, *self._rng.sample(list(blueprints), rest)]

    def _spawn(self, blueprint: Any) -> Any:
        self._slot += 1
        high = carla.Transform(carla.Location(0.0, 0.0, 300.0 + 30.0 * self._slot))
        actor = self._world.spawn_actor(blueprint, high)
        actor.set_simulate_physics(False)
        return actor

    def put_away(self, client: Any, actors: Sequence[Any] | None = None) -> None:
        """Move actors (all of them by default) where no camera sees them."""
        chosen = self.actors if actors is None else actors
        away = carla.Transform(_AWAY)
        client.apply_batch_sync(
            [carla.command.ApplyTransform(actor.id, away) for actor in chosen], False
        )

    def leave(self, client: Any) -> None:
        """Destroy everybody."""
        client.apply_batch_sync(
            [carla.command.DestroyActor(actor.id) for actor in self.actors], False
        )


class ScenePlaces:
    """Where things may stand in a town.

    Args:
        world: ``carla.World``.
        actors: which are placed.
        rng: draws scenes.
    """

    def __init__(self, world: Any, actors: SceneActors, rng: random.Random) -> None:
        self._actors = actors
        self._rng = rng
        self._lanes = [
            point.transform for point in world.get_map().generate_waypoints(_LANES_EVERY_M)
        ]
        drawn = (world.get_random_location_from_navigation() for _ in range(_PAVEMENT_PLACES))
        self._pavement = [place for place in drawn if place is not None]

    def scene(self, vehicles: int, walkers: int) -> PlacedScene:
        """A camera over a lane, and actors before it, none within another."""
        rng = self._rng
        camera = self._camera()
        taken: list[Disc] = []
        placed: list[Placed] = []
        lanes = [place for place in self._lanes if is_before(camera, place.location)]
        for actor in rng.sample(self._actors.vehicles, vehicles):
            found = self._free_place(camera, lanes, actor, taken)
            if found is not None:
                placed.append(Placed(actor, found))
        beside = [self._beside(one) for one in placed for _ in range(2)]
        pavement = [p for p in (*self._pavement, *beside) if is_before(camera, p)]
        for actor in rng.sample(self._actors.walkers, walkers):
            found = self._free_spot(camera, pavement, actor, taken)
            if found is not None:
                placed.append(Placed(actor, found))
        return PlacedScene(camera, placed)

    def _camera(self) -> Any:
        rng = self._rng
        lane = rng.choice(self._lanes)
        at, way = lane.location, lane.rotation
        return carla.Transform(
            carla.Location(at.x, at.y, on_grid(at.z + rng.uniform(1.1, 2.8))),
            carla.Rotation(
                pitch=rng.uniform(-8.0, 2.0),
                yaw=way.yaw + rng.uniform(-30.0, 30.0),
                roll=rng.uniform(-2.0, 2.0),
            ),
        )

    def _free_place(
        self, camera: Any, lanes: Sequence[Any], vehicle: Any, taken: list[Disc]
    ) -> Any:
        """A place on a lane: mostly along it, sometimes the other way or across; None: full."""
        for place in self._drawn(camera, lanes, lambda place: place.location):
            turn = self._rng.choice((0.0, 0.0, 0.0, 180.0, self._rng.uniform(0.0, 360.0)))
            yaw = place.rotation.yaw + turn + self._rng.uniform(-8.0, 8.0)
            at = place.location
            discs = list(_discs_of_vehicle(vehicle.bounding_box.extent, at, yaw))
            if _are_free(discs, taken):
                taken += discs
                pitch = place.rotation.pitch if turn == 0.0 else 0.0
                return carla.Transform(
                    carla.Location(at.x, at.y, on_grid(at.z)), carla.Rotation(pitch=pitch, yaw=yaw)
                )
        return None

    def _free_spot(
        self, camera: Any, pavement: Sequence[Any], walker: Any, taken: list[Disc]
    ) -> Any:
        extent = walker.bounding_box.extent
        for at in self._drawn(camera, pavement, lambda place: place):
            disc = (at.x, at.y, 0.35)
            if _are_free([disc], taken):
                taken.append(disc)
                return carla.Transform(
                    carla.Location(at.x, at.y, on_grid(at.z + extent.z)),
                    carla.Rotation(yaw=self._rng.uniform(0.0, 360.0)),
                )
        return None

    def _drawn(self, camera: Any, places: Sequence[Any], location_of: Any) -> Iterator[Any]:
        """Some places by chance, the nearer the likelier."""
        if not places:
            return
        weights = [1.0 / location_of(place).distance(camera.location) for place in places]
        yield from self._rng.choices(places, weights, k=_TRIES)

    def _beside(self, one: Placed) -> Any:
        at, box = one.transform.location, one.actor.bounding_box.extent
        angle = math.radians(one.transform.rotation.yaw + self._rng.choice((-90.0, 90.0)))
        along = math.radians(one.transform.rotation.yaw)
        reach, shift = box.y + 0.7, self._rng.uniform(-box.x, box.x)
        return carla.Location(
            at.x + reach * math.cos(angle) + shift * math.cos(along),
            at.y + reach * math.sin(angle) + shift * math.sin(along),
            at.z,
        )


def _discs_of_vehicle(extent: Any, at: Any, yaw_deg: float) -> Iterator[Disc]:
    """A row of discs that covers a vehicle's footprint, more or less."""
    radius = extent.y + _GAP_M
    reach = max(0.0, extent.x - extent.y)
    count = 1 + math.ceil(2.0 * reach / radius)
    for number in range(count):
        shift = -reach + 2.0 * reach * number / max(1, count - 1)
        angle = math.radians(yaw_deg)
        yield at.x + shift * math.cos(angle), at.y + shift * math.sin(angle), radius


def _are_free(discs: Sequence[Disc], taken: Sequence[Disc]) -> bool:
    return all(
        math.hypot(x - other_x, y - other_y) > radius + other_radius
        for x, y, radius in discs
        for other_x, other_y, other_radius in taken
    )


def is_before(camera: Any, at: Any) -> bool:
    """Whether a place is in front of the camera, within an angle of 49 degrees to its axis."""
    yaw = math.radians(camera.rotation.yaw)
    x, y = at.x - camera.location.x, at.y - camera.location.y
    ahead = x * math.cos(yaw) + y * math.sin(yaw)
    aside = abs(y * math.cos(yaw) - x * math.sin(yaw))
    near = abs(at.z - camera.location.z) < _SAME_LEVEL_M
    return bool(NEAREST_M < ahead < FARTHEST_M and aside < 1.15 * ahead and near)
