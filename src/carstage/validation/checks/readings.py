"""What sensors of motion and place read, recomputed from where they were."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from carstage.annotation.rig import camera_geometry, planned_lens
from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.ledger import saved_times_s
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.tables import row_sensor
from carstage.geometry import (
    FloatArray,
    compass_rad,
    horizontal_fov_deg,
    intrinsics,
    pose_matrix,
    rotate,
    rotation_deg,
    rotation_matrix,
    specific_force,
)
from carstage.spec import EGO, RIGID, SensorSpec
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.ledger import TIMESTAMP_TOLERANCE_S
from carstage.validation.checks.recomputing import Recomputed, entries, numbers, rows_at

_POSE_M, _POSE_RAD = 0.02, 0.002
_FORCE_M_S2, _GYRO_RAD_S, _COMPASS_RAD, _PLACE_M = 0.05, 5e-4, 0.002, 0.05
_SIGMAS = 6.0
_INTRINSIC = 1e-6
_MOUNT = ("kind", "blueprint", "attach_to", "attach_index", "attachment")


def check_sensor_poses(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Compare poses of sensors with ego, calibration and spec (check ``sensor_poses``)."""
    _check_calibration(episode, findings)
    poses = episode.sensor_poses()
    _check_keys(episode, poses, findings)
    world_from_ego = tables.world_from_ego
    of_sensor = episode.calibration.sensors
    wanted, turns, kept = [], [], []
    for i, (k, name) in enumerate(
        zip(entries(poses, "k"), entries(poses, "sensor_id"), strict=True)
    ):
        camera = of_sensor.get(name)
        if camera is None or k not in world_from_ego or not _is_fixed_on_ego(camera):
            continue
        pose = world_from_ego[k] @ camera.ego_from_sensor
        kept.append(i)
        wanted.append(pose[:3, 3])
        turns.append(pose[:3, :3])
    if not kept:
        return
    rows = rows_at(poses, kept)
    same = Recomputed("sensor_poses", "sensor_poses.parquet", rows, findings)
    same.column("location", np.array(wanted), _POSE_M)
    recorded = rotation_matrix(numbers(rows, "rotation_deg", 3))
    off = np.abs(recorded - np.array(turns)).max(axis=(1, 2))
    same.rows(
        "rotation_deg", off > _POSE_RAD, numbers(rows, "rotation_deg", 3),
        rotation_deg(np.array(turns)),
    )  # fmt: skip
    in_ego = numbers(rows, "ego_from_sensor", 16).reshape(-1, 4, 4)
    fixed = np.stack([of_sensor[name].ego_from_sensor for name in entries(rows, "sensor_id")])
    same.column("ego_from_sensor", fixed, _POSE_M, recorded=in_ego)


def _check_keys(episode: Episode, poses: pa.Table, findings: Findings) -> None:
    """Each sensor has one row in each frame, with the frame's time and the sensor's carrier."""
    times_s = saved_times_s(episode.ledger())
    carriers = episode.carriers()
    rows: Counter[tuple[str, int]] = Counter()
    columns = ("k", "sensor_id", "timestamp_s", "carrier_track_id")
    for k, name, time_s, carrier in zip(*(entries(poses, c) for c in columns), strict=True):
        rows[name, k] += 1
        if abs(time_s - times_s.get(k, time_s)) > TIMESTAMP_TOLERANCE_S:
            message = f"sensor_poses.parquet: a row says {time_s} s, the ledger {times_s[k]} s"
            findings.add("label_timestamps", message, frame=k, sensor=name)
        if carrier != carriers[name]:
            message = f"sensor_poses.parquet: it sits on {carrier}, and later on {carriers[name]}"
            findings.add("sensor_poses", message, frame=k, sensor=name)
    for name in episode.calibration.sensors:
        wrong = [k for k in range(episode.frames) if rows[name, k] != 1]
        if wrong:
            found = "no row" if not rows[name, wrong[0]] else "several rows"
            findings.add(
                "sensor_poses",
                f"sensor_poses.parquet has {found} of it; {len(wrong)} frames have not exactly one",
                frame=wrong[0],
                sensor=name,
            )


def _check_calibration(episode: Episode, findings: Findings) -> None:
    """``calibration.json`` has the poses, attributes and intrinsics that the spec asks for."""
    known = episode.calibration.sensors
    for sensor in episode.spec.sensors:
        camera = known.get(sensor.id)
        if camera is None:
            continue
        pose = sensor.pose
        wanted = pose_matrix(
            [pose.x_m, pose.y_m, pose.z_m], [pose.pitch_deg, pose.yaw_deg, pose.roll_deg]
        )
        off = float(np.abs(camera.carrier_from_sensor - wanted).max())
        if off > _POSE_RAD:
            findings.add(
                "sensor_poses",
                f"calibration.json: carrier_from_sensor is {off:.3g} off the pose of the spec",
                sensor=sensor.id,
            )
        if dict(camera.attributes) != dict(sensor.attributes):
            findings.add(
                "sensor_poses",
                "calibration.json: attributes are not those of the spec",
                sensor=sensor.id,
            )
        other = [name for name in _MOUNT if getattr(camera, name) != getattr(sensor, name)]
        if sensor.blueprint.startswith("sensor.camera.") and sensor.flash is None:
            (width, height), fov_deg, k = _view(sensor)
            other += ["size"] * ((camera.width, camera.height) != (width, height))
            other += ["fov_deg"] * (not abs(camera.fov_deg - fov_deg) <= _INTRINSIC)
            other += ["K"] * (not np.abs(camera.k - k).max() <= _INTRINSIC)
        if other:
            findings.add(
                "sensor_poses",
                f"calibration.json: {', '.join(other)} of it do not follow from the spec",
                sensor=sensor.id,
            )


def _view(camera: SensorSpec) -> tuple[tuple[int, int], float, FloatArray]:
    """Width and height (px), horizontal field of view (deg) and intrinsics of a planned camera."""
    if camera.lens is not None:
        lens = planned_lens(camera.lens)
        return (lens.width, lens.height), horizontal_fov_deg(lens), lens.k
    width, height, fov_deg = camera_geometry(camera.attributes)
    return (width, height), fov_deg, intrinsics(width, height, fov_deg)


def _is_fixed_on_ego(camera: SensorCalibration) -> bool:
    return camera.attach_to == EGO and camera.attachment == RIGID


def check_readings(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Compare tables of IMU and GNSS with the motion of ego and sensor (check ``readings``)."""
    poses = episode.sensor_poses()
    for sensor in episode.sensors:
        if sensor.kind not in ("imu", "gnss"):
            continue
        kind = row_sensor(sensor.kind)
        if kind is None or not sensor.table.schema.equals(kind.schema):
            continue  # check_row_sensors says so
        own = rows_at(
            poses, [i for i, s in enumerate(entries(poses, "sensor_id")) if s == sensor.id]
        )
        table = sensor.table
        at = {k: i for i, k in enumerate(entries(own, "k"))}
        table = rows_at(table, [i for i, k in enumerate(entries(table, "k")) if k in at])
        own = rows_at(own, [at[k] for k in entries(table, "k")])
        if not len(table):
            continue  # check_row_sensors says so
        name = f"sensors/{sensor.id}.parquet"
        same = Recomputed("readings", name, table, findings, sensor=sensor.id)
        if sensor.kind == "gnss" and "projection" not in episode.document["geo_reference"]:
            continue  # recorded before the convention of its GNSS sensors was kept
        if sensor.kind == "gnss":
            _check_gnss(episode, sensor, table, own, same)
        else:
            _check_imu(episode, sensor, table, own, tables, same)


def _check_gnss(
    episode: Episode, sensor: Sensor, table: pa.Table, own: pa.Table, same: Recomputed
) -> None:
    places = numbers(own, "location", 3)
    frame = episode.geo_frame
    wanted = [frame.gnss_place(place) for place in places]
    noise = _noise(sensor.calibration.attributes, ("lat", "lon", "alt"))
    metre_deg = 180.0 / np.pi / 6.378e6
    for number, (column, expected, metres) in enumerate(
        (
            ("latitude_deg", [p.latitude_deg for p in wanted], metre_deg),
            ("longitude_deg", [p.longitude_deg for p in wanted], 2.0 * metre_deg),
            ("altitude_m", [p.altitude_m for p in wanted], 1.0),
        )
    ):
        same.column(column, expected, _PLACE_M * metres + noise[number])


def _check_imu(
    episode: Episode,
    sensor: Sensor,
    table: pa.Table,
    own: pa.Table,
    tables: LabelTables,
    same: Recomputed,
) -> None:
    attributes = sensor.calibration.attributes
    rotation = numbers(own, "rotation_deg", 3)
    compass = [compass_rad(yaw) for yaw in rotation[:, 1].tolist()]
    same.column("compass_rad", compass, _COMPASS_RAD, period=2.0 * np.pi)
    if episode.spec.ego.is_vehicle:  # what carries the sensors of others has no turn rate
        _check_gyroscope(sensor, own, tables, same)
    spec = episode.spec
    if spec.save_every != 1 or not spec.timing.synchronous:
        return
    place = numbers(own, "location", 3)
    force = np.full((len(table), 3), np.nan)
    ks = own["k"].to_numpy()
    for i in range(2, len(ks)):
        if ks[i] - ks[i - 2] == 2:
            change = (place[i] - 2.0 * place[i - 1] + place[i - 2]) * spec.fps**2
            force[i] = specific_force(rotation[i], change)
    noise = _noise(attributes, ("accel_stddev_x", "accel_stddev_y", "accel_stddev_z"), whole=True)
    # Places are float32: their second difference at 20 Hz is good to some centimetres per s2.
    rounding = 4.0 * np.spacing(np.abs(place).max().astype(np.float32)) * spec.fps**2
    same.column("accelerometer", force, _FORCE_M_S2 + rounding + max(noise))


def _check_gyroscope(sensor: Sensor, own: pa.Table, tables: LabelTables, same: Recomputed) -> None:
    camera = sensor.calibration
    if not _is_fixed_on_ego(camera):
        return
    rows = {row["k"]: row["angular_velocity_ego"] for row in tables.ego.to_pylist()}
    ego = np.array([rows.get(k, [np.nan] * 3) for k in entries(own, "k")])
    # CARLA turns by the sensor's relative rotation forwards, see docs/conventions.md.
    wanted = rotate(camera.ego_from_sensor[None, :3, :3], ego)
    noise = _noise(camera.attributes, ("gyro_stddev_x", "gyro_stddev_y", "gyro_stddev_z"),
                   whole=True)  # fmt: skip
    bias = [abs(float(camera.attributes.get(f"noise_gyro_bias_{axis}", 0.0))) for axis in "xyz"]
    same.column("gyroscope", wanted, _GYRO_RAD_S + max(noise) + max(bias))


def _noise(
    attributes: Mapping[str, str], names: tuple[str, str, str], *, whole: bool = False
) -> list[float]:
    """What noise and bias may add, by axis."""
    if whole:
        return [_SIGMAS * float(attributes.get(f"noise_{name}", 0.0)) for name in names]
    return [
        _SIGMAS * float(attributes.get(f"noise_{name}_stddev", 0.0))
        + abs(float(attributes.get(f"noise_{name}_bias", 0.0)))
        for name in names
    ]
