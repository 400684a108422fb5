"""Bird's-eye grids beside the same scene, rasterised by Shapely from other sources.

Lanes, markings, crosswalks and stop lines come from ``carla.Map``, waypoint by waypoint; which
lanes there are is the vector map's. Boxes are those of ``carla.BoundingBox``. A cell counts where
its centre lies in a shape. Places on lanes of the built-in towns need no recording; what datasets
hold is compared with its objects.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import carla
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from carstage import Dataset
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure, Verdict
from carstage.birds_eye import (
    STATIC_LAYERS,
    BirdsEye,
    CameraView,
    Cloud,
    Grid,
    GridPose,
    TownShapes,
    draw_birds_eye,
    pack_birds_eye,
)
from carstage.codecs.semantic_points import points_xyz
from carstage.dataset import Frame
from carstage.geometry import pose_matrix
from carstage.sensor_kinds.model import CLOUDS
from carstage.vector_map import Lane, VectorMap, vector_map
from carstage_sim.maps.loading import built_in_source

TOWNS = ("Stage01", "Stage02", "Stage03")
GRID = Grid(100.0, 100.0, 0.2)
TARGET_IOU = 0.98
TARGET_CPU_MS = 40.0
_STEP_M = 0.5
_ROUNDS = 5
_LANE_LAYERS = {
    "driving": "drivable_area", "bidirectional": "drivable_area", "parking": "parking",
    "shoulder": "shoulder", "stop": "shoulder", "biking": "bike_lane", "sidewalk": "sidewalk",
}  # fmt: skip
_MARKING_LAYERS = {
    "Solid": ("solid_marking",), "SolidSolid": ("solid_marking",), "Curb": ("curb",),
    "Broken": ("broken_marking",), "BrokenBroken": ("broken_marking",),
    "BottsDots": ("broken_marking",), "SolidBroken": ("solid_marking", "broken_marking"),
    "BrokenSolid": ("solid_marking", "broken_marking"),
}  # fmt: skip
Mask = NDArray[np.bool_]
Shapes = dict[str, list[BaseGeometry]]


class _Counts:
    """Cells of intersection and union by class."""

    def __init__(self) -> None:
        self.both: dict[str, int] = defaultdict(int)
        self.either: dict[str, int] = defaultdict(int)

    def add(self, name: str, found: Mask, expected: Mask) -> None:
        self.both[name] += int((found & expected).sum())
        self.either[name] += int((found | expected).sum())

    def ious(self) -> dict[str, float]:
        return {n: self.both[n] / either for n, either in self.either.items() if either}


def measure_birds_eye(
    towns: Sequence[str] = TOWNS,
    places: int = 6,
    datasets: Sequence[Path] = (),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Compare grids at places on lanes, and those of datasets with their objects.

    Args:
        towns: names of built-in towns.
        places: in each.
        datasets: with bird's-eye grids, each of one town.
        progress: called with the grids compared and their least number.
    """
    counts, slow = _Counts(), [slowness()]
    cpu_ms: list[float] = []
    sizes: list[int] = []
    grids = frames = otherwise = 0
    total = len(towns) * places + len(datasets)
    for number, town in enumerate(towns):
        text = built_in_source(town).opendrive
        truth = _TownTruth(town, vector_map(text), text, GRID.resolution_m)
        for pose in _places(truth.made, places, number):
            drawn = draw_birds_eye(GRID, pose, truth.shapes, [])
            truth.compare(BirdsEye(GRID, pose, drawn), counts)
            grids += 1
            progress(grids, total)
        slow.append(slowness())
    for dataset in datasets:
        for episode in Dataset(dataset).episodes:
            made, town_text, asked = (
                episode.vector_map(),
                episode.opendrive(),
                episode.spec.labels.birds_eye,
            )
            if made is None or town_text is None or asked is None:
                raise ValueError(f"{dataset} has no bird's-eye grids with a vector map.")
            truth = _TownTruth(episode.spec.map, made, town_text, asked.resolution_m)
            for frame in episode.iter_frames():
                stored = episode.birds_eye(frame.k)
                assert stored is not None
                truth.compare(stored, counts)
                _compare_objects(frame, stored, counts)
                spent, packed = _drawn_again(frame, stored, truth.shapes)
                cpu_ms += spent
                sizes.append(len(packed))
                otherwise += packed != pack_birds_eye(stored)
                frames += 1
                progress(min(grids + frames, total), total)
        slow.append(slowness())
    scale = max(1.0, statistics.median(slow))
    figures = [
        Figure("places_on_lanes", grids),
        Figure("frames_of_datasets", frames),
        *(
            Figure(f"iou_of_{name}", iou, ">=", TARGET_IOU)
            for name, iou in sorted(counts.ious().items())
        ),
        Figure("machine_slowness", scale),
    ]
    if frames:
        middle = statistics.median(cpu_ms)
        figures += [
            Figure("frames_drawn_otherwise_from_the_dataset", otherwise, "<=", 0),
            Figure("cpu_ms_per_frame", middle),
            Figure("scaled_cpu_ms_per_frame", middle / scale, "<=", TARGET_CPU_MS),
            Figure("kilobytes_per_frame", statistics.mean(sizes) / 1000.0),
        ]
    cells = ", ".join(f"{name} {count}" for name, count in sorted(counts.either.items()))
    notes = (
        "The cost is that of drawing and packing one frame; reading and writing not included.",
        f"Cells compared: {cells}.",
    )
    return Verdict("birds-eye", tuple(figures), notes)


def _places(made: VectorMap, count: int, seed: int) -> Iterator[GridPose]:
    """Ends of driving lanes, drawn at random, each with a heading of its own."""
    rng = np.random.default_rng(seed)
    lanes = [lane for lane in made.lanes if lane.type == "driving"]
    for index in rng.choice(len(lanes), min(count, len(lanes)), replace=False).tolist():
        x, y, z = lanes[index].centre_line[0].tolist()
        yield GridPose(x, y, z, float(rng.uniform(-180.0, 180.0)))


def _drawn_again(frame: Frame, stored: BirdsEye, town: TownShapes) -> tuple[list[float], bytes]:
    """CPU milliseconds of drawing a frame again, several times, and the file that comes of it."""
    views, clouds, seen = [], [], set[int]()
    for sensor in frame.episode.sensors:
        camera = sensor.calibration
        if camera.labelled and camera.depth is not None:
            size = camera.width, camera.height
            pose = _pose(frame, sensor.id)
            views.append(CameraView(camera.k, pose, frame.read(camera.depth), *size))
        elif sensor.content in CLOUDS:
            clouds.append(Cloud(_pose(frame, sensor.id), points_xyz(frame.read(sensor.id))))
    for rows in frame.camera_objects.values():
        seen |= {row["track_id"] for row in rows if row["visible"]}
    spent = []
    for _ in range(_ROUNDS):
        started = time.process_time()
        drawn = draw_birds_eye(stored.grid, stored.pose, town, _objects(frame), seen, views, clouds)
        packed = pack_birds_eye(BirdsEye(stored.grid, stored.pose, drawn))
        spent.append(1e3 * (time.process_time() - started))
    return spent, packed


def _objects(frame: Frame) -> list[Mapping[str, Any]]:
    return [*frame.objects.values(), *([frame.ego_object] if frame.ego_object else [])]


def _pose(frame: Frame, sensor: str) -> NDArray[np.float64]:
    row = frame.sensor_poses[sensor]
    return pose_matrix(row["location"], row["rotation_deg"])


class _TownTruth:
    """Shapes of a town that do not come from the code that is checked."""

    def __init__(self, name: str, made: VectorMap, text: str, resolution_m: float) -> None:
        self.made = made
        self._client = carla.Map(name, text)
        self._rings = list(_rings(self._client.get_crosswalks()))
        self.shapes = TownShapes.of(made, resolution_m)

    def compare(self, stored: BirdsEye, counts: _Counts) -> None:
        """Add what the layers of a grid and the shapes have in common."""
        world = stored.world()
        centres = np.array(shapely.points(world.reshape(-1, 2)))
        around = shapely.box(*world.min(axis=(0, 1)), *world.max(axis=(0, 1)))
        shapes = self._lanes(around, stored.grid.resolution_m)
        shapes["crosswalk"] = [ring for ring in self._rings if ring.intersects(around)]
        for name in STATIC_LAYERS:
            counts.add(name, stored.layer(name), _within(shapes[name], centres, world.shape))

    def _lanes(self, around: BaseGeometry, resolution_m: float) -> Shapes:
        shapes: Shapes = defaultdict(list)
        ended = {name for stop in self.made.stop_lines for name in stop.lanes}
        for lane in self.made.lanes:
            if not shapely.LineString(lane.centre_line[:, :2]).buffer(10.0).intersects(around):
                continue
            waypoints = list(self._waypoints(lane))
            if len(waypoints) < 2:
                continue
            sides = np.array([_sides(self._client, waypoint) for waypoint in waypoints])
            polygon = _quads(sides)
            first = waypoints[len(waypoints) // 2]
            layer = _LANE_LAYERS.get(str(first.lane_type).lower())
            if layer is not None:
                shapes[layer] += polygon
            if layer == "parking":
                shapes["drivable_area"] += polygon
            if layer == "drivable_area":
                shapes["junction" if first.is_junction else "lane"] += polygon
            for side, name in enumerate(("left_lane_marking", "right_lane_marking")):
                marks = [getattr(waypoint, name) for waypoint in waypoints]
                _add_markings(shapes, sides[:, side], marks, resolution_m)
            if lane.id in ended:
                self._add_stops(shapes, lane, resolution_m)
        return shapes

    def _waypoints(self, lane: Lane) -> Iterator[Any]:
        begin, end = float(lane.s_m.min()), float(lane.s_m.max())
        count = max(2, int((end - begin) / _STEP_M) + 1)
        for s_m in np.linspace(begin + 1e-4, end - 1e-4, count).tolist():
            waypoint = self._client.get_waypoint_xodr(lane.road_id, lane.lane, s_m)
            if waypoint is not None and waypoint.section_id == lane.section:
                yield waypoint

    def _add_stops(self, shapes: Shapes, lane: Lane, resolution_m: float) -> None:
        """Lines across a lane at the stations of its stop lines, or where it ends."""
        for stop in self.made.stop_lines:
            if lane.id not in stop.lanes:
                continue
            if stop.source == "object":
                line = shapely.LineString(stop.line[:, :2])
            else:
                _, _, station = stop.id.partition("@")
                low, high = float(lane.s_m.min()), float(lane.s_m.max())
                at_end = high if lane.s_m[-1] > lane.s_m[0] else low
                s_m = min(max(float(station) if station else at_end, low + 1e-4), high - 1e-4)
                waypoint = self._client.get_waypoint_xodr(lane.road_id, lane.lane, s_m)
                line = shapely.LineString(_sides(self._client, waypoint))
            shapes["stop_line"].append(_buffered(line, max(0.4, resolution_m)))


def _sides(client: carla.Map, waypoint: Any) -> list[list[float]]:
    """Left and right end of a lane at a waypoint, across its road.

    A waypoint looks along the middle of its lane, which is not the road's way where a lane gets
    wider. From one lane to the next, one goes straight across the road.
    """
    place, right = waypoint.transform.location, waypoint.transform.get_right_vector()
    across = np.array([right.x, right.y])
    own = waypoint.lane_id
    for other in (own - 1, own + 1):
        beside = other and client.get_waypoint_xodr(waypoint.road_id, other, waypoint.s)
        if beside and beside.section_id == waypoint.section_id:
            there = beside.transform.location
            step = np.array([there.x - place.x, there.y - place.y])
            if np.hypot(*step) > 0.5:
                across = step if step @ across > 0.0 else -step
                break
    half = across / np.hypot(*across) * waypoint.lane_width / 2.0
    middle = np.array([place.x, place.y])
    return [(middle - half).tolist(), (middle + half).tolist()]


def _quads(sides: NDArray[np.float64]) -> list[BaseGeometry]:
    rings = np.stack([sides[:-1, 0], sides[1:, 0], sides[1:, 1], sides[:-1, 1]], axis=1)
    return list(np.array(shapely.polygons(rings)))


def _add_markings(
    shapes: Shapes, line: NDArray[np.float64], marks: Sequence[Any], resolution_m: float
) -> None:
    begin = 0
    for here in range(1, len(marks) + 1):
        same = here < len(marks) and (marks[here].type, marks[here].width) == (
            marks[begin].type,
            marks[begin].width,
        )
        if same:
            continue
        part = line[begin : min(here + 1, len(line))]
        width_m = max(marks[begin].width or 0.12, resolution_m)
        for layer in _MARKING_LAYERS.get(str(marks[begin].type), ()):
            if len(part) > 1:
                shapes[layer].append(_buffered(shapely.LineString(part), width_m))
        begin = here


def _buffered(line: shapely.LineString, width_m: float) -> BaseGeometry:
    return line.buffer(width_m / 2.0, cap_style="flat", join_style="mitre")


def _rings(corners: Sequence[Any]) -> Iterator[shapely.Polygon]:
    ring: list[tuple[float, float]] = []
    for corner in corners:
        ring.append((corner.x, corner.y))
        if len(ring) > 2 and ring[0] == ring[-1]:
            yield shapely.Polygon(ring)
            ring = []


def _within(shapes: Sequence[BaseGeometry], centres: NDArray[Any], shape: tuple[int, ...]) -> Mask:
    """``(H, W)`` cells whose centres lie in one of the shapes."""
    inside = np.zeros(len(centres), np.bool_)
    if shapes:
        tree = shapely.STRtree(centres)
        shapely.prepare(shapes)
        inside[tree.query(shapes, predicate="intersects")[1]] = True
    return inside.reshape(shape[:2])


def _compare_objects(frame: Frame, stored: BirdsEye, counts: _Counts) -> None:
    centres = np.array(shapely.points(stored.world().reshape(-1, 2)))
    by_layer: Shapes = defaultdict(list)
    tops: list[tuple[float, int, BaseGeometry]] = []
    for row in _objects(frame):
        if row["box_center"] is None or row["class"] in ("traffic_light", "traffic_sign"):
            continue
        pitch, yaw, roll = row["box_rotation_deg"]
        pose = carla.Transform(carla.Location(*row["box_center"]), carla.Rotation(pitch, yaw, roll))
        box = carla.BoundingBox(carla.Location(), carla.Vector3D(*row["box_extent"]))
        corners = box.get_world_vertices(pose)
        hull = shapely.MultiPoint([(one.x, one.y) for one in corners]).convex_hull
        layer = "pedestrian" if row["class"].startswith("walker") else row["class"]
        by_layer["ego" if row["is_ego"] else layer].append(hull)
        tops.append((max(one.z for one in corners), row["track_id"], hull))
    shape = stored.drawn.instance.shape
    for layer, hulls in by_layer.items():
        counts.add(layer, stored.layer(layer), _within(hulls, centres, shape))
    expected = np.zeros(shape, np.int64)
    for _, track, hull in sorted(tops, key=lambda item: item[0]):
        expected[_within([hull], centres, shape)] = track
    either = (expected > 0) | (stored.tracks > 0)
    counts.both["instances"] += int((either & (expected == stored.tracks)).sum())
    counts.either["instances"] += int(either.sum())
