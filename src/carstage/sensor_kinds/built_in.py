"""The kinds that Car-STAGE brings; the order is that of the reference and of the interface.

Bytes per pixel in the dataset are on the safe side. They come from measured 1280x720 images: noisy
photographs for colours, procedural labels and depth.
"""

from __future__ import annotations

from typing import Any

from carstage.releases import Release
from carstage.sensor_kinds.attributes import (
    CAMERA,
    COLOUR_CAMERA,
    FLASH_LIDAR,
    FLOW_CAMERA,
    GNSS,
    IMU,
    LIDAR,
    RADAR,
    RAY_FLASH_LIDAR,
    RCS_RADAR,
    SEMANTIC_LIDAR,
    V2X,
)
from carstage.sensor_kinds.model import (
    COLOUR,
    DEPTH,
    DETECTIONS,
    FLOW,
    INSTANCES,
    MESSAGES,
    NORMALS,
    POINTS,
    READING,
    TAGGED_POINTS,
    TAGS,
    VOXELS,
    AttributeSet,
    Column,
    SensorKind,
)

BGRA = tuple(Column(name, "|u1") for name in "bgra")
"""A pixel of a picture, as the client hands it out."""

_CODECS = "carstage.codecs."
_RAYS = "carstage.collector.sensors.rays:"
_INERTIAL = "carstage.collector.sensors.inertial:"


def _camera(name: str, blueprint: str, content: str, **rest: Any) -> SensorKind:
    """A camera; those that show no colours are ground truth."""
    row = {
        "attributes": CAMERA,
        "columns": BGRA,
        "collector": "carstage.collector.sensors.cameras:Camera",
        "twins": ("depth", "instance"),
        "modality": "truth",
        "icon": "camera",
        "field_of_view": "pyramid",
        **rest,
    }
    return SensorKind(name=name, blueprint="sensor.camera." + blueprint, content=content, **row)


def _floats(*names: str) -> Any:
    return tuple(Column(name, "<f4") for name in names)


_POINT = _floats("x", "y", "z", "intensity")
_POINT_CODECS = {
    "bin": _CODECS + "points:LidarBin",
    "laz": _CODECS + "points:LidarLaz",
    "npz": _CODECS + "points:LidarNpz",
    "pcd": _CODECS + "points:LidarPcd",
    "ply": _CODECS + "points:LidarPly",
}
_FLASH_TAGGED_CODECS = {
    "bin": _CODECS + "points:TaggedLidarBin",
    "npz": _CODECS + "points:TaggedLidarNpz",
    "pcd": _CODECS + "points:TaggedLidarPcd",
    "ply": _CODECS + "points:TaggedLidarPly",
}
_FLASH_TAGGED_POINT = (*_POINT, *_floats("object_idx", "object_tag"))
_TAGGED_POINT = (
    *_floats("x", "y", "z", "cos_incidence"),
    Column("object_idx", "<u4"),
    Column("object_tag", "<u4"),
)
_DETECTION = _floats("range_rate_m_s", "azimuth_rad", "altitude_rad", "depth_m")
_SWEEP_POINT = _floats(
    *("x", "y", "z", "intensity", "time_s", "ring"),
    *("x_measured", "y_measured", "z_measured"),
)

BUILT_IN = (
    _camera(
        "rgb",
        "rgb",
        COLOUR,
        title="Camera (RGB)",
        short="CAM",
        description="Colour camera.",
        summary="A colour camera.",
        attributes=COLOUR_CAMERA,
        codecs={
            "png": _CODECS + "images:RgbRunsPng",
            "fpng": _CODECS + "images:RgbFpng",
            "jpeg": _CODECS + "images:RgbJpeg",
            "png-small": _CODECS + "images:RgbPng",
        },
        file_bytes=1.8,
        modality="camera",
    ),
    _camera(
        "depth",
        "depth",
        DEPTH,
        title="Depth camera",
        short="DEPTH",
        description="Depth camera.",
        summary="A depth camera: distance along the optical axis.",
        codecs={
            "png": _CODECS + "depth:DepthPng",
            "exr": _CODECS + "depth:DepthExr",
            "npz": _CODECS + "depth:DepthNpz",
            "npz16": _CODECS + "depth:DepthNpz16",
            "png16": _CODECS + "depth:DepthPng16",
        },
        file_bytes=0.8,
    ),
    _camera(
        "semantic",
        "semantic_segmentation",
        TAGS,
        title="Semantic camera",
        short="SEMANTIC",
        description="Semantic segmentation camera.",
        summary="A semantic segmentation camera: a tag per pixel.",
        codecs={"png": _CODECS + "images:SemanticPng"},
        file_bytes=0.05,
    ),
    _camera(
        "instance",
        "instance_segmentation",
        INSTANCES,
        title="Instance camera",
        short="INSTANCE",
        description="Instance segmentation camera.",
        summary="An instance segmentation camera: a tag and an object per pixel.",
        codecs={"png": _CODECS + "images:InstancePng"},
        file_bytes=0.08,
    ),
    _camera(
        "flow",
        "optical_flow",
        FLOW,
        attributes=FLOW_CAMERA,
        title="Optical flow",
        short="FLOW",
        description="Optical flow camera.",
        summary="An optical flow camera: how far each pixel's surface moved since the last step.",
        columns=_floats("x", "y"),
        codecs={"npz": _CODECS + "flow:FlowNpz", "kitti": _CODECS + "flow:FlowKittiPng"},
        file_bytes=6.0,
    ),
    _camera(
        "normals",
        "normals",
        NORMALS,
        title="Surface normals",
        short="NORMALS",
        description="Camera of surface normals.",
        summary="A camera of surface normals.",
        codecs={"png": _CODECS + "images:RgbPng"},
        file_bytes=1.2,
        since=Release(0, 9, 14),
    ),
    SensorKind(
        name="lidar",
        blueprint="sensor.lidar.ray_cast",
        content=POINTS,
        title="LiDAR",
        short="LIDAR",
        description="Rotating LiDAR.",
        summary="A rotating ray-cast LiDAR.",
        attributes=LIDAR,
        collector=_RAYS + "Lidar",
        columns=_POINT,
        codecs=_POINT_CODECS,
        modality="lidar",
        icon="lidar",
        field_of_view="sweep",
    ),
    SensorKind(
        name="semantic_lidar",
        blueprint="sensor.lidar.ray_cast_semantic",
        content=TAGGED_POINTS,
        title="Semantic LiDAR",
        short="SEMLIDAR",
        description="Semantic LiDAR.",
        summary="A rotating LiDAR whose points know the object that they hit.",
        attributes=SEMANTIC_LIDAR,
        collector=_RAYS + "Lidar",
        columns=_TAGGED_POINT,
        codecs={
            "bin": _CODECS + "semantic_points:SemanticLidarBin",
            "npz": _CODECS + "semantic_points:SemanticLidarNpz",
        },
        modality="lidar",
        icon="lidar",
        field_of_view="sweep",
    ),
    SensorKind(
        name="sweeping_lidar",
        blueprint="sensor.lidar.ray_cast_sweeping",
        content=POINTS,
        title="Sweeping LiDAR",
        short="SWEEP",
        description="LiDAR that moves while it turns.",
        summary="A rotating LiDAR whose points are each measured at their own instant; the "
        "embedded simulator has it.",
        attributes=LIDAR,
        collector=_RAYS + "SweepingLidar",
        columns=_SWEEP_POINT,
        recorded=_TAGGED_POINT,
        codecs={
            "bin": _CODECS + "sweep_points:SweepBin",
            "npz": _CODECS + "sweep_points:SweepNpz",
        },
        modality="lidar",
        icon="lidar",
        field_of_view="sweep",
    ),
    SensorKind(
        name="flash_lidar",
        blueprint="sensor.camera.depth",
        content=POINTS,
        title="Flash LiDAR",
        short="FLASH",
        description="Flash LiDAR.",
        summary="A LiDAR whose beams all measure in one instant, made of depth pictures.",
        attributes=FLASH_LIDAR,
        collector="carstage.collector.sensors.cameras:Camera",
        columns=_POINT,
        recorded=BGRA,
        codecs=_POINT_CODECS,
        modality="lidar",
        icon="lidar",
        field_of_view="cone",
    ),
    SensorKind(
        name="ray_flash_lidar",
        blueprint="sensor.lidar.ray_cast_flash",
        content=POINTS,
        title="Flash LiDAR by rays",
        short="RAYFLASH",
        description="Flash LiDAR by rays.",
        summary="A flash LiDAR whose beams are rays; the embedded simulator has it.",
        attributes=RAY_FLASH_LIDAR,
        collector=_RAYS + "FlashRays",
        columns=_POINT,
        recorded=_TAGGED_POINT,
        codecs=_POINT_CODECS,
        modality="lidar",
        icon="lidar",
        field_of_view="cone",
    ),
    SensorKind(
        name="semantic_flash_lidar",
        blueprint="sensor.camera.depth",
        content=POINTS,
        title="Semantic flash LiDAR",
        short="SEMFLASH",
        description="Semantic flash LiDAR.",
        summary="A flash LiDAR whose points know the object that they hit, made of depth and "
        "instance pictures.",
        attributes=FLASH_LIDAR,
        collector="carstage.collector.sensors.cameras:Camera",
        columns=_FLASH_TAGGED_POINT,
        recorded=BGRA,
        codecs=_FLASH_TAGGED_CODECS,
        modality="lidar",
        icon="lidar",
        field_of_view="cone",
    ),
    SensorKind(
        name="semantic_ray_flash_lidar",
        blueprint="sensor.lidar.ray_cast_flash",
        content=POINTS,
        title="Semantic flash LiDAR by rays",
        short="SEMRAYFLASH",
        description="Semantic flash LiDAR by rays.",
        summary="A flash LiDAR by rays whose points know the object that they hit; the embedded "
        "simulator has it.",
        attributes=RAY_FLASH_LIDAR,
        collector=_RAYS + "FlashRays",
        columns=_FLASH_TAGGED_POINT,
        recorded=_TAGGED_POINT,
        codecs=_FLASH_TAGGED_CODECS,
        modality="lidar",
        icon="lidar",
        field_of_view="cone",
    ),
    SensorKind(
        name="radar",
        blueprint="sensor.other.radar",
        content=DETECTIONS,
        title="Radar",
        short="RADAR",
        description="Radar.",
        summary="A radar: distance, direction and range rate of what its rays hit.",
        attributes=RADAR,
        collector=_RAYS + "Radar",
        columns=_DETECTION,
        modality="radar",
        icon="radar",
        field_of_view="cone",
    ),
    SensorKind(
        name="rcs_radar",
        blueprint="sensor.other.radar_rcs",
        content=DETECTIONS,
        title="Radar with RCS",
        short="RCSRADAR",
        description="Radar with cross sections.",
        summary="A radar whose detections have radar cross sections; the embedded simulator has "
        "it.",
        attributes=RCS_RADAR,
        collector=_RAYS + "Radar",
        columns=(*_DETECTION, *_floats("rcs_dbsm", "object_tag")),
        modality="radar",
        icon="radar",
        field_of_view="cone",
    ),
    SensorKind(
        name="imu",
        blueprint="sensor.other.imu",
        content=READING,
        title="IMU",
        short="IMU",
        description="Inertial measurement unit.",
        summary="An inertial measurement unit: acceleration, turn rate, compass.",
        attributes=IMU,
        collector=_INERTIAL + "Imu",
        columns=(
            Column("accelerometer", "<f8", 3),
            Column("gyroscope", "<f8", 3),
            Column("compass_rad", "<f8"),
        ),
    ),
    SensorKind(
        name="gnss",
        blueprint="sensor.other.gnss",
        content=READING,
        title="GNSS",
        short="GNSS",
        description="Satellite receiver.",
        summary="A satellite receiver: latitude, longitude, altitude.",
        attributes=GNSS,
        collector=_INERTIAL + "Gnss",
        columns=tuple(
            Column(name, "<f8") for name in ("latitude_deg", "longitude_deg", "altitude_m")
        ),
    ),
    SensorKind(
        name="v2x",
        blueprint="sensor.other.v2x",
        content=MESSAGES,
        title="V2X",
        short="V2X",
        description="Vehicle-to-everything radio.",
        summary="A radio that sends cooperative awareness messages and records those of others.",
        attributes=V2X,
        collector="carstage.collector.sensors.radio:V2x",
        columns=tuple(
            Column(name, "<f8")
            for name in (
                "station_id",
                "station_type",
                "generation_delta_time_ms",
                "latitude_deg",
                "longitude_deg",
                "heading_deg",
                "speed_m_s",
                "drive_direction",
                "length_m",
                "width_m",
                "acceleration_x_m_s2",
                "acceleration_y_m_s2",
                "acceleration_z_m_s2",
                "yaw_rate_deg_s",
                "power_dbm",
            )
        ),
        since=Release(0, 9, 16),
    ),
)

FOR_LABELS = (
    SensorKind(
        name="occupancy",
        blueprint="sensor.other.occupancy",
        content=VOXELS,
        title="Occupancy",
        short="VOXELS",
        description="Occupied voxels of the embedded simulator.",
        summary="Voxels that surfaces of the world pass through; the embedded simulator has it.",
        attributes=AttributeSet("OccupancyAttributes", "Planned from labels.occupancy.", ()),
        collector=_RAYS + "Occupancy",
        columns=_TAGGED_POINT,
        modality="truth",
    ),
)
"""Kinds that no rig has: labels that ask for them get a hidden sensor."""
