"""Do pedestrians walk where they may, and not through walls? The client's AI controllers walk."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import carla
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from carstage_sim.check.client_process import TrialError, run_trial
from carstage_sim.check.server_process import ServerError, running_server
from carstage_sim.check.session import spawn_walkers, synchronous_session
from carstage_sim.check.verdict import Campaign, Figure, Verdict
from carstage_sim.world.overlap import footprint_corners

TOLERANCE_M = 0.5
OVERHANG_M = 0.6
"""Awnings and balconies, which are in a building's box, reach so far over who walks below."""
WALKED_M = 10.0
_START_TIMEOUT_S = 900.0
_MAX_EVENTS = 20


@dataclass(slots=True)
class WalkerFigures:
    """What a trial measured.

    Attributes:
        outside: samples off sidewalks and crosswalks.
        in_walls: samples inside a building or a wall.
        crossed: walkers that were on a crosswalk, off every sidewalk.
        walked: walkers that came farther than :data:`WALKED_M`.
    """

    walkers: int
    samples: int = 0
    outside: int = 0
    in_walls: int = 0
    farthest_outside_m: float = 0.0
    crossed: int = 0
    walked: int = 0
    mean_distance_m: float = 0.0
    alive: int = 0
    events: list[str] = field(default_factory=list)


def crosswalk_polygons(locations: list[carla.Location]) -> list[Polygon]:
    """Splits ``carla.Map.get_crosswalks()``: each outline ends with its own first corner."""
    polygons, outline = [], []
    for location in locations:
        corner = (location.x, location.y)
        outline.append(corner)
        if len(outline) > 3 and np.allclose(corner, outline[0], atol=1e-3):
            polygons.append(Polygon(outline))
            outline = []
    return polygons


def walkable_surface(carla_map: carla.Map) -> tuple[BaseGeometry, BaseGeometry]:
    """Sidewalks and crosswalks of a map as polygons, drawn from OpenDRIVE alone."""
    strips = []
    for waypoint in _sidewalk_waypoints(carla_map):
        place, turn = waypoint.transform.location, waypoint.transform.rotation
        yaw = np.radians(turn.yaw)
        forward = np.array([np.cos(yaw), np.sin(yaw)]) * 0.75
        right = np.array([-np.sin(yaw), np.cos(yaw)]) * 0.5 * waypoint.lane_width
        middle = np.array([place.x, place.y])
        corners = (forward + right, forward - right, -forward - right, right - forward)
        strips.append(Polygon([middle + corner for corner in corners]))
    sidewalks = shapely.union_all(strips) if strips else MultiPolygon()
    return sidewalks, shapely.union_all(crosswalk_polygons(carla_map.get_crosswalks()))


def walls(world: carla.World) -> BaseGeometry:
    """Outlines of all buildings and walls, seen from above, without what overhangs."""
    boxes = [
        box
        for label in (carla.CityObjectLabel.Buildings, carla.CityObjectLabel.Walls)
        for box in world.get_level_bbs(label)
    ]
    if not boxes:
        return MultiPolygon()
    corners = footprint_corners(
        np.array([(box.location.x, box.location.y) for box in boxes]),
        np.array([(box.extent.x, box.extent.y) for box in boxes]),
        np.array([box.rotation.yaw for box in boxes]),
    )
    boxes_from_above = shapely.polygons(corners)
    return shapely.union_all(shapely.buffer(boxes_from_above, -OVERHANG_M, join_style="mitre"))


def _sidewalk_waypoints(carla_map: carla.Map) -> list[carla.Waypoint]:
    """Samples of the sidewalk lanes beside every driving lane, each once."""
    found: dict[tuple[int, int, int, int], carla.Waypoint] = {}
    for start in carla_map.generate_waypoints(1.0):
        for step in ("get_right_lane", "get_left_lane"):
            lane = start
            for _ in range(8):
                lane = getattr(lane, step)()
                if lane is None:
                    break
                if lane.lane_type == carla.LaneType.Sidewalk:
                    key = (lane.road_id, lane.section_id, lane.lane_id, round(lane.s * 2.0))
                    found[key] = lane
                    break
    return list(found.values())


def walkers_trial(port: int, *, walkers: int, seconds: float, fps: int, seed: int) -> WalkerFigures:
    """Lets the walkers walk and measures; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        sidewalks, crosswalks = walkable_surface(session.world.get_map())
        allowed = shapely.union(sidewalks, crosswalks)
        solid = walls(session.world)
        for surface in (allowed, solid):
            shapely.prepare(surface)
        actors = spawn_walkers(session, walkers)
        figures = WalkerFigures(walkers)
        distance = np.zeros(walkers)
        crossed = np.zeros(walkers, dtype=np.bool_)
        before: NDArray[np.float64] | None = None
        for tick in range(round(seconds * fps)):
            session.clock.tick()
            if tick % max(fps // 4, 1):
                continue
            snapshot = session.world.get_snapshot()
            states = [snapshot.find(actor.id) for actor in actors]
            places = np.array([_place(state) for state in states])
            if before is not None:
                distance += np.nan_to_num(np.linalg.norm(places - before, axis=1))
            before = places
            points = shapely.points(places)
            off = np.asarray(shapely.distance(points, allowed))
            figures.samples += len(actors)
            figures.outside += int((off > TOLERANCE_M).sum())
            figures.in_walls += int(shapely.intersects(points, solid).sum())
            worst = int(np.nanargmax(off))
            if off[worst] > max(figures.farthest_outside_m, TOLERANCE_M):
                x, y = places[worst]
                figures.events.append(
                    f"walker {actors[worst].id} was {off[worst]:.2f} m off at ({x:.1f}, {y:.1f})"
                )
            figures.farthest_outside_m = max(figures.farthest_outside_m, float(off[worst]))
            on_crosswalk = shapely.distance(points, crosswalks) == 0.0
            crossed |= on_crosswalk & (shapely.distance(points, sidewalks) > 0.0)
        figures.alive = sum(state is not None for state in states)
        figures.crossed = int(crossed.sum())
        figures.walked = int((distance > WALKED_M).sum())
        figures.mean_distance_m = float(distance.mean())
        return figures


def _place(state: carla.ActorSnapshot | None) -> tuple[float, float]:
    if state is None:
        return (np.nan, np.nan)
    location = state.get_transform().location
    return (location.x, location.y)


def check_walkers(
    towns: Sequence[str] = ("Stage01",),
    *,
    walkers: int = 20,
    seconds: float = 60.0,
    fps: int = 20,
    seed: int = 7,
    server_arguments: Sequence[str] = (),
) -> Campaign:
    """A verdict for each town, where pedestrians walk on a server of their own."""
    verdicts = []
    for number, town in enumerate(towns, 1):
        print(f"walkers in {town} ({number} of {len(towns)})", file=sys.stderr, flush=True)
        arguments = ("--map", town, *server_arguments)
        try:
            with running_server(arguments, start_timeout_s=_START_TIMEOUT_S) as port:
                figures = run_trial(
                    walkers_trial,
                    port,
                    walkers=walkers,
                    seconds=seconds,
                    fps=fps,
                    seed=seed,
                    timeout_s=300.0 + 8.0 * seconds,
                )
        except (ServerError, TrialError) as error:
            verdicts.append(Verdict(f"walkers in {town}", (), (str(error),), completed=False))
        else:
            verdicts.append(judge(town, figures))
        print(verdicts[-1].text(), file=sys.stderr, flush=True)
    return Campaign("walkers", dict(zip(towns, verdicts, strict=True)))


def judge(town: str, figures: WalkerFigures) -> Verdict:
    """The figures of a trial beside their targets."""
    return Verdict(
        f"walkers in {town}",
        (
            Figure("walkers", figures.walkers),
            Figure("alive", figures.alive, "==", figures.walkers),
            Figure("samples", figures.samples),
            Figure("samples_off_the_walkable_surface", figures.outside, "==", 0),
            Figure("farthest_off_m", figures.farthest_outside_m, "<=", TOLERANCE_M),
            Figure("samples_inside_walls", figures.in_walls, "==", 0),
            Figure("walked_over_10_m", figures.walked, ">=", round(0.8 * figures.walkers)),
            Figure("used_a_crosswalk", figures.crossed),
            Figure("mean_distance_m", figures.mean_distance_m),
        ),
        figures.events[:_MAX_EVENTS],
    )
