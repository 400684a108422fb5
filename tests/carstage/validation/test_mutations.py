"""Damage that rewrites all hashes: only what the files say about each other can tell."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest

from analytic_dataset import attempt_of, recommit
from carstage.dataset.tables import read_table, write_table
from carstage.validation import Problem, validate_dataset
from damage import (
    FRAME,
    Damage,
    Row,
    document,
    edit_all,
    edit_one,
    flow_fields,
    moved,
    pictures,
    put,
    scaled,
    sweeps,
    turned,
)
from recorded_dataset import FRAMES, linked_copy, replace_file

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("recorded")]


def boxed(row: Row) -> bool:
    return row.get("box_center") is not None and not row["is_ego"] and not row["is_static"]


def vehicle(row: Row) -> bool:
    return boxed(row) and row["blueprint"].startswith("vehicle.") and moving(row)


def moving(row: Row) -> bool:
    return float(np.linalg.norm(row["velocity"])) > 1.5


def in_camera(row: Row) -> bool:
    return row["center_cam"] is not None and row["visible"]


def anything(row: Row) -> bool:
    return True


def mirrored(picture: Any) -> Any:
    return np.ascontiguousarray(picture[:, ::-1])


def late_at_the_end(drive: Path) -> None:
    folder = attempt_of(drive) / "sensors" / "CAM_FRONT"
    contents = [path.read_bytes() for path in sorted(folder.glob("*.png"))]
    for k in range(FRAMES - 5, FRAMES):
        replace_file(folder / f"{k:06d}.png", contents[k - 1])
    recommit(drive)


def swap_two_tracks(drive: Path) -> None:
    """From the middle on, in all tables."""
    rows = read_table(attempt_of(drive) / "objects.parquet").to_pylist()
    ids = sorted({r["track_id"] for r in rows if vehicle(r)})
    swap = {ids[0]: ids[1], ids[1]: ids[0]}

    def change(row: Row) -> None:
        if row["k"] >= FRAMES // 2:
            row["track_id"] = swap.get(row["track_id"], row["track_id"])
            if "instance_uid" in row:
                row["instance_uid"] = f"{row['episode_id']}:{row['track_id']}"

    for table in ("objects", "camera_objects"):
        edit_all(table, change)(drive)


def rename_a_tag(drive: Path) -> None:
    path = drive / "dataset.json"
    content = json.loads(path.read_text())
    content["tags"][14]["name"] = "Truck"
    path.write_text(json.dumps(content))


def change_one_light(drive: Path) -> None:
    """One light, in one frame: Green to Red or Red to Green, on all its heads."""
    rows = read_table(attempt_of(drive) / "objects.parquet").to_pylist()
    parent = next(
        r["parent_track_id"] for r in rows
        if r["k"] == FRAME and r["traffic_light_state"] in ("Red", "Green")
    )  # fmt: skip

    def change(row: Row) -> None:
        if row["k"] == FRAME and row["traffic_light_state"] and row["parent_track_id"] == parent:
            row["traffic_light_state"] = "Green" if row["traffic_light_state"] == "Red" else "Red"

    edit_all("objects", change)(drive)


def change_one_head(drive: Path) -> None:
    rows = read_table(attempt_of(drive) / "objects.parquet").to_pylist()
    heads: dict[Any, list[int]] = {}
    for row in rows:
        if row["k"] == 0 and row["traffic_light_state"]:
            heads.setdefault(row["parent_track_id"], []).append(row["track_id"])
    track = max(next(ids for ids in heads.values() if len(ids) > 1))
    other = {"Red": "Green", "Green": "Red", "Yellow": "Red"}

    def change(row: Row) -> None:
        if row["track_id"] == track:
            row["traffic_light_state"] = other[row["traffic_light_state"]]

    edit_all("objects", change)(drive)


def hide_a_vertex(row: Row) -> None:
    """One more than is hidden; all that follows from it is right."""
    row["n_visible"] -= 1
    row["n_occluded"] += 1
    seen = row["n_visible"]
    row["occluded"] = 0 if seen >= 6 else 1 if seen >= 4 else 2
    row["truncation_paper"] = (8 - seen) / 8
    row["visible_stage_vo"] = seen > 0


def wholly_hidden(row: Row) -> bool:
    return row["visible_px"] == 0 and row["front_px"] > 20


def turn_a_sensor(drive: Path) -> None:
    def change(row: Row) -> None:
        if row["sensor_id"] == "CAM_LEFT":
            row["rotation_deg"][1] += 2.0

    edit_all("sensor_poses", change)(drive)


def drop_poses(drive: Path) -> None:
    """Of one frame."""
    path = attempt_of(drive) / "sensor_poses.parquet"
    table = read_table(path)
    write_table(table.filter(pc.not_equal(table["k"], FRAME)), path)
    recommit(drive)


def double_poses(drive: Path) -> None:
    path = attempt_of(drive) / "sensor_poses.parquet"
    table = read_table(path)
    write_table(pa.concat_tables([table, table.slice(0, 1)]), path)
    recommit(drive)


def turn_in_the_calibration(content: Any) -> None:
    c, s = np.cos(np.radians(2.0)), np.sin(np.radians(2.0))
    for name in ("carrier_from_sensor", "ego_from_sensor"):
        pose = np.array(content["sensors"]["CAM_LEFT"][name])
        pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ pose[:3, :3]
        content["sensors"]["CAM_LEFT"][name] = pose.tolist()


def change_reference(content: Any) -> None:
    content["geo_reference"]["latitude_deg"] += 0.5


def change_projection(content: Any) -> None:
    content["geo_reference"]["projection"] = "spherical_mercator"


def change_attribute(content: Any) -> None:
    content["sensors"]["LIDAR_TOP"]["attributes"]["channels"] = "64"


OBJECTS, CAMERAS, EGO = "objects.parquet", "camera_objects.parquet", "ego.parquet"
IMU, GNSS = "sensors/IMU", "sensors/GNSS"

# Name: damage, the check that has to find it, and words that its message has to hold.
MUTATIONS: dict[str, tuple[Damage, str, tuple[str, ...]]] = {
    # IMU and GNSS
    "imu zeroed": (
        edit_all(IMU, put("accelerometer", lambda v: [0.0, 0.0, 0.0])),
        "readings",
        ("IMU", "accelerometer"),
    ),
    "imu x10": (edit_all(IMU, put("accelerometer", scaled(10.0))), "readings", ("accelerometer",)),
    "imu without gravity": (
        edit_all(IMU, put("accelerometer", moved(-9.81, 2))),
        "readings",
        ("accelerometer",),
    ),
    "gyro negated": (edit_all(IMU, put("gyroscope", scaled(-1.0))), "readings", ("gyroscope",)),
    "gyro in degrees": (edit_all(IMU, put("gyroscope", scaled(57.3))), "readings", ("gyroscope",)),
    "compass shifted": (
        edit_all(IMU, put("compass_rad", lambda v: (v + 0.3) % 6.283)),
        "readings",
        ("compass_rad",),
    ),
    "one compass": (
        edit_one(IMU, put("compass_rad", lambda v: (v + 0.1) % 6.283), anything),
        "readings",
        ("compass_rad",),
    ),
    "gnss +0.01 deg": (
        edit_all(GNSS, put("latitude_deg", lambda v: v + 0.01)),
        "readings",
        ("latitude_deg",),
    ),
    "gnss longitude": (
        edit_all(GNSS, put("longitude_deg", lambda v: v - 0.01)),
        "readings",
        ("longitude_deg",),
    ),
    "gnss altitude": (
        edit_one(GNSS, put("altitude_m", lambda v: v + 1.0), anything),
        "readings",
        ("altitude_m",),
    ),
    "geo reference": (document("episode.json", change_reference), "ego_columns", ("latitude_deg",)),
    "projection": (document("episode.json", change_projection), "ego_columns", ("latitude_deg",)),
    # Poses of sensors
    "sensor poses dropped": (drop_poses, "sensor_poses", ("no row",)),
    "sensor poses doubled": (double_poses, "sensor_poses", ("several rows",)),
    "sensor pose +2 deg": (turn_a_sensor, "sensor_poses", ("rotation_deg",)),
    "sensor location": (
        edit_one(
            "sensor_poses", put("location", moved(0.5)), lambda r: r["sensor_id"] == "CAM_FRONT"
        ),
        "sensor_poses",
        ("location",),
    ),
    "ego_from_sensor": (
        edit_one(
            "sensor_poses",
            put("ego_from_sensor", lambda v: [*v[:3], v[3] + 0.5, *v[4:]]),
            lambda r: r["sensor_id"] == "CAM_FRONT",
        ),
        "sensor_poses",
        ("ego_from_sensor",),
    ),
    "calibration +2 deg": (
        document("calibration.json", turn_in_the_calibration),
        "sensor_poses",
        ("calibration.json",),
    ),
    "calibration attributes": (
        document("calibration.json", change_attribute),
        "sensor_poses",
        ("attributes",),
    ),
    # Ego
    "ego speed x2": (edit_all("ego", put("speed", scaled(2.0))), "ego_columns", (EGO, "speed")),
    "ego velocity x2": (
        edit_all("ego", put("velocity", scaled(2.0))),
        "ego_columns",
        ("velocity",),
    ),
    "ego velocity_ego": (
        edit_one("ego", put("velocity_ego", moved(1.0, 1)), anything),
        "ego_columns",
        ("velocity_ego",),
    ),
    "ego acceleration": (
        edit_one("ego", put("acceleration", moved(9.0, 1)), anything),
        "ego_columns",
        ("acceleration",),
    ),
    "ego acceleration_ego": (
        edit_all("ego", put("acceleration_ego", scaled(-1.0))),
        "ego_columns",
        ("acceleration_ego",),
    ),
    "ego yaw rate": (
        edit_all("ego", put("yaw_rate", lambda v: v + 0.2)),
        "ego_columns",
        ("yaw_rate",),
    ),
    "ego yaw rate flu": (
        edit_all("ego", put("yaw_rate_flu", lambda v: v + 0.2)),
        "ego_columns",
        ("yaw_rate_flu",),
    ),
    "ego angular velocity": (
        edit_all("ego", put("angular_velocity", moved(0.3, 2))),
        "ego_columns",
        ("angular_velocity",),
    ),
    "ego quaternion": (
        edit_one("ego", put("quaternion", lambda v: [v[0], -v[1], -v[2], -v[3]]), anything),
        "ego_columns",
        ("quaternion",),
    ),
    "ego latitude": (
        edit_one("ego", put("latitude_deg", lambda v: v + 1e-4), anything),
        "ego_columns",
        ("latitude_deg",),
    ),
    "ego longitude": (
        edit_one("ego", put("longitude_deg", lambda v: v + 1e-4), anything),
        "ego_columns",
        ("longitude_deg",),
    ),
    "ego altitude": (
        edit_one("ego", put("altitude_m", lambda v: v + 0.1), anything),
        "ego_columns",
        ("altitude_m",),
    ),
    "ego location": (edit_one("ego", put("location", moved(1.0)), anything), "ego_columns", ()),
    # Objects in the world
    "one velocity x1.6": (
        edit_one("objects", put("velocity", scaled(1.6)), vehicle),
        "motion_rows",
        (OBJECTS, "velocity"),
    ),
    "all velocities x1.6": (
        edit_all("objects", put("velocity", scaled(1.6))),
        "motion_rows",
        ("velocity",),
    ),
    "one velocity turned": (
        edit_one("objects", put("velocity", scaled(-1.0)), vehicle),
        "motion_rows",
        ("velocity",),
    ),
    "velocity_ego": (
        edit_one("objects", put("velocity_ego", scaled(1.1)), vehicle),
        "object_columns",
        ("velocity_ego",),
    ),
    "acceleration": (
        edit_one("objects", put("acceleration", moved(20.0)), vehicle),
        "motion_rows",
        ("acceleration",),
    ),
    "acceleration_ego": (
        edit_one("objects", put("acceleration_ego", moved(1.0)), vehicle),
        "object_columns",
        ("acceleration_ego",),
    ),
    "angular velocity": (
        edit_one("objects", put("angular_velocity", moved(1.0, 2)), vehicle),
        "motion_rows",
        ("angular_velocity",),
    ),
    "actor location +1 m": (
        edit_one("objects", put("actor_location", moved(1.0)), vehicle),
        "motion_rows",
        (),
    ),
    "box location +1 m": (
        edit_one("objects", put("box_center", moved(1.0)), boxed),
        "label_poses",
        (),
    ),
    "box extent x1.1": (
        edit_one("objects", put("box_extent", scaled(1.1)), boxed),
        "tracks",
        ("box_extent",),
    ),
    "box quaternion": (
        edit_one(
            "objects",
            put("box_quaternion", lambda v: [v[0], v[1], v[2], -v[3]]),
            lambda r: boxed(r) and abs(r["box_quaternion"][3] * r["box_quaternion"][0]) > 0.05,
        ),
        "object_columns",
        ("box_quaternion",),
    ),
    "box yaw ego": (
        edit_one("objects", put("box_yaw_ego", turned(0.1)), boxed),
        "object_columns",
        ("box_yaw_ego",),
    ),
    "box center ego": (
        edit_one("objects", put("box_center_ego", moved(0.5)), boxed),
        "label_poses",
        (),
    ),
    "distance ego": (
        edit_one("objects", put("distance_ego", scaled(1.05)), boxed),
        "object_columns",
        ("distance_ego",),
    ),
    "class changed": (
        edit_one("objects", put("class", lambda v: "walker_adult"), vehicle),
        "tracks",
        ("class",),
    ),
    "class changed everywhere": (
        edit_all(
            "objects", lambda r: put("class", lambda v: "bus")(r) if r["class"] == "car" else None
        ),
        "tracks",
        ("class",),
    ),
    "blueprint changed": (
        edit_one(
            "objects",
            put("blueprint", lambda v: "vehicle.audi.tt"),
            lambda r: vehicle(r) and r["blueprint"] != "vehicle.audi.tt",
        ),
        "tracks",
        ("blueprint",),
    ),
    "tags changed": (
        edit_one("objects", put("semantic_tags", lambda v: [12]), vehicle),
        "tracks",
        ("semantic_tags",),
    ),
    "instance uid": (
        edit_one("objects", put("instance_uid", lambda v: v + "0"), boxed),
        "object_columns",
        ("instance_uid",),
    ),
    "ids swapped": (swap_two_tracks, "tracks", ()),
    "lidar points": (
        edit_one(
            "objects",
            put("num_lidar_points", lambda v: [(n, c + 30) for n, c in v]),
            lambda r: boxed(r) and bool(r["num_lidar_points"]),
        ),
        "lidar_counts",
        (),
    ),
    "visibility": (
        edit_one("objects", put("visibility", lambda v: 1.0 - v), boxed),
        "object_columns",
        ("visibility",),
    ),
    "visibility token": (
        edit_one("objects", put("visibility_token", lambda v: 5 - v), boxed),
        "object_columns",
        ("visibility_token",),
    ),
    "light changed": (change_one_light, "lights", ("traffic_light_state",)),
    "one head changed": (change_one_head, "lights", ("traffic_light_state",)),
    # Objects in cameras
    "rotation_y + pi": (
        edit_one("camera_objects", put("rotation_y", turned(np.pi)), in_camera),
        "camera_columns",
        (CAMERAS, "rotation_y"),
    ),
    "alpha": (
        edit_one("camera_objects", put("alpha", turned(0.1)), in_camera),
        "camera_columns",
        ("alpha",),
    ),
    "location +1 m": (
        edit_one("camera_objects", put("location", moved(1.0)), in_camera),
        "camera_columns",
        ("location",),
    ),
    "center_cam": (
        edit_one("camera_objects", put("center_cam", moved(0.2, 2)), in_camera),
        "camera_columns",
        ("center_cam",),
    ),
    "dimensions x1.1": (
        edit_one("camera_objects", put("dimensions", scaled(1.1)), in_camera),
        "camera_columns",
        ("dimensions",),
    ),
    "rotation_cam": (
        edit_one(
            "camera_objects", put("rotation_cam", lambda v: [v[0], -v[1], v[2], v[3]]), in_camera
        ),
        "camera_columns",
        ("rotation_cam",),
    ),
    "distance": (
        edit_one("camera_objects", put("distance", lambda v: v + 1.0), in_camera),
        "camera_columns",
        ("distance",),
    ),
    "depth_center": (
        edit_one("camera_objects", put("depth_center", lambda v: v + 1.0), in_camera),
        "camera_columns",
        ("depth_center",),
    ),
    "corners": (
        edit_one("camera_objects", put("corners_uv", lambda v: v[::-1]), in_camera),
        "camera_columns",
        ("corners_uv",),
    ),
    "truncation paper": (
        edit_one("camera_objects", put("truncation_paper", lambda v: (v + 0.25) % 1.0), in_camera),
        "camera_columns",
        ("truncation_paper",),
    ),
    "occluded": (
        edit_one("camera_objects", put("occluded", lambda v: (v + 1) % 3), in_camera),
        "camera_columns",
        ("occluded",),
    ),
    "occluded_px": (
        edit_one("camera_objects", put("occluded_px", lambda v: (v + 1) % 3), in_camera),
        "camera_columns",
        ("occluded_px",),
    ),
    "occlusion ratio": (
        edit_one(
            "camera_objects",
            put("occlusion_ratio", lambda v: 1.0 - v),
            lambda r: in_camera(r) and abs(r["occlusion_ratio"] - 0.5) > 0.1,
        ),
        "camera_columns",
        ("occlusion_ratio",),
    ),
    "amodal pixels": (
        edit_one("camera_objects", put("amodal_px", lambda v: v * 1.1), in_camera),
        "camera_columns",
        ("amodal_px",),
    ),
    "pixels outside the silhouette": (
        edit_one("camera_objects", put("outside_px", lambda v: v + 5), in_camera),
        "hull",
        ("outside_px",),
    ),
    "visible pixel": (
        edit_one("camera_objects", put("visible_pixel", lambda v: not v), in_camera),
        "camera_columns",
        ("visible_pixel",),
    ),
    "bbox_amodal": (
        edit_one(
            "camera_objects",
            put("bbox_amodal", lambda v: [v[0] + 3, *v[1:]]),
            lambda r: in_camera(r) and r["bbox_amodal"] is not None,
        ),
        "bbox_amodal",
        (),
    ),
    "bbox_amodal_unclipped": (
        edit_one("camera_objects", put("bbox_amodal_unclipped", moved(3.0, 2)), in_camera),
        "bbox_amodal",
        ("bbox_amodal_unclipped",),
    ),
    "no bbox_amodal_unclipped": (
        edit_one("camera_objects", put("bbox_amodal_unclipped", lambda v: None), in_camera),
        "label_nulls",
        ("bbox_amodal_unclipped",),
    ),
    "truncated": (
        edit_one("camera_objects", put("truncated", lambda v: (v + 0.1) % 1.0), in_camera),
        "bbox_amodal",
        ("truncated",),
    ),
    "crosses near": (
        edit_one("camera_objects", put("crosses_near", lambda v: not v), in_camera),
        "camera_columns",
        ("crosses_near",),
    ),
    "pixels of the silhouette": (
        edit_one("camera_objects", put("hull_px", lambda v: v + 5), in_camera),
        "hull",
        ("hull_px",),
    ),
    "visible": (
        edit_one("camera_objects", put("visible", lambda v: not v), in_camera),
        "camera_columns",
        ("visible of",),
    ),
    "visibility method": (
        edit_one("camera_objects", put("visibility_method", lambda v: "guessed"), in_camera),
        "camera_columns",
        ("visibility_method",),
    ),
    "amodal method": (
        edit_one("camera_objects", put("amodal_method", lambda v: "hull_prior"), in_camera),
        "camera_columns",
        ("amodal_method",),
    ),
    "pinhole": (
        edit_one("camera_objects", put("pinhole", lambda v: not v), in_camera),
        "camera_columns",
        ("pinhole",),
    ),
    "ambiguous light": (
        edit_one(
            "camera_objects",
            put("instance_ambiguous", lambda v: True),
            lambda r: r["track_id"] >= 1 << 52,
        ),
        "camera_columns",
        ("instance_ambiguous",),
    ),
    # What all rows say alike
    "episode id": (
        edit_one("objects", put("episode_id", lambda v: v[::-1]), anything),
        "object_columns",
        (OBJECTS, "episode_id"),
    ),
    "ego's track id": (
        edit_one("ego", put("track_id", lambda v: v + 1), anything),
        "ego_columns",
        (EGO, "track_id"),
    ),
    "map": (edit_one("ego", put("map", lambda v: "Town01"), anything), "ego_columns", ("map",)),
    "box source": (
        edit_one("objects", put("box_source", lambda v: "guessed"), anything),
        "label_ranges",
        ("guessed",),
    ),
    "light state": (
        edit_one("ego", put("traffic_light_state", lambda v: "Blue"), anything),
        "label_ranges",
        ("Blue",),
    ),
    "light elsewhere": (
        edit_one("objects", put("actor_location", moved(1.0)), lambda r: r["is_static"]),
        "object_columns",
        ("actor_location",),
    ),
    "light of another": (
        edit_one(
            "objects", put("parent_track_id", lambda v: v + 1), lambda r: r["traffic_light_state"]
        ),
        "tracks",
        ("parent_track_id",),
    ),
    "pose at another time": (
        edit_one("sensor_poses", put("timestamp_s", lambda v: v + 0.1), anything),
        "label_timestamps",
        ("sensor_poses.parquet",),
    ),
    "pose on another actor": (
        edit_one("sensor_poses", put("carrier_track_id", lambda v: v + 1), anything),
        "sensor_poses",
        ("sits on",),
    ),
    # What hides an object
    "one vertex hidden": (
        edit_one("camera_objects", hide_a_vertex, lambda r: r["n_visible"] == 8),
        "occluders",
        ("n_visible", "CAM_FRONT"),
    ),
    "half of what is before it": (
        edit_one("camera_objects", put("front_px", lambda v: v // 2), wholly_hidden),
        "occluders",
        ("front_px", "CAM_FRONT"),
    ),
    # Pictures and sweeps
    "red and blue swapped": (
        pictures("CAM_FRONT", lambda p: np.ascontiguousarray(p[..., ::-1])),
        "colour_order",
        (),
    ),
    "one picture mirrored": (pictures("CAM_FRONT", mirrored, (FRAME,)), "mirrored", ()),
    "one depth mirrored": (pictures("DEPTH_FRONT", mirrored, (FRAME,)), "lidar_depth", ()),
    "one semantic mirrored": (pictures("SEMANTIC_FRONT", mirrored, (FRAME,)), "tags", ()),
    "instance mirrored": (pictures("INSTANCE_FRONT", mirrored), "tags", ()),
    "late at the end": (late_at_the_end, "rgb_frame", ()),
    "flow mirrored": (flow_fields(lambda f: f[:, ::-1]), "flow", ()),
    "flow x and y swapped": (flow_fields(lambda f: f[..., ::-1]), "flow", ()),
    "intensity in 0 to 255": (
        sweeps(lambda p: np.multiply(p[:, 3], 255.0, out=p[:, 3])),
        "lidar_intensity",
        (),
    ),
    "intensity lost": (sweeps(lambda p: p[:, 3].fill(0.0)), "lidar_intensity", ()),
    "sweeps turned": (
        sweeps(lambda p: p[:, :2].__setitem__(slice(None), p[:, 1::-1].copy())),
        "lidar_depth",
        (),
    ),
    "tag renamed": (rename_a_tag, "tag_table", ("Truck",)),
}

ONE_ROW = [name for name, (damage, _, _) in MUTATIONS.items() if "edit_one" in damage.__qualname__]
"""Damage of one row of ``FRAME``: the frame has to be named."""


@pytest.fixture
def drive(recorded: Path, tmp_path: Path) -> Path:
    """The first of the two drives, to be damaged."""
    return linked_copy(recorded, tmp_path / "out", episodes=1)


def test_there_are_enough_kinds_of_damage() -> None:
    assert len(MUTATIONS) >= 70


@pytest.mark.parametrize("name", MUTATIONS)
def test_damage_is_caught_and_named(drive: Path, name: str) -> None:
    damage, check, words = MUTATIONS[name]
    damage(drive)
    report = validate_dataset(drive)
    errors = [problem for problem in report.problems if problem.severity == "error"]
    found = [problem for problem in errors if problem.check == check]
    told = [problem.message for problem in errors]
    assert any(all(word in text(problem) for word in words) for problem in found), told
    if name in ONE_ROW:
        assert {problem.frame for problem in found} & {FRAME, FRAME + 1}, told


def text(problem: Problem) -> str:
    return f"{problem.message} {problem.sensor} {problem.frame}"
