"""Columns of the label tables that follow from other columns, recomputed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.reading import Episode
from carstage.geometry import (
    FloatArray,
    box_corners,
    flu_rotation,
    length,
    observation_angle,
    optical_from_world,
    pose_matrix,
    proper_box_rotation,
    quaternion_from_matrix,
    rotate,
    rotation_matrix,
    rotation_y,
    wrap_angle,
)
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.recomputing import Recomputed, entries, numbers, rows_at

OCCLUSION_LIMITS = (0.10, 0.50)
"""Largest ratios of levels 0 and 1 of ``occluded_px``."""
FILL_PRIOR = 0.8
"""Share of its silhouette that an object fills of which no pixel in it is visible."""
VISIBILITY_BINS = (0.4, 0.6, 0.8)
"""Where nuScenes's bins of ``visibility`` begin, after the first."""
_SMALL = 1e-6
_METRES = 1e-4
_PIXELS = 1e-2
_NEAR_CORNER_M = 0.5
_TURN = 2.0 * np.pi


def check_ego_columns(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Recompute the columns of ``ego.parquet`` that follow from others (check ``ego_columns``)."""
    ego = tables.ego
    if not len(ego):
        return
    same = Recomputed("ego_columns", "ego.parquet", ego, findings)
    _check_constants(episode, ego, ("episode_id", "track_id", "map"), same)
    rotation = rotation_matrix(numbers(ego, "rotation_deg", 3))
    turned_back = np.swapaxes(rotation, 1, 2)
    velocity, turning = numbers(ego, "velocity", 3), numbers(ego, "angular_velocity", 3)
    same.column(
        "quaternion", quaternion_from_matrix(flu_rotation(rotation)), _SMALL, either_sign=True
    )
    same.column("velocity_ego", rotate(turned_back, velocity), _SMALL)
    same.column("acceleration_ego", rotate(turned_back, numbers(ego, "acceleration", 3)), _SMALL)
    same.column("angular_velocity_ego", rotate(turned_back, turning), _SMALL)
    same.column("speed", length(velocity), _SMALL)
    same.column("yaw_rate", turning[:, 2], _SMALL)
    same.column("yaw_rate_flu", -turning[:, 2], _SMALL)
    gears, backwards = entries(ego, "gear"), entries(ego, "reverse")
    # CARLA's ACarlaWheeledVehicle::FlushVehicleControl makes it of the gear that is in.
    below = [None if gear is None else gear < 0 for gear in gears]
    same.rows(
        "reverse",
        np.array([a != b for a, b in zip(backwards, below, strict=True)]),
        backwards,
        below,
    )
    places = [episode.geo_frame.place(p) for p in numbers(ego, "location", 3)]
    same.column("latitude_deg", [p.latitude_deg for p in places], 1e-9)
    same.column("longitude_deg", [p.longitude_deg for p in places], 1e-9)
    same.column("altitude_m", [p.altitude_m for p in places], _METRES)
    _check_ego_among_objects(tables, findings)


def _check_constants(
    episode: Episode, table: pa.Table, columns: Sequence[str], same: Recomputed
) -> None:
    """Columns that say in each row what ``episode.json`` says."""
    document = episode.document
    said = {"episode_id": episode.id, "track_id": document["ego_id"], "map": document["map"]}
    for column in columns:
        found = entries(table, column)
        wrong = np.array([value != said[column] for value in found], np.bool_)
        same.rows(column, wrong, found, [said[column]] * len(found))


def _check_ego_among_objects(tables: LabelTables, findings: Findings) -> None:
    """The ego's row of ``objects.parquet`` says what ``ego.parquet`` says."""
    objects = tables.objects.filter(tables.objects["is_ego"])
    at = {k: i for i, k in enumerate(entries(tables.ego, "k"))}
    kept = [i for i, k in enumerate(entries(objects, "k")) if k in at]
    objects = rows_at(objects, kept)
    rows = rows_at(tables.ego, [at[k] for k in entries(objects, "k")])
    same = Recomputed("ego_columns", "objects.parquet", objects, findings)
    for column, own in (
        ("actor_location", "location"),
        ("actor_rotation_deg", "rotation_deg"),
        ("velocity", "velocity"),
        ("acceleration", "acceleration"),
        ("angular_velocity", "angular_velocity"),
    ):
        same.column(column, numbers(rows, own, 3), _METRES)


def check_object_columns(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Recompute columns of ``objects.parquet`` (check ``object_columns``)."""
    objects = tables.objects
    same = Recomputed("object_columns", "objects.parquet", objects, findings)
    _check_constants(episode, objects, ("episode_id",), same)
    ids = entries(objects, "track_id")
    wanted = [f"{episode.id}:{track}" for track in ids]
    uids = entries(objects, "instance_uid")
    same.rows("instance_uid", np.array([a != b for a, b in zip(uids, wanted, strict=True)],
                                       dtype=np.bool_), uids, wanted)  # fmt: skip
    boxed = objects.filter(pc.is_valid(objects["box_center"]))
    same = Recomputed("object_columns", "objects.parquet", boxed, findings)
    rotation = rotation_matrix(numbers(boxed, "box_rotation_deg", 3))
    same.column(
        "box_quaternion", quaternion_from_matrix(flu_rotation(rotation)), _SMALL, either_sign=True
    )
    same.column(
        "box_yaw_ego", wrap_angle(np.radians(numbers(boxed, "box_rotation_ego_deg", 3)[:, 1])),
        _SMALL, period=_TURN,
    )  # fmt: skip
    same.column("distance_ego", length(numbers(boxed, "box_center_ego", 3)), _METRES)
    of_map = boxed["is_static"].to_numpy()
    same.column("actor_location", numbers(boxed, "box_center", 3), _METRES, where=of_map)
    _check_moving_with_the_ego(tables, findings)
    _check_visibility(tables, findings)


def _check_moving_with_the_ego(tables: LabelTables, findings: Findings) -> None:
    world_from_ego = tables.world_from_ego
    objects = tables.objects
    known = [i for i, k in enumerate(entries(objects, "k")) if k in world_from_ego]
    objects = rows_at(objects, known)
    if not len(objects):
        return
    poses = np.stack([world_from_ego[k] for k in entries(objects, "k")])
    turned_back = np.swapaxes(poses[:, :3, :3], 1, 2)
    same = Recomputed("object_columns", "objects.parquet", objects, findings)
    same.column("velocity_ego", rotate(turned_back, numbers(objects, "velocity", 3)), _SMALL)
    acceleration = rotate(turned_back, numbers(objects, "acceleration", 3))
    same.column("acceleration_ego", acceleration, _SMALL)
    boxed = ~np.isnan(numbers(objects, "box_center", 3)[:, 0])
    center = rotate(turned_back, numbers(objects, "box_center", 3) - poses[:, :3, 3])
    same.column("box_center_ego", center, 1e-3, where=boxed)


def _check_visibility(tables: LabelTables, findings: Findings) -> None:
    """Visible over amodal pixels of all cameras, and its bin."""
    objects = tables.objects.filter(pc.is_valid(tables.objects["visibility"]))
    pixels: dict[tuple[int, int], list[float]] = {}
    rows = tables.camera_objects.select(["k", "track_id", "visible_px", "amodal_px"]).to_pylist()
    for row in rows:
        if row["visible_px"] is not None and row["amodal_px"] is not None:
            sums = pixels.setdefault((row["k"], row["track_id"]), [0.0, 0.0])
            sums[0] += row["visible_px"]
            sums[1] += row["amodal_px"]
    keys = zip(entries(objects, "k"), entries(objects, "track_id"), strict=True)
    totals = np.array([pixels.get(key, [0.0, 0.0]) for key in keys]).reshape(-1, 2)
    share = totals[:, 0] / np.where(totals[:, 1] > 0.0, totals[:, 1], np.inf)
    same = Recomputed("object_columns", "objects.parquet", objects, findings)
    same.column("visibility", share, _SMALL)
    recorded = numbers(objects, "visibility")
    same.column("visibility_token", 1 + np.digitize(recorded, VISIBILITY_BINS), 0.0)


def check_camera_columns(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Recompute columns of ``camera_objects.parquet`` from boxes and poses of cameras.

    Checks ``camera_columns``. What is seen, and how much of it, is compared with pictures
    elsewhere.
    """
    table = tables.camera_objects
    _check_occlusion(episode, table, findings)
    boxes = {
        (row["k"], row["track_id"]): row
        for row in tables.objects.select(
            ["k", "track_id", "box_center", "box_rotation_deg", "box_extent"]
        ).to_pylist()
        if row["box_center"] is not None
    }
    poses = episode.world_from_sensor()
    for sensor in episode.sensors:
        if not (sensor.calibration.labelled and sensor.calibration.is_projective):
            continue
        of_sensor = [i for i, name in enumerate(entries(table, "sensor_id")) if name == sensor.id]
        rows = rows_at(table, of_sensor)
        keys = list(zip(entries(rows, "k"), entries(rows, "track_id"), strict=True))
        own = poses.get(sensor.id, {})
        kept = [i for i, key in enumerate(keys) if key in boxes and key[0] in own]
        rows = rows_at(rows, kept)
        if not len(rows):
            continue
        chosen = [boxes[keys[i]] for i in kept]
        by_frame = {k: optical_from_world(own[k]) for k in {keys[i][0] for i in kept}}
        optical = np.stack([by_frame[keys[i][0]] for i in kept])
        _check_three_d(rows, chosen, optical, sensor.calibration, findings)


def _check_three_d(
    rows: pa.Table,
    boxes: list[dict[str, list[float]]],
    optical: FloatArray,
    camera: SensorCalibration,
    findings: Findings,
) -> None:
    same = Recomputed("camera_columns", "camera_objects.parquet", rows, findings)
    extent = np.array([box["box_extent"] for box in boxes])
    world_from_box = pose_matrix(
        [box["box_center"] for box in boxes], [box["box_rotation_deg"] for box in boxes]
    )
    optical_from_box = optical @ world_from_box
    center, turn = optical_from_box[:, :3, 3], optical_from_box[:, :3, :3]
    bottom = center + np.stack([0 * extent[:, 2], extent[:, 2], 0 * extent[:, 2]], axis=1)
    heading = rotation_y(turn)
    has_3d = ~np.isnan(numbers(rows, "center_cam", 3)[:, 0])
    same.column("center_cam", center, _METRES, where=has_3d)
    same.column("location", bottom, _METRES, where=has_3d)
    same.column("dimensions", 2.0 * extent[:, ::-1], _METRES, where=has_3d)
    same.column("rotation_y", heading, 1e-5, period=_TURN, where=has_3d)
    same.column("alpha", observation_angle(heading, center), 1e-5, period=_TURN, where=has_3d)
    quaternion = quaternion_from_matrix(proper_box_rotation(turn))
    same.column("rotation_cam", quaternion, 1e-5, either_sign=True, where=has_3d)
    # A rider's distance is that of its two-wheeler, and it has no box.
    same.column("distance", length(center), _METRES)
    same.column("depth_center", center[:, 2], _METRES)
    _check_corners(rows, box_corners(optical_from_box, extent), camera, same)


def _check_corners(
    rows: pa.Table, corners: FloatArray, camera: SensorCalibration, same: Recomputed
) -> None:
    """Projected corners; those that are nearer than half a metre are too sensitive."""
    gone = [np.nan, np.nan]
    recorded = np.array(
        [
            [gone if uv is None else uv for uv in row or [None] * 8]
            for row in entries(rows, "corners_uv")
        ]
    )
    expected = camera.project(corners)
    near = corners[..., 2] if camera.bent is None else camera.bent.depth(corners)
    skipped = np.isnan(recorded) | (near[..., None] < _NEAR_CORNER_M)
    lost = np.isnan(recorded) & (near[..., None] >= _NEAR_CORNER_M) & (camera.bent is None)
    given = rows["corners_uv"].is_valid().to_numpy()
    off = np.where(skipped, 0.0, recorded - np.where(skipped, 0.0, expected))
    allowed = _PIXELS * (1.0 + np.abs(np.where(skipped, 0.0, expected)) / 1e3)
    off[lost & given[:, None, None]] = np.inf
    same.column(
        "corners_uv", np.zeros(len(rows)), 1.0, recorded=(np.abs(off) / allowed).max(axis=(1, 2))
    )


def _check_occlusion(episode: Episode, table: pa.Table, findings: Findings) -> None:
    """Levels and ratios follow from the counts beside them."""
    boxed = table.filter(pc.is_valid(table["n_visible"]))
    same = Recomputed("camera_columns", "camera_objects.parquet", boxed, findings)
    seen = numbers(boxed, "n_visible")
    inside = seen + numbers(boxed, "n_occluded")
    unknown = 2 if episode.spec.labels.stage_vo_strict else 3
    level = np.select([inside == 0, seen >= 6, seen >= 4], [unknown, 0, 1], 2)
    same.column("occluded", level, 0.0)
    same.column("truncation_paper", (8.0 - seen) / 8.0, _SMALL)
    same.column("visible_stage_vo", seen > 0, 0.0)
    straight = boxed["pinhole"].to_numpy()
    same.column("crosses_near", numbers(boxed, "n_behind") > 0, 0.0, where=straight)
    counted = boxed.filter(pc.is_valid(boxed["occlusion_ratio"]))
    same = Recomputed("camera_columns", "camera_objects.parquet", counted, findings)
    amodal = numbers(counted, "amodal_px")
    ratio = 1.0 - np.minimum(numbers(counted, "visible_px") / np.maximum(amodal, 1e-9), 1.0)
    same.column("occlusion_ratio", ratio, _SMALL, where=amodal > 0.0)
    same.column("amodal_px", _amodal_px(counted), 1e-3)
    given = numbers(counted, "occlusion_ratio")
    same.column("occluded_px", np.searchsorted(OCCLUSION_LIMITS, given, side="left"), 0.0)
    pixels = table.filter(pc.is_valid(table["visible_px"]))
    least = episode.spec.labels.min_visible_px
    same = Recomputed("camera_columns", "camera_objects.parquet", pixels, findings)
    same.column("visible_pixel", numbers(pixels, "visible_px") >= least, 0.0)


def _amodal_px(rows: pa.Table) -> FloatArray:
    """``(N,)`` pixels that an object would show; what of its silhouette it fills is a prior."""
    visible, front, hull = (numbers(rows, f"{name}_px") for name in ("visible", "front", "hull"))
    # Datasets of version 0.1 count no pixels outside the silhouette.
    known = "outside_px" in rows.column_names
    within = visible - (numbers(rows, "outside_px") if known else 0.0)
    fill = np.where(within > 0.0, within / np.maximum(hull - front, 1.0), FILL_PRIOR)
    return np.asarray(visible + fill * np.where(visible > 0.0, front, hull))
