"""The bake: from an OpenDRIVE text to a finished town."""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import math
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from signal import Signals

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage_sim.maps.bridges import bridge_mesh, wall_mesh
from carstage_sim.maps.cache import digest_of
from carstage_sim.maps.checking import MapSamplingError, check_opendrive, check_samples
from carstage_sim.maps.drape import Drape, profile_cuts
from carstage_sim.maps.greenery import grass_tufts
from carstage_sim.maps.ground_mesh import LevelSurface
from carstage_sim.maps.horizon import hills_mesh
from carstage_sim.maps.levels import CLEARANCE_M, station_levels
from carstage_sim.maps.lights import light_sites
from carstage_sim.maps.navmesh import fits_in_a_tile, navigation_file
from carstage_sim.maps.placement import SceneryPlacement
from carstage_sim.maps.road_wear import UNWORN, road_wear
from carstage_sim.maps.scenery import scenery
from carstage_sim.maps.signals import (
    LIGHT,
    SPEED_LIMIT,
    STOP,
    GovernedLane,
    PaintedArrow,
    SignalPlan,
    signal_plan,
)
from carstage_sim.maps.signs import sign_sites
from carstage_sim.maps.spawning import spawn_points
from carstage_sim.maps.strips import (
    Crosswalk,
    Samples,
    Strip,
    crosswalks,
    driving_lanes,
    strips,
)
from carstage_sim.maps.surfaces import Surfaces, ground_layers, surfaces
from carstage_sim.maps.town import Town
from carstage_sim.maps.walkways import Walkways, joined, walkways
from carstage_sim.maps.writer import PLANS
from carstage_sim.mesh import merge_meshes

logger = logging.getLogger(__name__)

_SAMPLING_LIMIT_S = 600.0
_SAMPLING_S_PER_MB = 120.0
"""Beyond the first megabytes; a busy machine may take ten times what a free one takes."""
_HILLSIDE_M = 60.0
_HILL_CELL_M = 12.5
_MOST_HILL_CELLS = 40_000


@dataclass(frozen=True, slots=True)
class BakeOptions:
    """What to make of a map apart from its roads.

    Attributes:
        scenery: buildings, trees and furniture.
        navigation: where pedestrians walk.
        wall_height_m: of walls along the outer edges of the roads, 0 for none.
    """

    scenery: bool = True
    navigation: bool = True
    wall_height_m: float = 0.0


EVERYTHING = BakeOptions()


@dataclass(frozen=True, slots=True)
class _Level:
    """One level of a map: its lanes, areas, heights."""

    number: int
    lanes: list[Strip]
    ground: Surfaces
    drape: Drape
    cuts: list[BaseGeometry]
    stops: list[GovernedLane]
    arrows: list[PaintedArrow]

    @property
    def extent(self) -> BaseGeometry:
        """All that is paved."""
        return shapely.union_all([self.ground.road, self.ground.sidewalk, self.ground.median])


def bake(name: str, opendrive: str, options: BakeOptions = EVERYTHING) -> Town:
    """Bakes an OpenDRIVE text; equal names, texts and options give equal towns, to the byte.

    Raises:
        MapSamplingError: if the text cannot be read, or holds nothing to drive on.
    """
    logger.info("baking %s: reading the lanes", name)
    check_opendrive(name, opendrive)
    samples = sample_in_child(opendrive, name)
    plan = signal_plan(samples["record"])
    lanes = strips(samples, station_levels(samples))
    if not any(lane.kind == "driving" for lane in lanes):
        raise MapSamplingError(
            f"map {name}: it has no lane of type driving that CARLA's client finds; see whether "
            "its roads have lane sections with a width"
        )
    seed = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "big")
    spawn_rng, scenery_rng, land_rng, wear_rng = np.random.default_rng(seed).spawn(4)
    levels = _levels(lanes, crosswalks(samples), plan)
    base = levels[0]
    logger.info("baking %s: %d lanes on %d levels; scenery", name, len(lanes), len(levels))
    stage = _scenery(levels, plan, scenery_rng, bare=not options.scenery)
    logger.info("baking %s: ground", name)
    ceilings = [(level.extent, level.drape) for level in levels[1:]]
    surface: list[LevelSurface] = []
    for level in levels:
        pits, buildings = ([], []) if level.number else (stage.pits, stage.buildings)
        wear = UNWORN
        if options.scenery:
            wear = road_wear(level.lanes, level.ground.crosswalks, wear_rng)
        layers = ground_layers(
            level.ground, level.lanes, plan, level.stops, level.arrows, pits, buildings, wear
        )
        cuts = level.cuts if level.number else level.cuts + _land_cuts(level)
        surface.append(
            LevelSurface(
                [layer for layer in layers if not layer.area.is_empty],
                level.drape,
                cuts,
                () if level.number else ceilings,
            )
        )
    meshes = [part.mesh for part in surface]
    for index, level in enumerate(levels[1:], start=1):
        others = [
            (other.extent, surface[k]) for k, other in enumerate(levels) if other is not level
        ]
        meshes.append(bridge_mesh(surface[index], others))
    stage.set_down(surface[0], ceilings)
    if options.scenery:
        meshes.append(hills_mesh(base.ground.terrain, surface[0].height, land_rng))
        meshes += grass_tufts(base.ground, surface[0], land_rng)
    if options.wall_height_m > 0.0:
        meshes += [wall_mesh(part, options.wall_height_m) for part in surface]
    logger.info("baking %s: %d objects; navigation", name, len(stage.objects))

    def height_at(x: float, y: float) -> float:
        return float(surface[0].height(np.array([[x, y]]))[0])

    lights = light_sites(plan, height_at)
    walked = levels if options.navigation else []
    posts = [*(site.location[:2] for site in lights), *stage.poles]
    paths = [walkways(level.ground, level.drape, level.cuts, posts) for level in walked]
    walk = joined([path for path in paths if path is not None])
    town = Town(
        name=name,
        opendrive=opendrive,
        geo_reference=plan.geo_reference,
        spawn_points=spawn_points(lanes, spawn_rng, on_every_lane=name not in PLANS),
        lanes=driving_lanes(samples, plan.of_kind(SPEED_LIMIT)),
        traffic_lights=lights,
        navigation=_navigation(name, walk),
        static_mesh=merge_meshes([*meshes, *stage.meshes]),
        level_objects=tuple(stage.objects),
        digest="",
        traffic_signs=sign_sites(plan, height_at),
    )
    return dataclasses.replace(town, digest=digest_of(town))


def _navigation(name: str, walk: Walkways | None) -> bytes:
    if walk is None:
        return b""
    if not fits_in_a_tile(walk):
        logger.warning("map %s has too many sidewalks for pedestrian navigation: it has none", name)
        return b""
    return navigation_file(walk)


def _levels(lanes: list[Strip], crossings: list[Crosswalk], plan: SignalPlan) -> list[_Level]:
    """The levels, the ground first."""
    numbers = sorted({lane.level for lane in lanes})
    members = {n: [lane for lane in lanes if lane.level == n] for n in numbers}
    drapes = {n: Drape(members[n]) for n in numbers}
    walks: dict[int, list[shapely.Polygon]] = {n: [] for n in numbers}
    for crossing in crossings:
        middle = np.array(crossing.area.centroid.coords)
        walks[_nearest_level(drapes, middle, crossing.z_m)].append(crossing.area)
    stops: dict[int, list[GovernedLane]] = {n: [] for n in numbers}
    for signal in [*plan.of_kind(LIGHT), *plan.of_kind(STOP)]:
        for lane in signal.lanes:
            place = np.array([lane.stop[:2]])
            stops[_nearest_level(drapes, place, lane.stop[2])].append(lane)
    arrows: dict[int, list[PaintedArrow]] = {n: [] for n in numbers}
    for arrow in plan.arrows:
        place = np.array([arrow.location[:2]])
        arrows[_nearest_level(drapes, place, arrow.location[2])].append(arrow)
    result: list[_Level] = []
    for n in reversed(numbers):
        ground = surfaces(members[n], walks[n], with_land=n == 0)
        cuts = profile_cuts(members[n])
        result.append(_Level(n, members[n], ground, drapes[n], cuts, stops[n], arrows[n]))
    return result[::-1]


def _nearest_level(drapes: dict[int, Drape], place: NDArray[np.float64], z_m: float) -> int:
    if len(drapes) == 1:
        return next(iter(drapes))
    return min(drapes, key=lambda n: abs(float(drapes[n].height(place)[0]) - z_m))


def _scenery(
    levels: Sequence[_Level], plan: SignalPlan, rng: np.random.Generator, *, bare: bool
) -> SceneryPlacement:
    """All that stands on the ground; see :func:`scenery`."""
    base, *others = levels
    bridges = [level.extent for level in others]
    grounded = _on_the_ground(plan, base.drape)
    return scenery(base.ground, base.lanes, grounded, bridges, rng, bare=bare)


def _on_the_ground(plan: SignalPlan, lanes: Drape) -> SignalPlan:
    """The plan without signals of bridges: their posts would stand on what lies below."""
    # The road's height, not that of a plate over it.
    of_roads = [s.lanes[0].stop[:3] if s.lanes else s.location for s in plan.signals]
    places = np.array(of_roads, np.float64).reshape(-1, 3)
    above_m = places[:, 2] - lanes.height(places[:, :2]) if len(places) else np.zeros(0)
    kept = [s for s, m in zip(plan.signals, above_m.tolist(), strict=True) if m < CLEARANCE_M]
    return dataclasses.replace(plan, signals=tuple(kept))


def _land_cuts(level: _Level) -> list[BaseGeometry]:
    """A finer grid over the land beside hilly roads, so that it can follow them."""
    if level.drape.is_flat:
        return []
    near = level.ground.road.buffer(_HILLSIDE_M)
    x0, y0, x1, y1 = near.bounds
    cell_m = max(_HILL_CELL_M, math.sqrt(near.area / _MOST_HILL_CELLS))
    cell_m = _HILL_CELL_M * math.ceil(cell_m / _HILL_CELL_M)
    xs = np.arange(math.floor(x0 / cell_m), math.ceil(x1 / cell_m)) * cell_m
    ys = np.arange(math.floor(y0 / cell_m), math.ceil(y1 / cell_m)) * cell_m
    x, y = (part.reshape(-1) for part in np.meshgrid(xs, ys, indexing="ij"))
    cells = shapely.box(x, y, x + cell_m, y + cell_m)
    shapely.prepare(near)
    return [shapely.union_all(shapely.boundary(cells[shapely.intersects(near, cells)]))]


def sample_in_child(opendrive: str, name: str) -> Samples:
    """Lane samples of an OpenDRIVE text, made by ``carstage_sim.maps.opendrive`` in a process.

    Raises:
        MapSamplingError: with the child's last words, or with what no town can be made of.
    """
    with tempfile.TemporaryDirectory(prefix="carstage-map-") as folder:
        source, target = Path(folder) / f"{name}.xodr", Path(folder) / "samples.npz"
        source.write_text(opendrive, encoding="utf-8")
        command = [sys.executable, "-m", "carstage_sim.maps.opendrive", str(source), str(target)]
        limit_s = max(_SAMPLING_LIMIT_S, _SAMPLING_S_PER_MB * len(opendrive) / 1e6)
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=limit_s, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise MapSamplingError(
                f"map {name}: reading its lanes took longer than {limit_s:.0f} s; cut the map into "
                f"pieces, or try again on a machine that is less busy"
            ) from error
        if done.returncode != 0 or not target.exists():
            raise MapSamplingError(
                f"map {name}: CARLA's own reader gives up on it: {_last_words(done)[:400]}; "
                f"carla.Map({name!r}, text) shows the same in any program"
            )
        with np.load(target) as arrays:
            samples = {key: arrays[key] for key in arrays.files}
    check_samples(name, samples)
    return samples


def _last_words(done: subprocess.CompletedProcess[str]) -> str:
    """Why the process that reads a map ended; the reader's warnings are about something else."""
    if done.returncode < 0:
        return f"it crashes ({Signals(-done.returncode).name})"
    lines = [line for line in done.stderr.splitlines() if line and not line.startswith("WARNING:")]
    return lines[-1] if lines else f"it ended with {done.returncode}"
