"""The checks of an episode's frames, in one pass over frames that follow each other."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.semantic_points import points_xyz
from carstage.dataset.ledger import recorded_frames, saved_times_s
from carstage.dataset.reading import Episode, Sensor
from carstage.geometry import invert_pose
from carstage.geometry.sweep_motion import SweepMotion
from carstage.sensor_kinds.columns import Instance
from carstage.sensor_kinds.model import CLOUDS, COLOUR, DEPTH, FLOW, INSTANCES, POINTS, ROWS, TAGS
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.birds_eye import BirdsEyeChecks
from carstage.validation.checks.colours import check_colours, is_clear_day, paints_of
from carstage.validation.checks.completeness import check_missing_rows
from carstage.validation.checks.decoding import DecodedFrame, decode, decoded_frames
from carstage.validation.checks.disparity import DisparityChecks
from carstage.validation.checks.documents import require_document, require_twins
from carstage.validation.checks.edges import (
    FrameFit,
    boundaries,
    check_edges,
    check_frame_fit,
    check_mirrored,
    check_windows,
    compare_edges,
    steepness,
)
from carstage.validation.checks.figures import FrameFigures
from carstage.validation.checks.files import Listing, VerifiedFiles
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.flash import check_beams, check_point_tags, is_comparable
from carstage.validation.checks.flow import check_flow, compare_with_motion
from carstage.validation.checks.labels import (
    LabelledBox,
    LabelTables,
    camera_rows,
    labelled_boxes,
)
from carstage.validation.checks.lane_lines import LaneLineChecks
from carstage.validation.checks.occluders import OccluderChecks
from carstage.validation.checks.occupancy import OccupancyChecks
from carstage.validation.checks.patches import PatchChecks
from carstage.validation.checks.pictures import check_exposure, check_repeats
from carstage.validation.checks.ranging import (
    check_intensity,
    check_point_counts,
    check_share,
    compare_with_depth,
)
from carstage.validation.checks.recomputing import entries
from carstage.validation.checks.silhouettes import check_silhouettes, visible_objects
from carstage.validation.checks.sweeps import SWEEPING, check_sweep
from carstage.validation.checks.table_schema import require_ledger
from carstage.validation.checks.tag_images import check_tags

SKY = next(number for number, tag in TAGS_0_9_14.items() if tag.name == "Sky")
_SAME_STEP = 0.01

Rows = Mapping[tuple[int, str], list[dict[str, Any]]]
Data = Mapping[str, NDArray[Any]]


class FrameChecks:
    """The checks of an episode's frames; any frames may be looked at, in any order.

    Args:
        episode: the episode.
        listing: what lies in its folder.
        threads: that read and decode.

    Raises:
        DatasetError: a document or table is missing or damaged, so that nothing can be said.
    """

    def __init__(self, episode: Episode, listing: Listing, threads: int) -> None:
        # Whatever is wrong with documents and tables is reported by others.
        self._findings = findings = Findings(episode.id, episode.agent_name)
        self._episode, self._threads = episode, threads
        self._figures = FrameFigures()
        self._files = VerifiedFiles(episode, listing, findings)
        require_document(episode)
        require_twins(episode)
        ledger = require_ledger(episode.ledger())
        self._recorded = {
            name: frozenset(frames)
            for name, frames in recorded_frames(episode.calibration.sensors, ledger).items()
        }
        tables = LabelTables.load(episode)
        tables.require_values(episode)
        self._paints = paints_of(episode.document["actors"])
        weathers = zip(entries(tables.ego, "k"), entries(tables.ego, "weather"), strict=True)
        self._clear = frozenset(k for k, text in weathers if is_clear_day(json.loads(text)))
        self._times_s = saved_times_s(ledger)
        self._poses = episode.world_from_sensor()
        self._carriers = episode.carriers()
        self._boxes = labelled_boxes(tables, findings)
        self._rows = camera_rows(tables.camera_objects)
        self._birds_eye = BirdsEyeChecks(episode, tables, self._files, findings)
        self._occupancy = OccupancyChecks(episode, tables, self._files, findings)
        self._occluders = OccluderChecks(episode, findings)
        self._lane_lines = LaneLineChecks(episode, findings)
        self._patches = PatchChecks(episode, findings)
        self._disparity = DisparityChecks(episode, self._files, findings)
        self._last: int | None = None
        self._edges_before: dict[str, tuple[NDArray[np.float32], NDArray[np.bool_]]] = {}
        self._flow_frames: dict[str, int] = {}
        findings.taken()

    def check(self, first: int, end: int, findings: Findings) -> FrameFigures:
        """Look at the frames from ``first`` to before ``end``.

        Args:
            first, end: the frames.
            findings: where problems go.

        Raises:
            DatasetError: a table is damaged.
        """
        self._figures = FrameFigures()
        self._files.files = self._files.bytes = 0
        last, self._last = self._last, None
        try:
            # Those after it are fetched meanwhile, for whoever looks at them.
            with self._files.fetched_ahead(range(first, end + (end - first))):
                if last != first - 1:
                    self._remember_frame(first - 1)
                wanted = [(k, self._with_files(k)) for k in range(first, end)]
                with closing(decoded_frames(self._files, wanted, self._threads)) as frames:
                    for k, decoded in frames:
                        self._check(k, decoded)
        finally:
            findings.include(self._findings.taken())
        self._last = end - 1
        self._figures.frames = end - first
        self._figures.files, self._figures.bytes = self._files.files, self._files.bytes
        return self._figures

    def _with_files(self, k: int) -> list[Sensor]:
        """Sensors that have files of that frame."""
        return [
            sensor
            for sensor in self._episode.sensors
            if sensor.content not in ROWS and k in self._recorded[sensor.id]
        ]

    def _check(self, k: int, decoded: Sequence[DecodedFrame]) -> None:
        data = {
            one.sensor.id: array for one in decoded if (array := self._accepted(one, k)) is not None
        }
        self._check_sensors(k, self._rows, self._boxes.get(k, []), data)
        recorded = frozenset(one.sensor.id for one in decoded)
        self._birds_eye.check(k, recorded, data)
        self._occupancy.check(k, recorded, data)
        self._occluders.check(k, self._rows, self._boxes.get(k, []), data)
        self._lane_lines.check(k, data)
        self._patches.check(k, data)
        self._disparity.check(k, data)

    def _remember_frame(self, k: int) -> None:
        """What the frame after that one is compared with; nothing is reported or counted."""
        self._edges_before, self._flow_frames = {}, {}
        if k < 0:
            return
        wanted = [s for s in self._with_files(k) if s.content in (COLOUR, FLOW, INSTANCES)]
        decoded = [decode(self._files, sensor, k) for sensor in wanted]
        data = {
            one.sensor.id: one.array
            for one in decoded
            if one.array is not None and _wrong_size(one.sensor, one.array) is None
        }
        for sensor in wanted:
            if sensor.id not in data:
                continue
            if sensor.content == FLOW:
                self._flow_frames[sensor.id] = k
            elif sensor.content == COLOUR and sensor.calibration.labelled:
                labels = self._labels(sensor, k, self._rows, data)
                self._edges_before[sensor.id] = steepness(data[sensor.id]), boundaries(labels)

    def _check_sensors(self, k: int, rows: Rows, boxes: list[LabelledBox], data: Data) -> None:
        self._check_silhouettes(k, rows, boxes, data)
        self._check_missing_rows(k, rows, boxes, data)
        self._check_ranging(k, boxes, data)
        self._check_tags(k, data)
        self._compare_flow(k, boxes, data)
        self._look_at_pictures(k, rows, data)

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
        problem = _wrong_size(sensor, array)
        if problem is not None:
            self._findings.add("image_size", problem, **where)
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
            self._figures.flow[sensor.id].add(
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
            self._figures.pictures[sensor.id].add_picture(k, data[sensor.id])
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
        camera, figures = sensor.calibration, self._figures.colours[sensor.id]
        figures.add_paint(data[sensor.id], rows.get((k, camera.id), []), self._paints)
        if k in self._clear and camera.instance is not None and camera.instance in data:
            figures.add_sky(data[sensor.id], data[camera.instance][..., Instance.TAG] == SKY)

    def _compare_edges(
        self, sensor: Sensor, k: int, rgb: NDArray[np.uint8], labels: NDArray[np.generic]
    ) -> None:
        steep, boundary = steepness(rgb), boundaries(labels)
        check_mirrored(sensor.id, k, steep, boundary, self._findings)
        found = compare_edges(rgb, steep, boundary)
        self._figures.edges[sensor.id].add(found)
        fits = self._figures.fits[sensor.id]
        if sensor.id in self._edges_before:
            steep_before, boundary_before = self._edges_before[sensor.id]
            before = FrameFit()
            before.add_image(steep, boundary, boundary_before)
            fits[-1].add(before)
            self._figures.late[sensor.id].append((k, before))
            fits[1].add_image(steep_before, boundary_before, boundary)
        self._edges_before[sensor.id] = steep, boundary


def _wrong_size(sensor: Sensor, array: NDArray[Any]) -> str | None:
    """What is wrong with the size of an image."""
    camera = sensor.calibration
    if camera.is_camera and array.shape[:2] != (camera.height, camera.width):
        return (
            f"the image has {array.shape[1]}x{array.shape[0]} pixels, "
            f"not {camera.width}x{camera.height}"
        )
    return None


def conclude(episode: Episode, figures: FrameFigures, findings: Findings) -> list[str]:
    """Report what only all frames of an episode together tell.

    Args:
        episode: the episode.
        figures: of all its frames.
        findings: where problems go.

    Returns:
        What cannot be decided.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    undecided = []
    for (lidar, camera), pair in figures.pairs.items():
        check_share(pair, lidar, camera, findings)
    for camera, edges in figures.edges.items():
        check_edges(camera, edges, findings)
        check_frame_fit(camera, figures.fits[camera], findings)
        check_windows(camera, figures.late[camera], findings)
        if not check_colours(camera, figures.colours[camera], findings):
            undecided.append(f"colour_order of {camera} ({episode.id})")
    for camera, flow in figures.flow.items():
        check_flow(camera, flow, findings)
    for camera, pictures in figures.pictures.items():
        check_exposure(camera, pictures, findings)
    flat = {camera: pictures.flat for camera, pictures in figures.pictures.items()}
    check_repeats(episode, episode.world_from_sensor(), flat, findings)
    return undecided
