"""Values are null just where the format says that there are none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from carstage.annotation.schema import (
    CAMERA_OBJECT_COLUMNS,
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    SENSOR_POSE_COLUMNS,
    Column,
)
from carstage.dataset.reading import Episode
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

_BOX = (
    "box_center", "box_rotation_deg", "box_quaternion", "box_extent", "box_center_ego",
    "box_rotation_ego_deg", "box_yaw_ego", "distance_ego",
)  # fmt: skip
_IN_3D = (
    "center_cam", "location", "dimensions", "rotation_y", "alpha", "rotation_cam", "corners_uv",
)  # fmt: skip
_IN_2D = ("bbox_amodal_unclipped", "bbox_amodal")
_SEEN = ("bbox_modal", "mask_modal")
_VERTICES = (
    "n_visible", "n_occluded", "n_outside", "n_behind", "truncation_paper", "truncated",
    "visible_stage_vo",
)  # fmt: skip
_PIXELS = ("visible_px", "visible_pixel")
_SILHOUETTE = ("outside_px", "front_px", "hull_px", "amodal_px")
_CONTROLS = ("throttle", "steer", "brake", "hand_brake", "reverse", "gear")
_WITHOUT_BOX = ("none", "invalid")


def check_nulls(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Report values that are missing, and such as should not be there (check ``label_nulls``).

    Args:
        episode: the episode.
        tables: its label tables; those of older versions have fewer columns.
        findings: where problems go.
    """
    labels = episode.spec.labels
    objects, seen, ego = tables.objects, tables.camera_objects, tables.ego
    riders = _is_in(objects["class"], ("rider",))
    walkers = np.asarray(pc.starts_with(objects["class"], "walker").to_numpy(), np.bool_)
    lights = _is_in(objects["class"], ("traffic_light",)) & _given(objects["parent_track_id"])
    same = _Nulls("objects", objects, findings)
    same.never(OBJECT_COLUMNS)
    same.are(_BOX, _is_in(objects["box_source"], _WITHOUT_BOX) | (not labels.boxes_3d))
    # Where no camera looked; datasets of before have 0 there.
    unseen = ~np.isin(objects["k"].to_numpy(), seen["k"].to_numpy())
    unknown = unseen & objects["visibility"].is_null().to_numpy()
    same.are(("visibility", "visibility_token"), riders | unknown | (not labels.pixels))
    same.are(("angular_velocity",), walkers)
    same.are(("traffic_light_state",), ~lights)
    _check_acceleration(same, objects)

    tracks = set(objects.filter(pa.array(riders))["track_id"].to_pylist())
    of_rider = np.array([t in tracks for t in seen["track_id"].to_pylist()], np.bool_)
    same = _Nulls("camera_objects", seen, findings)
    same.never(CAMERA_OBJECT_COLUMNS)
    same.are(_IN_3D, of_rider | (not labels.boxes_3d))
    same.are(_IN_2D, of_rider | (not labels.boxes_2d))
    same.are(_VERTICES, of_rider)
    same.are(_PIXELS, np.full(len(seen), not labels.pixels))
    same.are(_SILHOUETTE, of_rider | (not labels.pixels))
    same.are(("occlusion_ratio",), ~_positive(seen["hull_px"]))
    same.are(_SEEN, ~_positive(seen["visible_px"]) | (not labels.boxes_2d))

    same = _Nulls("ego", ego, findings)
    same.never(EGO_COLUMNS)
    _check_acceleration(same, ego)
    unknown = np.all([ego[column].is_null().to_numpy() for column in _CONTROLS], axis=0)
    same.are(_CONTROLS, np.asarray(unknown, np.bool_))

    _Nulls("sensor_poses", episode.sensor_poses(), findings).never(SENSOR_POSE_COLUMNS)


def _check_acceleration(same: _Nulls, table: pa.Table) -> None:
    """It may be unknown in the first frame, of all or of none."""
    unknown = table["acceleration"].is_null().to_numpy()
    same.are(("acceleration",), unknown & (table["k"].to_numpy() == 0))
    same.are(("acceleration_ego",), unknown)


class _Nulls:
    """Compares where a table's columns are null with where they should be.

    Args:
        name: of the table.
        table: its rows.
        findings: where differences go.
    """

    def __init__(self, name: str, table: pa.Table, findings: Findings) -> None:
        self._name, self._table, self._findings = name, table, findings

    def never(self, columns: Sequence[Column]) -> None:
        """Report columns that are null anywhere, of those that may not be."""
        self.are([one.name for one in columns if not one.nullable], np.False_)

    def are(self, columns: Sequence[str], absent: NDArray[np.bool_] | np.bool_) -> None:
        """Report columns that are null in other rows than these ``(N,)``."""
        for column in columns:
            if column not in self._table.column_names:
                continue
            found = self._table[column].is_null().to_numpy()
            wrong = np.flatnonzero(found != absent)
            if not len(wrong):
                continue
            row = self._table.slice(wrong[0], 1).to_pylist()[0]
            what = "is null" if found[wrong[0]] else "should be null"
            self._findings.add(
                "label_nulls",
                f"{self._name}.parquet: {column} of {row.get('track_id', 'a sensor')} {what}; "
                f"so it is in {len(wrong)} rows",
                frame=row["k"],
                sensor=row.get("sensor_id"),
            )


def _given(column: Any) -> NDArray[np.bool_]:
    """Where a value is given."""
    return np.asarray(column.is_valid().to_numpy(), np.bool_)


def _is_in(column: Any, values: tuple[str, ...]) -> NDArray[np.bool_]:
    return np.asarray(pc.is_in(column, value_set=pa.array(values)).to_numpy(), np.bool_)


def _positive(column: Any) -> NDArray[np.bool_]:
    """Where a number is given, and above 0."""
    above: Any = pc.greater(column, pa.scalar(0))
    return np.asarray(pc.fill_null(above, False).to_numpy(), np.bool_)
