"""Which objects of a frame are exported, and by which of their 2D boxes and occlusion levels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from carstage.dataset import Episode
from carstage.dataset.saved_frames import Frame, Row
from carstage.errors import BadInputError
from carstage.exporters.classes import RIDER
from carstage.exporters.options import ExportOptions
from carstage.exporters.riders import riders_by_vehicle, without_rider
from carstage.geometry import Rectangle


@dataclass(frozen=True, slots=True)
class CameraLabel:
    """One object in one picture.

    Attributes:
        name: its Car-STAGE class, one of ``CLASSES``.
        seen: its row of ``camera_objects.parquet``.
        object: its row of ``objects.parquet``.
        box: its 2D box x0, y0, x1, y1 (px, continuous, half open), inside the image.
    """

    name: str
    seen: Row
    object: Row
    box: Rectangle


def lidar_points(row: Row) -> int:
    """Points in the box of an object, over all LiDARs."""
    return sum(count for _, count in row["num_lidar_points"] or ())


def radar_points(row: Row) -> int:
    """Detections in the box of an object, over all radars; 0 where they were not counted."""
    return sum(count for _, count in row.get("num_radar_points") or ())


def boxed_objects(frame: Frame, options: ExportOptions) -> Iterator[Row]:
    """The rows of ``objects.parquet`` with a 3D box that the options keep, by track id.

    They choose by class, points and distance from the ego; whether a camera sees an object is
    another question.
    """
    wanted, most_m = options.chosen_classes, options.max_distance_m
    for _, row in sorted(frame.objects.items()):
        if (
            row["box_center"] is not None
            and row["class"] in wanted
            and (most_m is None or row["distance_ego"] <= most_m)
            and lidar_points(row) >= (options.min_lidar_points or 0)
        ):
            yield row


def camera_labels(frame: Frame, camera_id: str, options: ExportOptions) -> Iterator[CameraLabel]:
    """The objects of a picture that the options keep, by track id.

    The ego is one of them where the camera does not sit on it. An object without the wanted box (a
    modal one of which no pixel is seen) is left out. Riders have modal boxes alone. Where riders
    are exported, modal boxes and masks of two-wheelers are of the vehicle alone; otherwise they
    hold the rider too.
    """
    wanted = options.chosen_classes
    riders = riders_by_vehicle(frame, camera_id) if RIDER in wanted else {}
    for seen in sorted(frame.camera_objects.get(camera_id, ()), key=_track_id):
        row = frame.object(seen["track_id"])
        if row is None or row["class"] not in wanted or not _has_target(row, options):
            continue
        if seen["track_id"] in riders:
            size = frame.episode.sensor(camera_id).calibration
            seen = without_rider(seen, riders[seen["track_id"]], size.width, size.height)
        modal = options.boxes == "modal" or row["class"] == RIDER
        box = seen["bbox_modal" if modal else "bbox_amodal"]
        if (
            box is None
            or not (seen["visible"] or options.include_invisible)
            or (options.max_distance_m is not None and seen["distance"] > options.max_distance_m)
            or lidar_points(row) < (options.min_lidar_points or 0)
        ):
            continue
        x0, y0, x1, y1 = box
        yield CameraLabel(row["class"], seen, row, (x0, y0, x1, y1))


def occlusion_level(seen: Row, options: ExportOptions) -> int:
    """KITTI's occlusion: 0 visible, 1 partly, 2 largely occluded, 3 unknown."""
    return int(seen["occluded_px" if options.occlusion == "pixel" else "occluded"])


def require_labels(episode: Episode, options: ExportOptions, *boxes: str) -> None:
    """Refuse an episode that was recorded without labels that the export needs.

    Args:
        episode: the episode.
        options: modal boxes, and occlusion from pixels, need counted pixels.
        boxes: kinds of boxes that the format has.

    Raises:
        BadInputError: ``labels.boxes`` of its configuration lacks one of ``boxes``, or pixels are
            needed and ``labels.method`` was ``stage_vo``.
    """
    labels = episode.spec.labels
    for kind in boxes:
        if kind not in labels.boxes:
            raise BadInputError(
                f"Episode {episode.id} has no {kind} boxes.",
                f"Record with `labels: {{boxes: [{kind}]}}`, or choose another format.",
            )
    without = []
    if options.boxes == "modal":
        without.append("--boxes amodal")
    if options.occlusion == "pixel":
        without.append("--occlusion stage_vo")
    if without and not labels.pixels:
        raise BadInputError(
            f"The pixels of the objects of episode {episode.id} were not counted, so there are "
            "no modal boxes, masks and occlusion ratios.",
            f"Record with `labels: {{method: both}}`, or choose {' '.join(without)}.",
        )


def _has_target(row: Row, options: ExportOptions) -> bool:
    class_map = options.class_map
    return class_map is None or class_map.target(row["class"], row["blueprint"]) is not None


def _track_id(row: Row) -> Any:
    return row["track_id"]
