"""Do pedestrians walk where they may, and not through walls? The client's AI controllers walk."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree

import carla
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from benchmarks.campaign import Campaign
from benchmarks.simulator.client_process import TrialError, run_trial
from benchmarks.simulator.server_process import running_server
from benchmarks.simulator.session import spawn_walkers, synchronous_session
from carstage.bench.verdict import Figure, Verdict
from carstage.errors import ServerError

TOLERANCE_M = 0.5
TO_THE_KERB_M = 5.0
"""Crosswalks whose ends are farther from a sidewalk lead to none."""
SOLID = (
    carla.CityObjectLabel.Buildings,
    carla.CityObjectLabel.Walls,
    carla.CityObjectLabel.Fences,
    carla.CityObjectLabel.GuardRail,
    carla.CityObjectLabel.Poles,
)
WALKED_M = 10.0
_STEP_M = 0.5
_START_TIMEOUT_S = 900.0
_MAX_EVENTS = 20


@dataclass(slots=True)
class WalkerFigures:
    """What a trial measured.

    Attributes:
        outside: samples off sidewalks and crosswalks.
        through_walls: steps that lead through a building, a wall, a fence or a pole.
        crossed: walkers that were on a crosswalk, off every sidewalk.
        walked: walkers that came farther than :data:`WALKED_M`.
    """

    walkers: int
    samples: int = 0
    outside: int = 0
    through_walls: int = 0
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


class WalkableSurface:
    """Where a map lets people walk: drawn from its OpenDRIVE text with the client's geometry.

    Attributes:
        sidewalks: all lanes of that type.
        crosswalks: the outlines that the client knows.
    """

    def __init__(self, carla_map: carla.Map) -> None:
        outlines = crosswalk_polygons(carla_map.get_crosswalks())
        self.sidewalks: BaseGeometry = shapely.union_all(_sidewalk_strips(carla_map))
        self.crosswalks: BaseGeometry = shapely.union_all(outlines)
        links = [link for outline in outlines for link in self._links(outline)]
        self._allowed: BaseGeometry = shapely.union_all([self.sidewalks, *outlines, *links])
        for surface in (self.sidewalks, self.crosswalks, self._allowed):
            shapely.prepare(surface)

    def _links(self, crosswalk: Polygon) -> list[BaseGeometry]:
        """From both ends of a crosswalk to the sidewalk near it.

        In CARLA's towns the outlines end before the kerb.
        """
        corners = shapely.get_coordinates(crosswalk.minimum_rotated_rectangle)
        narrow = sorted(range(4), key=lambda k: float(np.ptp(corners[k : k + 2], axis=0).sum()))[:2]
        ends = [shapely.Point(corners[side : side + 2].mean(axis=0)) for side in narrow]
        lines = [shapely.shortest_line(end, self.sidewalks) for end in ends]
        return [
            line.buffer(1.5)
            for line in lines
            if line is not None and 0.0 < line.length <= TO_THE_KERB_M
        ]

    def off_m(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far ``(N, 3)`` places are from sidewalks, crosswalks and the ways between them.

        NaN gives NaN; on a map with neither of them every place is infinitely far away.
        """
        off: NDArray[np.float64] = np.full(len(places), np.nan)
        alive = np.isfinite(places[:, 0])
        off[alive] = np.inf
        if not self._allowed.is_empty:
            off[alive] = shapely.distance(shapely.points(places[alive, :2]), self._allowed)
        return off


def _sidewalk_strips(carla_map: carla.Map) -> list[Polygon]:
    """Pieces of all sidewalk lanes, a metre and a half long."""
    strips = []
    for waypoint in _sidewalk_waypoints(carla_map):
        place, turn = waypoint.transform.location, waypoint.transform.rotation
        yaw = np.radians(turn.yaw)
        forward = np.array([np.cos(yaw), np.sin(yaw)]) * 0.75
        right = np.array([-np.sin(yaw), np.cos(yaw)]) * 0.5 * waypoint.lane_width
        middle = np.array([place.x, place.y])
        corners = (forward + right, forward - right, -forward - right, right - forward)
        strips.append(Polygon([middle + corner for corner in corners]))
    return strips


def _sidewalk_waypoints(carla_map: carla.Map) -> Iterator[carla.Waypoint]:
    for road in ElementTree.fromstring(carla_map.to_opendrive()).iter("road"):
        sections = list(road.iter("laneSection"))
        starts = [float(section.get("s", 0.0)) for section in sections]
        ends = [*starts[1:], float(road.get("length", 0.0))]
        for section, start_m, end_m in zip(sections, starts, ends, strict=True):
            for lane in section.iter("lane"):
                if lane.get("type") != "sidewalk":
                    continue
                for s_m in np.arange(start_m, end_m, _STEP_M):
                    numbers = int(road.get("id", 0)), int(lane.get("id", 0)), float(s_m)
                    waypoint = carla_map.get_waypoint_xodr(*numbers)
                    if waypoint is not None:
                        yield waypoint


def walked_through(
    world: carla.World, before: NDArray[np.float64], now: NDArray[np.float64]
) -> str | None:
    """What solid thing lies between two places ``(3,)`` of a walker, at the height of its middle.

    Steps are so short that the way between them is straight.
    """
    points = world.cast_ray(carla.Location(*before), carla.Location(*now))
    return next((str(point.label) for point in points if point.label in SOLID), None)


def walkers_trial(port: int, *, walkers: int, seconds: float, fps: int, seed: int) -> WalkerFigures:
    """Lets the walkers walk and measures; runs in the client's process."""
    with synchronous_session(port, delta_s=1.0 / fps, seed=seed) as session:
        surface = WalkableSurface(session.world.get_map())
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
                way = np.nan_to_num(np.linalg.norm(places - before, axis=1))
                distance += way
                for row in np.flatnonzero(way > 0.0):
                    solid = walked_through(session.world, before[row], places[row])
                    if solid is not None:
                        figures.through_walls += 1
                        x, y, _ = places[row]
                        figures.events.append(
                            f"walker {actors[row].id} went through {solid} at ({x:.1f}, {y:.1f})"
                        )
            before = places
            points = shapely.points(places[:, :2])
            off = surface.off_m(places)
            figures.samples += len(actors)
            figures.outside += int((off > TOLERANCE_M).sum())
            worst = int(np.nanargmax(off))
            if off[worst] > max(figures.farthest_outside_m, TOLERANCE_M):
                x, y, _ = places[worst]
                figures.events.append(
                    f"walker {actors[worst].id} was {off[worst]:.2f} m off at ({x:.1f}, {y:.1f})"
                )
            figures.farthest_outside_m = max(figures.farthest_outside_m, float(off[worst]))
            on_crosswalk = shapely.intersects(points, surface.crosswalks)
            crossed |= on_crosswalk & ~shapely.intersects(points, surface.sidewalks)
        figures.alive = sum(state is not None for state in states)
        figures.crossed = int(crossed.sum())
        figures.walked = int((distance > WALKED_M).sum())
        figures.mean_distance_m = float(distance.mean())
        return figures


def _place(state: carla.ActorSnapshot | None) -> tuple[float, float, float]:
    if state is None:
        return (np.nan, np.nan, np.nan)
    location = state.get_transform().location
    return (location.x, location.y, location.z)


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
            Figure("steps_through_walls_or_poles", figures.through_walls, "==", 0),
            Figure("walked_over_10_m", figures.walked, ">=", round(0.8 * figures.walkers)),
            Figure("used_a_crosswalk", figures.crossed),
            Figure("mean_distance_m", figures.mean_distance_m),
        ),
        figures.events[:_MAX_EVENTS],
    )
