"""Do pedestrians walk where they may, and not through walls? The client's AI controllers walk."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field

import carla
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from carstage_sim.check.client_process import TrialError, run_trial
from carstage_sim.check.server_process import ServerError, running_server
from carstage_sim.check.session import spawn_walkers, synchronous_session
from carstage_sim.check.verdict import Campaign, Figure, Verdict

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
    """Where a map's OpenDRIVE lets people walk, as the client reads it.

    Attributes:
        crosswalks: their outlines.
    """

    def __init__(self, carla_map: carla.Map) -> None:
        self._map = carla_map
        outlines = crosswalk_polygons(carla_map.get_crosswalks())
        self.crosswalks: BaseGeometry = shapely.union_all(outlines)
        links = [link for outline in outlines for link in self._links(outline)]
        self._ways: BaseGeometry = shapely.union_all([*outlines, *links])
        shapely.prepare(self._ways)

    def _links(self, crosswalk: Polygon) -> list[BaseGeometry]:
        """From both ends of a crosswalk to the sidewalk near it.

        In CARLA's towns the outlines end before the kerb.
        """
        corners = shapely.get_coordinates(crosswalk.minimum_rotated_rectangle)
        narrow = sorted(range(4), key=lambda k: float(np.ptp(corners[k : k + 2], axis=0).sum()))[:2]
        links: list[BaseGeometry] = []
        for side in narrow:
            end = corners[side : side + 2].mean(axis=0)
            place = carla.Location(*end, 0.0)
            lane = self._map.get_waypoint(place, lane_type=carla.LaneType.Sidewalk)
            if lane is None:
                continue
            goal = lane.transform.location
            line = LineString([end, (goal.x, goal.y)])
            if line.length <= TO_THE_KERB_M + 0.5 * lane.lane_width:
                links.append(line.buffer(1.0))
        return links

    def from_sidewalk_m(self, x: float, y: float, z: float) -> float:
        """How far a place is from the nearest sidewalk's edge, 0 on it."""
        place = carla.Location(x, y, z)
        lane = self._map.get_waypoint(place, lane_type=carla.LaneType.Sidewalk)
        if lane is None:
            return float("inf")
        middle = lane.transform.location
        from_middle = float(np.hypot(x - middle.x, y - middle.y))
        return max(from_middle - 0.5 * float(lane.lane_width), 0.0)

    def off_m(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far ``(N, 3)`` places are from sidewalks, crosswalks and the ways between them.

        NaN where there is no place.
        """
        off = np.asarray(shapely.distance(shapely.points(places[:, :2]), self._ways))
        # A map without crosswalks has no ways, and nothing has a distance to nothing.
        off[np.isnan(off) & np.isfinite(places[:, 0])] = np.inf
        for row in np.flatnonzero(off > 0.0):
            off[row] = min(off[row], self.from_sidewalk_m(*places[row]))
        return off


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
            for row in np.flatnonzero(shapely.distance(points, surface.crosswalks) == 0.0):
                crossed[row] |= surface.from_sidewalk_m(*places[row]) > 0.0
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
