"""One frame in numbers: poses, objects, boxes, readings."""

from __future__ import annotations

import json
import math
import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from carstage.sensor_kinds import content_of, sensor_kind
from carstage.sensor_kinds.model import READING
from carstage.web.datasets.catalogue import Catalogue
from carstage.web.errors import not_found
from carstage.web.messages import CameraObject, EgoPose, FrameMessage, FrameObject

if TYPE_CHECKING:
    from carstage.dataset import EpisodeFrames, Frame
    from carstage.storage import CommitMarker

_MOST_EPISODES = 4
Row = Mapping[str, Any]


class FrameService:
    """Cuts episodes into frames; keeps the tables of the last few.

    Args:
        catalogue: finds the episodes.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._lock = threading.Lock()
        self._kept: OrderedDict[tuple[str, str], tuple[CommitMarker, EpisodeFrames]] = OrderedDict()

    def frame(self, dataset: str, episode_id: str, k: int) -> Frame:
        """A frame.

        Raises:
            WebError: there is none.
            DatasetError: a table is missing or damaged.
        """
        from carstage.dataset import EpisodeFrames

        episode = self._catalogue.episode(dataset, episode_id)
        if k >= episode.frames:
            raise not_found(f"frame {k} in episode {episode_id}")
        key = str(episode.folder), episode.marker.attempt
        with self._lock:
            marker, frames = self._kept.pop(key, (None, None))
            if frames is None or marker != episode.marker:  # removed and recorded again meanwhile
                frames = EpisodeFrames(episode)
            self._kept[key] = episode.marker, frames
            while len(self._kept) > _MOST_EPISODES:
                self._kept.popitem(last=False)
        return frames.frame(k)

    def message(self, dataset: str, episode_id: str, k: int) -> FrameMessage:
        """All of a frame but pictures and points.

        Raises:
            WebError: there is none.
            DatasetError: a table is missing or damaged.
        """
        frame = self.frame(dataset, episode_id, k)
        sensors = frame.episode.sensors
        return FrameMessage(
            k=k,
            timestamp_s=frame.timestamp_s,
            ego=_ego(frame),
            objects=[_object(row) for row in frame.objects.values() if row["box_center_ego"]],
            camera_objects={
                camera: _camera_objects(frame, camera, rows)
                for camera, rows in frame.camera_objects.items()
            },
            available=sorted(frame.available),
            states={s.id: "ok" if frame.has(s.id) else "missing" for s in sensors},
            readings={
                s.id: _reading(frame, s.id, s.kind)
                for s in sensors
                if content_of(s.kind) == READING and frame.has(s.id)
            },
        )


def _ego(frame: Frame) -> EgoPose | None:
    row = frame.ego
    if row is None:
        return None
    return EgoPose(
        location=list(row["location"]),
        rotation_deg=list(row["rotation_deg"]),
        speed_m_s=_finite(row["speed"]),
        throttle=_finite(row["throttle"]),
        steer=_finite(row["steer"]),
        brake=_finite(row["brake"]),
        weather=json.loads(row["weather"]) if row["weather"] else None,
    )


def _object(row: Row) -> FrameObject:
    from carstage.geometry import pose_matrix
    from carstage.report.drawing import class_colour

    points = row["num_lidar_points"]
    return FrameObject(
        track_id=row["track_id"],
        class_name=row["class"],
        type_id=row["blueprint"],
        ego_from_box=pose_matrix(row["box_center_ego"], row["box_rotation_ego_deg"]).tolist(),
        extent=list(row["box_extent"]),
        location=list(row["box_center"]),
        yaw_deg=row["box_rotation_deg"][1],
        speed_m_s=math.hypot(*row["velocity"]),
        num_lidar_points=sum(count for _, count in points) if points else None,
        colour=list(class_colour(row["class"])),
    )


def _camera_objects(frame: Frame, camera: str, rows: Sequence[Row]) -> list[CameraObject]:
    import numpy as np

    from carstage.geometry import pose_matrix
    from carstage.report.drawing import box_lines, class_colour

    calibration = frame.episode.sensor(camera).calibration_at(frame.k)
    found = []
    for row in rows:
        known = frame.object(row["track_id"])
        name = known["class"] if known else ""
        lines: list[list[float]] = []
        if known and known["box_center_ego"] and calibration.is_pinhole:
            pose = pose_matrix(known["box_center_ego"], known["box_rotation_ego_deg"])
            seen = box_lines(calibration, pose, np.array(known["box_extent"]))
            lines = [[round(value, 2) for end in line for value in end] for line in seen]
        found.append(
            CameraObject(
                track_id=row["track_id"],
                class_name=name,
                visible=bool(row["visible"]),
                bbox_amodal=row["bbox_amodal"],
                bbox_modal=row["bbox_modal"],
                occlusion_ratio=_finite(row["occlusion_ratio"]),
                truncated=_finite(row["truncated"]),
                distance_m=_finite(row["distance"]),
                has_mask=row["mask_modal"] is not None,
                lines=lines,
                colour=list(class_colour(name)),
                row={key: plain(value) for key, value in row.items() if key != "mask_modal"},
            )
        )
    return found


def _reading(frame: Frame, sensor: str, kind: str) -> dict[str, Any]:
    values = [float(value) for value in frame.read(sensor)]
    reading: dict[str, Any] = {}
    for column in sensor_kind(kind).columns:
        part, values = values[: column.count], values[column.count :]
        reading[column.name] = part if column.count > 1 else part[0]
    return reading


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def plain(value: Any) -> Any:
    """A cell as JSON can hold it."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple):
        return [plain(below) for below in value]
    return value
