"""All checks of one episode, in one pass over its frames."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.semantic_points import points_xyz
from carstage.dataset.ledger import recorded_frames, saved_times_s
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.tracks import may_come_back
from carstage.geometry import invert_pose
from carstage.geometry.sweep_motion import SweepMotion
from carstage.sensor_kinds.columns import Instance
from carstage.sensor_kinds.model import CLOUDS, COLOUR, DEPTH, FLOW, INSTANCES, POINTS, ROWS, TAGS
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.birds_eye import BirdsEyeChecks
from carstage.validation.checks.colours import (
    ColourFigures,
    Paint,
    check_colours,
    is_clear_day,
    paints_of,
)
from carstage.validation.checks.columns import (
    check_camera_columns,
    check_ego_columns,
    check_object_columns,
)
from carstage.validation.checks.completeness import check_gaps, check_missing_rows
from carstage.validation.checks.controls import check_controls
from carstage.validation.checks.decoding import DecodedFrame, decoded_frames
from carstage.validation.checks.disparity import DisparityChecks
from carstage.validation.checks.edges import (
    EdgeFigures,
    FrameFit,
    boundaries,
    check_edges,
    check_frame_fit,
    check_mirrored,
    check_windows,
    compare_edges,
    new_fits,
    steepness,
)
from carstage.validation.checks.events import check_events
from carstage.validation.checks.files import (
    DOCUMENTS,
    VerifiedFiles,
    check_file_list,
    tables_of,
)
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.flash import check_beams, check_point_tags, is_comparable
from carstage.validation.checks.flow import FlowFigures, check_flow, compare_with_motion
from carstage.validation.checks.labels import (
    LabelledBox,
    LabelTables,
    camera_rows,
    check_labels,
    labelled_boxes,
)
from carstage.validation.checks.lane_lines import LaneLineChecks
from carstage.validation.checks.ledger import (
    check_ledger,
    check_row_sensors,
)
from carstage.validation.checks.level import check_level_boxes
from carstage.validation.checks.motion import MotionFigures, check_motion, compare_motion
from carstage.validation.checks.occupancy import OccupancyChecks
from carstage.validation.checks.patch_pairs import PairFigures
from carstage.validation.checks.patches import PatchChecks
from carstage.validation.checks.pictures import PictureFigures, check_exposure, check_repeats
from carstage.validation.checks.population import Population, check_episode_population
from carstage.validation.checks.radars import check_cross_sections
from carstage.validation.checks.ranging import (
    RangingFigures,
    check_intensity,
    check_point_counts,
    check_share,
    compare_with_depth,
)
from carstage.validation.checks.readings import check_readings, check_sensor_poses
from carstage.validation.checks.recomputing import entries
from carstage.validation.checks.server import check_self_test
from carstage.validation.checks.silhouettes import (
    SilhouetteFigures,
    check_silhouettes,
    visible_objects,
)
from carstage.validation.checks.sweeps import SWEEPING, check_sweep
from carstage.validation.checks.tag_images import check_tags
from carstage.validation.checks.tracks import check_tracks
from carstage.validation.checks.variants import VariantFigures

SKY = next(number for number, tag in TAGS_0_9_14.items() if tag.name == "Sky")
_SAME_STEP = 0.01

Rows = Mapping[tuple[int, str], list[dict[str, Any]]]
Data = Mapping[str, NDArray[Any]]


@dataclass(slots=True)
class Figures:
    """What was measured over all episodes so far."""

    frames: int = 0
    files: int = 0
    bytes: int = 0
    points_in_boxes: int = 0
    hull: SilhouetteFigures = field(default_factory=SilhouetteFigures)
    pairs: dict[tuple[str, str], RangingFigures] = field(
        default_factory=lambda: defaultdict(RangingFigures)
    )
    edges: dict[str, EdgeFigures] = field(default_factory=lambda: defaultdict(EdgeFigures))
    fits: dict[str, dict[int, FrameFit]] = field(default_factory=dict)
    flow: dict[str, FlowFigures] = field(default_factory=lambda: defaultdict(FlowFigures))
    motion: MotionFigures = field(default_factory=MotionFigures)
    pictures: dict[str, PictureFigures] = field(default_factory=lambda: defaultdict(PictureFigures))
    population: Population = field(default_factory=Population.empty)
    variants: VariantFigures = field(default_factory=VariantFigures)
    patch_pairs: PairFigures = field(default_factory=PairFigures)
    not_decidable: list[str] = field(default_factory=list)

    def to_dict(self, episodes: int) -> dict[str, Any]:
        """For the report."""
        return {
            "episodes": episodes,
            "frames": self.frames,
            "files": self.files,
            "bytes": self.bytes,
            "hull": self.hull.to_dict(),
            "lidar_depth": {
                f"{lidar} / {camera}": pair.to_dict()
                for (lidar, camera), pair in sorted(self.pairs.items())
            },
            "lidar_points_in_boxes": self.points_in_boxes,
            "rgb_edges": {
                camera: None if edges.ratio is None else round(edges.ratio, 3)
                for camera, edges in sorted(self.edges.items())
            },
            "rgb_frame": {
                camera: {str(step): fit.rounded for step, fit in sorted(fits.items())}
                for camera, fits in sorted(self.fits.items())
            },
            "flow": {camera: flow.to_dict() for camera, flow in sorted(self.flow.items())},
            "motion": self.motion.to_dict(),
            "pictures": {camera: p.to_dict() for camera, p in sorted(self.pictures.items())},
            "labels": self.population.to_dict(),
            "variants": self.variants.to_dict(),
            "patch_pairs": self.patch_pairs.to_dict(),
            "not_decidable": self.not_decidable,
        }


class EpisodeChecks:
    """The checks of one episode.

    Args:
        episode: the episode.
        findings: where its problems go.
        figures: of the dataset, added to.
    """

    def __init__(self, episode: Episode, findings: Findings, figures: Figures) -> None:
        self._episode = episode
        self._findings = findings
        self._figures = figures
        self._files = VerifiedFiles(episode, findings)
        self._pairs: dict[tuple[str, str], RangingFigures] = defaultdict(RangingFigures)
        self._edges: dict[str, EdgeFigures] = defaultdict(EdgeFigures)
        self._fits: dict[str, dict[int, FrameFit]] = {}
        self._edges_before: dict[str, tuple[NDArray[np.float32], NDArray[np.bool_]]] = {}
        self._late: dict[str, list[tuple[int, FrameFit]]] = defaultdict(list)
        self._colours: dict[str, ColourFigures] = defaultdict(ColourFigures)
        self._paints: Mapping[int, Paint] = {}
        self._clear: frozenset[int] = frozenset()
        self._flow: dict[str, FlowFigures] = defaultdict(FlowFigures)
        self._flow_frames: dict[str, int] = {}
        self._pictures: dict[str, PictureFigures] = defaultdict(PictureFigures)
        self._carriers: dict[str, int | None] = {}
        self._poses: Mapping[str, Mapping[int, NDArray[np.float64]]] = {}
        self._times_s: Mapping[int, float] = {}

    def run(self, advance: Callable[[], None]) -> None:
        """Run them; ``advance`` is called after each frame.

        Raises:
            DatasetError: a document or table is missing or damaged, so that nothing can be said.
        """
        self._files.find_all()
        with self._files.fetched_ahead():
            self._run(advance)

    def _run(self, advance: Callable[[], None]) -> None:
        episode, findings = self._episode, self._findings
        for name in DOCUMENTS:
            self._files.read(name)
        for name in tables_of(episode):
            self._files.read(name)
        ledger = episode.ledger()
        recorded = recorded_frames(episode.calibration.sensors, ledger)
        check_file_list(episode, recorded, findings)
        check_ledger(episode, ledger, findings)
        for sensor in episode.sensors:
            if sensor.content in ROWS:
                self._files.read(sensor.file_names(0)[0], sensor=sensor.id)
        check_row_sensors(episode, ledger, recorded, findings)
        check_self_test(episode, findings)
        tables = LabelTables.load(episode)
        self._paints = paints_of(episode.document["actors"])
        weathers = zip(entries(tables.ego, "k"), entries(tables.ego, "weather"), strict=True)
        self._clear = frozenset(k for k, text in weathers if is_clear_day(json.loads(text)))
        times_s = self._times_s = saved_times_s(ledger)
        check_labels(episode, tables, times_s, findings)
        check_ego_columns(episode, tables, findings)
        check_object_columns(episode, tables, findings)
        check_camera_columns(episode, tables, findings)
        check_tracks(episode, tables, findings)
        check_sensor_poses(episode, tables, findings)
        check_readings(episode, tables, findings)
        check_cross_sections(episode, findings)
        check_events(episode, ledger, tables, findings)
        check_controls(episode, ledger, tables, findings)
        self._poses = episode.world_from_sensor()
        self._carriers = episode.carriers()
        self._check_tables(tables)
        boxes = labelled_boxes(tables, findings)
        rows = camera_rows(tables.camera_objects)
        available = {sensor: set(frames) for sensor, frames in recorded.items()}
        birds_eye = BirdsEyeChecks(episode, tables, self._files, findings)
        occupancy = OccupancyChecks(episode, tables, self._files, findings)
        lane_lines = LaneLineChecks(episode, findings)
        patches = PatchChecks(episode, findings)
        disparity = DisparityChecks(episode, self._files, findings)
        with_files = [
            [s for s in episode.sensors if s.content not in ROWS and k in available[s.id]]
            for k in range(episode.frames)
        ]
        with closing(decoded_frames(self._files, with_files)) as frames:
            for k, decoded in enumerate(frames):
                data = {
                    one.sensor.id: array
                    for one in decoded
                    if (array := self._accepted(one, k)) is not None
                }
                self._check_frame(k, rows, boxes.get(k, []), data)
                recorded_now = frozenset(one.sensor.id for one in decoded)
                birds_eye.check(k, recorded_now, data)
                occupancy.check(k, recorded_now, data)
                lane_lines.check(k, data)
                patches.check(k, data)
                disparity.check(k, data)
                self._figures.frames += 1
                advance()
        self._conclude()

    def _check_tables(self, tables: LabelTables) -> None:
        truth = self._episode.spec.ground_truth
        check_gaps(
            tables.objects,
            self._episode.frames,
            ego_labelled=truth.vehicles and self._episode.spec.ego.is_vehicle,
            findings=self._findings,
        )
        for name, table, location in (
            (
                "objects.parquet",
                tables.objects.filter(~may_come_back(tables.objects)),
                "actor_location",
            ),
            ("ego.parquet", tables.ego, "location"),
        ):
            found = compare_motion(table, location)
            check_motion(name, found, self._findings)
            self._figures.motion.add(found)
        check_level_boxes(tables, self._findings)
        of_ego = self._episode.agent_name is None
        population = self._figures.population if of_ego else Population.empty()
        check_episode_population(self._episode, tables, population, self._findings)

    def _check_frame(self, k: int, rows: Rows, boxes: list[LabelledBox], data: Data) -> None:
        self._check_silhouettes(k, rows, boxes, data)
        self._check_missing_rows(k, rows, boxes, data)
        self._check_ranging(k, boxes, data)
        self._check_tags(k, data)
        self._compare_flow(k, boxes, data)
        self._look_at_pictures(k, rows, data)

    def _conclude(self) -> None:
        findings, figures = self._findings, self._figures
        for (lidar, camera), pair in self._pairs.items():
            check_share(pair, lidar, camera, findings)
        for camera, edges in self._edges.items():
            check_edges(camera, edges, findings)
            check_frame_fit(camera, self._fits[camera], findings)
            check_windows(camera, self._late[camera], findings)
            if not check_colours(camera, self._colours[camera], findings):
                figures.not_decidable.append(f"colour_order of {camera} ({self._episode.id})")
            totals = figures.fits.setdefault(camera, new_fits())
            for step, fit in self._fits[camera].items():
                totals[step].add(fit)
        for camera, flow in self._flow.items():
            check_flow(camera, flow, findings)
            figures.flow[camera].add(flow)
        for camera, pictures in self._pictures.items():
            check_exposure(camera, pictures, findings)
            figures.pictures[camera].add(pictures)
        flat = {camera: pictures.flat for camera, pictures in self._pictures.items()}
        check_repeats(self._episode, self._poses, flat, findings)
        figures.files += self._files.files
        figures.bytes += self._files.bytes

    def _accepted(self, decoded: DecodedFrame, k: int) -> NDArray[Any] | None:
        """The array, if it is as it should be; else the reason is reported."""
        sensor, array = decoded.sensor, decoded.array
        where: dict[str, Any] = {"frame": k, "sensor": sensor.id}
        for found in decoded.files:
            self._files.accept(found, **where)
        if decoded.damage is not None:
            self._findings.add("decode", f"the frame does not decode: {decoded.damage}", **where)
        if array is None:
            return None
        camera = sensor.calibration
        if camera.is_camera and array.shape[:2] != (camera.height, camera.width):
            self._findings.add(
                "image_size",
                f"the image has {array.shape[1]}x{array.shape[0]} pixels, "
                f"not {camera.width}x{camera.height}",
                **where,
            )
            return None
        return array

    def _check_silhouettes(self, k: int, rows: Rows, boxes: list[LabelledBox], data: Data) -> None:
        for sensor in self._episode.sensors:
            if sensor.calibration.labelled:
                camera = sensor.calibration_at(k)
                instance = data.get(camera.instance) if camera.instance else None
                check_silhouettes(
                    camera,
                    k,
                    rows.get((k, camera.id), []),
                    boxes,
                    instance,
                    self._figures.hull,
                    self._findings,
                )

    def _check_missing_rows(self, k: int, rows: Rows, boxes: list[LabelledBox], data: Data) -> None:
        spec = self._episode.spec
        for sensor in self._episode.sensors:
            camera = sensor.calibration
            if not (camera.labelled and camera.is_projective and sensor.id in data):
                continue
            check_missing_rows(
                sensor.calibration_at(k),
                k,
                boxes,
                {row["track_id"] for row in rows.get((k, camera.id), [])},
                spec.max_distance_m,
                carrier=self._carriers.get(camera.id) if camera.attachment == "rigid" else None,
                from_ego=spec.labels.distance_origin == "ego",
                # The depth image that labels are made from may be missing as well.
                severity="error" if spec.timing.demands_all else "warning",
                findings=self._findings,
            )

    def _check_ranging(self, k: int, boxes: list[LabelledBox], data: Data) -> None:
        sensors = [sensor for sensor in self._episode.sensors if sensor.id in data]
        for lidar in (sensor for sensor in sensors if sensor.content in CLOUDS):
            points = points_xyz(data[lidar.id])
            if lidar.content == POINTS:
                check_intensity(data[lidar.id], lidar.id, k, self._findings)
                check_beams(points, lidar.calibration, k, self._findings)
                check_point_tags(data[lidar.id], lidar.calibration, k, self._findings)
                self._check_sweep(lidar, k, data[lidar.id])
                self._figures.points_in_boxes += check_point_counts(
                    points, lidar.calibration_at(k), k, boxes, self._findings
                )
            for camera in (sensor for sensor in sensors if sensor.content == DEPTH):
                if not is_comparable(lidar.calibration):
                    continue
                found = compare_with_depth(
                    points, lidar.calibration_at(k), data[camera.id], camera.calibration_at(k)
                )
                check_share(found, lidar.id, camera.id, self._findings, frame=k)
                self._pairs[lidar.id, camera.id].add(found)
                self._figures.pairs[lidar.id, camera.id].add(found)

    def _check_sweep(self, lidar: Sensor, k: int, points: NDArray[Any]) -> None:
        if lidar.kind != SWEEPING:
            return
        poses = self._poses.get(lidar.id, {})
        motion = None
        if "sensor_tick" not in lidar.calibration.attributes and {k - 1, k} <= set(poses):
            step_s, times_s = self._episode.spec.step_s, self._times_s
            since_s = times_s.get(k, np.inf) - times_s.get(k - 1, 0.0)
            if abs(since_s - step_s) < _SAME_STEP * step_s:  # else ticks between are not saved
                motion = SweepMotion.between(poses[k - 1], poses[k], step_s)
        check_sweep(points, lidar.calibration, motion, k, self._findings)

    def _twin(self, sensor: Sensor, content: str, data: Data) -> Sensor | None:
        """A sensor of that content that looks along the same rays and has data."""
        for other in self._episode.sensors:
            fits = other.content == content and other.calibration.shares_view(sensor.calibration)
            if fits and other.id in data:
                return other
        return None

    def _check_tags(self, k: int, data: Data) -> None:
        for sensor in self._episode.sensors:
            if sensor.content != TAGS or sensor.id not in data:
                continue
            instance = self._twin(sensor, INSTANCES, data)
            if instance is not None:
                check_tags(
                    data[sensor.id],
                    data[instance.id],
                    frame=k,
                    semantic_id=sensor.id,
                    instance_id=instance.id,
                    findings=self._findings,
                )

    def _compare_flow(self, k: int, boxes: list[LabelledBox], data: Data) -> None:
        if self._episode.spec.save_every != 1:
            return  # the pose at the step before is not in the dataset
        for sensor in self._episode.sensors:
            if sensor.content != FLOW or sensor.id not in data:
                continue
            follows = self._flow_frames.get(sensor.id) == k - 1  # it looks back to its last image
            self._flow_frames[sensor.id] = k
            poses = self._poses.get(sensor.id, {})
            moving = [box for box in boxes if not box.is_static]
            depth = self._twin(sensor, DEPTH, data)
            if not follows or depth is None or not {k - 1, k} <= set(poses):
                continue
            self._flow[sensor.id].add(
                compare_with_motion(
                    data[sensor.id],
                    data[depth.id],
                    sensor.calibration_at(k),
                    invert_pose(poses[k - 1]) @ poses[k],
                    moving,
                )
            )

    def _look_at_pictures(self, k: int, rows: Rows, data: Data) -> None:
        for sensor in self._episode.sensors:
            if sensor.content != COLOUR:
                continue
            if sensor.id not in data:
                self._edges_before.pop(sensor.id, None)
                continue
            self._pictures[sensor.id].add_picture(k, data[sensor.id])
            if sensor.calibration.labelled:
                labels = self._labels(sensor, k, rows, data)
                self._compare_edges(sensor, k, data[sensor.id], labels)
                self._look_at_colours(sensor, k, rows, data)

    def _labels(self, sensor: Sensor, k: int, rows: Rows, data: Data) -> NDArray[np.generic]:
        """``(H, W)`` numbers that differ between things, by ids and tags or by masks."""
        camera = sensor.calibration
        if camera.instance is not None and camera.instance in data:
            both = np.ascontiguousarray(data[camera.instance])  # id and tag, read as one number
            labels: NDArray[np.generic] = both.view(np.uint32)[..., 0]
            return labels
        return visible_objects(camera, rows.get((k, camera.id), []))

    def _look_at_colours(self, sensor: Sensor, k: int, rows: Rows, data: Data) -> None:
        camera, figures = sensor.calibration, self._colours[sensor.id]
        figures.add_paint(data[sensor.id], rows.get((k, camera.id), []), self._paints)
        if k in self._clear and camera.instance is not None and camera.instance in data:
            figures.add_sky(data[sensor.id], data[camera.instance][..., Instance.TAG] == SKY)

    def _compare_edges(
        self, sensor: Sensor, k: int, rgb: NDArray[np.uint8], labels: NDArray[np.generic]
    ) -> None:
        steep, boundary = steepness(rgb), boundaries(labels)
        check_mirrored(sensor.id, k, steep, boundary, self._findings)
        found = compare_edges(rgb, steep, boundary)
        self._edges[sensor.id].add(found)
        self._figures.edges[sensor.id].add(found)
        fits = self._fits.setdefault(sensor.id, new_fits())
        if sensor.id in self._edges_before:
            steep_before, boundary_before = self._edges_before[sensor.id]
            before = FrameFit()
            before.add_image(steep, boundary, boundary_before)
            fits[-1].add(before)
            self._late[sensor.id].append((k, before))
            fits[1].add_image(steep_before, boundary_before, boundary)
        self._edges_before[sensor.id] = steep, boundary
