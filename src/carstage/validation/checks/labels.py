"""The label tables: columns, ranges, keys; and the boxes that the geometric checks use."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from carstage.annotation.schema import LANE_LINES, PATCHES, SENSOR_POSE_COLUMNS, TABLES
from carstage.dataset.reading import Episode
from carstage.dataset.tables import require_columns
from carstage.errors import DatasetError
from carstage.geometry import invert_pose, length, multiply, pose_matrix
from carstage.sensor_kinds.model import DETECTIONS, POINTS
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.ledger import TIMESTAMP_TOLERANCE_S
from carstage.validation.checks.recomputing import numbers, rows_at
from carstage.validation.checks.table_schema import require_schema, require_values

_PI = math.pi
_RANGES: dict[str, dict[str, tuple[float, float]]] = {
    "objects": {
        "visibility": (0.0, 1.0),
        "visibility_token": (1, 4),
        "distance_ego": (0.0, math.inf),
        "box_yaw_ego": (-_PI, _PI),
    },
    "camera_objects": {
        "rotation_y": (-_PI, _PI),
        "alpha": (-_PI, _PI),
        "distance": (0.0, math.inf),
        "occluded": (0, 3),
        "occluded_px": (0, 3),
        "truncated": (0.0, 1.0),
        "truncation_paper": (0.0, 1.0),
        "occlusion_ratio": (0.0, 1.0),
        "n_visible": (0, 8),
        "n_occluded": (0, 8),
        "n_outside": (0, 8),
        "n_behind": (0, 8),
    },
    "ego": {
        "throttle": (0.0, 1.0),
        "brake": (0.0, 1.0),
        "steer": (-1.0, 1.0),
        "latitude_deg": (-90.0, 90.0),
        "longitude_deg": (-180.0, 180.0),
    },
}
_LIGHT_STATES = frozenset({"Red", "Yellow", "Green", "Off", "Unknown"})
_BOX_SOURCES = frozenset({"actor", "capsule", "mesh", "measured", "level", "invalid", "none"})
_VALUES: dict[str, dict[str, frozenset[str]]] = {
    "objects": {"box_source": _BOX_SOURCES, "traffic_light_state": _LIGHT_STATES},
    "camera_objects": {},
    "ego": {"traffic_light_state": _LIGHT_STATES},
}
_KEYS = {
    "objects": ("k", "track_id"),
    "camera_objects": ("k", "sensor_id", "track_id"),
    "ego": ("k",),
}
_BOX_ROW_COLUMNS = (
    "k", "track_id", "semantic_tags", "num_lidar_points", "num_radar_points", "is_ego",
    "is_static", "box_source",
)  # fmt: skip
_BOX_COLUMNS = (
    "box_center", "box_rotation_deg", "box_extent", "box_center_ego", "box_rotation_ego_deg",
)  # fmt: skip
_CAMERA_COLUMNS = (
    "k", "sensor_id", "track_id", "bbox_amodal", "bbox_modal", "mask_modal", "visible_px",
    "pinhole", "instance_ambiguous", "front_px", "hull_px", "bbox_amodal_unclipped", "truncated",
    "crosses_near", "n_visible", "n_occluded", "n_outside", "n_behind",
)  # fmt: skip
_EGO_COLUMNS = ("k", "location", "rotation_deg")
_POSE_TOLERANCE_M = 0.01


@dataclass(frozen=True)
class LabelTables:
    """The three label tables of an episode."""

    objects: pa.Table
    camera_objects: pa.Table
    ego: pa.Table

    @classmethod
    def load(cls, episode: Episode) -> LabelTables:
        """Read them.

        Raises:
            DatasetError: one is missing, damaged, or lacks a column or holds something else there.
        """
        tables = cls(episode.objects(), episode.camera_objects(), episode.ego())
        for name, table in tables.named().items():
            require_schema(table, TABLES[f"{name}.parquet"], f"{name}.parquet")
        require_schema(episode.sensor_poses(), SENSOR_POSE_COLUMNS, "sensor_poses.parquet")
        return tables

    def require_values(self, episode: Episode) -> None:
        """Refuse tables, and that of poses, that lack a value where none may be missing.

        An object has all columns of a box, or none.

        Raises:
            DatasetError: names the first table and column; the check of nulls names all.
        """
        for name, table in self.named().items():
            require_values(table, TABLES[f"{name}.parquet"], f"{name}.parquet")
        require_values(episode.sensor_poses(), SENSOR_POSE_COLUMNS, "sensor_poses.parquet")
        boxed = self.objects["box_center"].is_valid()
        for name in _BOX_COLUMNS:
            if self.objects[name].is_valid() != boxed:
                raise DatasetError(f"objects.parquet: {name} is not given where box_center is.")

    @cached_property
    def world_from_ego(self) -> dict[int, NDArray[np.float64]]:
        """``(4, 4)`` pose of the ego's pivot by frame."""
        return {
            row["k"]: pose_matrix(row["location"], row["rotation_deg"])
            for row in self.ego.select(_EGO_COLUMNS).to_pylist()
        }

    def named(self) -> dict[str, pa.Table]:
        """The tables by name, without the file's ending."""
        return {"objects": self.objects, "camera_objects": self.camera_objects, "ego": self.ego}


@dataclass(frozen=True, slots=True)
class LabelledBox:
    """One object's box in one frame.

    Attributes:
        track_id: actor id.
        ego_from_box: ``(4, 4)`` pose in the ego actor's frame.
        extent: ``(3,)`` half sizes (m).
        tags: the actor's semantic tags.
        points: labelled number of points by LiDAR and by radar.
        is_ego: whether it is the vehicle that carries the sensors.
        is_static: whether it is part of the level, so that no pixel tells its id.
        is_capsule: whether it is a walker's capsule, which arms and legs leave.
    """

    track_id: int
    ego_from_box: NDArray[np.float64]
    extent: NDArray[np.float64]
    tags: frozenset[int]
    points: dict[str, int]
    is_ego: bool
    is_static: bool = False
    is_capsule: bool = False


def check_labels(
    episode: Episode, tables: LabelTables, times_s: dict[int, float], findings: Findings
) -> None:
    """Check keys, timestamps, ranges and references of the label tables.

    Args:
        episode: the episode.
        tables: its label tables.
        times_s: time of each saved frame, from the ledger.
        findings: checks ``label_keys``, ``label_timestamps``, ``label_ranges``,
            ``label_references``, ``frames_missing``.
    """
    for name, table in tables.named().items():
        keys = list(zip(*(table[key].to_pylist() for key in _KEYS[name]), strict=True))
        if len(set(keys)) != len(keys):
            findings.add("label_keys", f"{name}.parquet has rows with the same key")
        row_ks: list[Any] = table["k"].to_pylist()
        row_times: list[Any] = table["timestamp_s"].to_pylist()
        for k, time_s in zip(row_ks, row_times, strict=True):
            if k not in times_s or abs(times_s[k] - time_s) > TIMESTAMP_TOLERANCE_S:
                findings.add(
                    "label_timestamps",
                    f"{name}.parquet: a row says {time_s} s, the ledger {times_s.get(k)} s",
                    frame=k,
                )
        for column, (low, high) in _RANGES[name].items():
            _check_range(name, table, column, low, high, findings)
        for column, values in _VALUES[name].items():
            _check_values(name, table, column, values, findings)
    _check_frames(episode, times_s, findings)
    ego_ks: list[Any] = tables.ego["k"].to_pylist()
    if episode.spec.ground_truth.ego_motion and sorted(ego_ks) != sorted(times_s):
        findings.add("frames_missing", "ego.parquet does not have one row per frame")
    known = set(zip(*(tables.objects[c].to_pylist() for c in ("k", "track_id")), strict=True))
    labelled = {s.id for s in episode.sensors if s.calibration.labelled}
    for k, sensor, track in zip(
        *(tables.camera_objects[c].to_pylist() for c in ("k", "sensor_id", "track_id")), strict=True
    ):
        if (k, track) not in known or sensor not in labelled:
            findings.add(
                "label_references",
                f"camera_objects.parquet speaks of object {track}, "
                "which objects.parquet or the rig does not know",
                frame=k,
                sensor=sensor,
            )
    for column, content in (("num_lidar_points", POINTS), ("num_radar_points", DETECTIONS)):
        _check_counters(episode, tables.objects, column, content, findings)
    boxed = tables.camera_objects.filter(pc.is_valid(tables.camera_objects["n_visible"]))
    counts = [pc.cast(boxed[f"n_{c}"], pa.int32())
              for c in ("visible", "occluded", "outside", "behind")]  # fmt: skip
    total = np.sum([count.to_numpy() for count in counts], axis=0)
    if len(total) and not (total == 8).all():
        findings.add("label_ranges", "camera_objects.parquet: vertices do not add up to 8")


def _check_frames(episode: Episode, times_s: dict[int, float], findings: Findings) -> None:
    """Tables that other checks read frame by frame have no rows of frames that there are not."""
    others = {
        "sensor_poses.parquet": episode.sensor_poses(),
        LANE_LINES: episode.lane_lines(),
        PATCHES: episode.patches(),
    }
    for file, table in others.items():
        if table is None:
            continue
        require_columns(table, ("k",), file)
        ks: list[Any] = table["k"].drop_null().unique().to_pylist()
        for k in sorted(set(ks) - times_s.keys()):
            findings.add(
                "label_timestamps", f"{file} has rows of frame {k}, which the ledger has not"
            )


def _check_counters(
    episode: Episode, objects: pa.Table, column: str, content: str, findings: Findings
) -> None:
    counting = {sensor.id for sensor in episode.sensors if sensor.content == content}
    for k, counts in zip(objects["k"].to_pylist(), objects[column].to_pylist(), strict=True):
        for unknown in sorted({name for name, _ in counts or ()} - counting):
            findings.add(
                "label_references",
                f"objects.parquet: {column} counts for {unknown}, which the rig does not have",
                frame=k,
            )


def _check_range(
    name: str, table: pa.Table, column: str, low: float, high: float, findings: Findings
) -> None:
    values = table[column].drop_null().to_numpy()
    wrong = ~((values >= low) & (values <= high))
    if wrong.any():
        findings.add(
            "label_ranges",
            f"{name}.parquet: {column} is {values[wrong][0]} in one of {wrong.sum()} rows, "
            f"outside {low:g} to {high:g}",
        )


def _check_values(
    name: str, table: pa.Table, column: str, values: frozenset[str], findings: Findings
) -> None:
    found = zip(table["k"].to_pylist(), table[column].to_pylist(), strict=True)
    wrong = [(k, value) for k, value in found if value is not None and value not in values]
    if wrong:
        k, value = wrong[0]
        findings.add(
            "label_ranges",
            f"{name}.parquet: {column} is {value!r}, which does not exist, in {len(wrong)} rows",
            frame=k,
        )


def labelled_boxes(tables: LabelTables, findings: Findings) -> dict[int, list[LabelledBox]]:
    """The objects with a valid 3D box, by frame.

    The pose comes from the world columns and the ego's pose; where ego motion was not asked for,
    from the columns in the ego's frame. If there are both they must agree within 1 cm (check
    ``label_poses``).
    """
    world_from_ego = tables.world_from_ego
    boxes: dict[int, list[LabelledBox]] = defaultdict(list)
    boxed = tables.objects.filter(pc.is_valid(tables.objects["box_center"]))
    poses = pose_matrix(
        numbers(boxed, "box_center_ego", 3), numbers(boxed, "box_rotation_ego_deg", 3)
    )
    extents = numbers(boxed, "box_extent", 3)
    ks = boxed["k"].to_numpy()
    placed = np.flatnonzero(np.isin(ks, list(world_from_ego)))
    if len(placed):
        world_from_box = pose_matrix(
            numbers(boxed, "box_center", 3)[placed], numbers(boxed, "box_rotation_deg", 3)[placed]
        )
        frames, of_row = np.unique(ks[placed], return_inverse=True)
        ego_from_world = invert_pose(np.stack([world_from_ego[k] for k in frames.tolist()]))
        computed = multiply(ego_from_world[of_row], world_from_box)
        _check_poses(rows_at(boxed, placed.tolist()), computed, poses[placed], findings)
        poses[placed] = computed
    for row, ego_from_box, extent in zip(
        boxed.select(_BOX_ROW_COLUMNS).to_pylist(), poses, extents, strict=True
    ):
        boxes[row["k"]].append(
            LabelledBox(
                track_id=row["track_id"],
                ego_from_box=ego_from_box,
                extent=extent,
                tags=frozenset(row["semantic_tags"]),
                points={
                    **dict(row["num_lidar_points"] or ()),
                    **dict(row["num_radar_points"] or ()),
                },
                is_ego=row["is_ego"],
                is_static=row["is_static"],
                is_capsule=row["box_source"] == "capsule",
            )
        )
    return boxes


def _check_poses(
    boxed: pa.Table,
    computed: NDArray[np.float64],
    labelled: NDArray[np.float64],
    findings: Findings,
) -> None:
    """Report boxes that are elsewhere in the world than in the ego's frame (``label_poses``)."""
    reach = length(numbers(boxed, "box_extent", 3))
    off = np.abs(computed - labelled)
    shift = off[:, :3, 3].max(axis=1, initial=0.0)
    apart = np.maximum(shift, off[:, :3, :3].max(axis=(1, 2), initial=0.0) * reach)
    for row in np.flatnonzero(~(apart <= _POSE_TOLERANCE_M)).tolist():
        findings.add(
            "label_poses",
            f"object {boxed['track_id'][row]}: its box in the world and in the ego's frame "
            f"are {apart[row]:.3f} m apart",
            frame=boxed["k"][row].as_py(),
        )


def camera_rows(table: pa.Table) -> dict[tuple[int, str], list[dict[str, Any]]]:
    """The rows of ``camera_objects.parquet`` that the geometric checks use, by frame and camera.

    ``outside_px`` is absent in datasets of version 0.1.
    """
    rows: dict[tuple[int, str], list[dict[str, Any]]] = defaultdict(list)
    chosen = [c for c in (*_CAMERA_COLUMNS, "outside_px") if c in table.column_names]
    for row in table.select(chosen).to_pylist():
        rows[row["k"], row["sensor_id"]].append(row)
    return rows
