"""From a frame of a dataset to the records of its MCAP file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.saved_frames import Frame, Row
from carstage.exporters.axes import (
    enu_pose,
    flu_angular_velocity,
    flu_from_optical,
    flu_pose,
    flu_vector,
    nuscenes_box,
    radar_points,
)
from carstage.exporters.fixes import satellite_fix
from carstage.exporters.formats.mcap_records import (
    EGO,
    MAP,
    RADAR_POINT,
    CameraModel,
    Cloud,
    CodedPicture,
    EgoState,
    Inertial,
    Labels,
    ObjectBox,
    Objects,
    Pixels,
    Position,
    Record,
    Transforms,
    Values,
)
from carstage.exporters.labels import boxed_objects, camera_labels
from carstage.exporters.lenses import has_named_model
from carstage.exporters.options import ExportOptions
from carstage.geometry import pose_matrix
from carstage.report.drawing import camera_view
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.columns import Detection, Instance
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
)
from carstage.tags import tag_table

_CODED: Final = {".png": "png", ".jpg": "jpeg"}
_PALETTE: Final = {value: tag.rgb for value, tag in tag_table("0.9.16").items()}


def frame_records(frame: Frame, options: ExportOptions) -> Iterator[Record]:
    """Everything of a frame; sensors without data in it give nothing.

    Args:
        frame: the frame.
        options: with classes; they choose among the objects, never among the sensors.

    Raises:
        DatasetError: a file is missing or damaged, or no table holds the ego's pose.
    """
    yield _transforms(frame)
    yield Objects(tuple(_boxes(frame, options)))
    if frame.ego is not None:
        yield _ego(frame.ego)
    for sensor in frame.episode.sensors:
        if not frame.has(sensor.id):
            continue
        yield from CONTENTS[sensor.content](frame, sensor.id)
        camera = sensor.calibration
        if camera.is_camera and has_named_model(camera):
            yield CameraModel(camera)
        if camera.labelled and camera.is_projective and frame.has_labelled(sensor.id):
            yield _labels(frame, sensor.id, options)


def _transforms(frame: Frame) -> Transforms:
    poses = [(MAP, EGO, enu_pose(frame.world_from_ego))]
    for sensor in frame.episode.sensors:
        if sensor.id in frame.sensor_poses:
            turned = flu_from_optical if sensor.calibration.is_camera else flu_pose
            poses.append((EGO, sensor.id, turned(frame.ego_from_sensor(sensor.id))))
    return Transforms(tuple(poses))


def _boxes(frame: Frame, options: ExportOptions) -> Iterator[ObjectBox]:
    for row in boxed_objects(frame, options):
        name = _name(row, options)
        if name is not None:
            pose = pose_matrix(row["box_center"], row["box_rotation_deg"])
            yield ObjectBox(name, row, nuscenes_box(pose, row["box_extent"]))


def _name(row: Row, options: ExportOptions) -> str | None:
    """What the export calls the class of an object; ``None``: its class map leaves it out."""
    if options.class_map is None:
        return str(row["class"])
    target = options.class_map.target(row["class"], row["blueprint"])
    return None if target is None else target.name


def _labels(frame: Frame, camera: str, options: ExportOptions) -> Labels:
    named = (
        (_name(label.object, options), label) for label in camera_labels(frame, camera, options)
    )
    return Labels(camera, tuple((name, label) for name, label in named if name is not None))


def _ego(row: Row) -> EgoState:
    acceleration = row["acceleration_ego"]
    return EgoState(
        row,
        enu_pose(pose_matrix(row["location"], row["rotation_deg"])),
        flu_vector(row["velocity_ego"]),
        None if acceleration is None else flu_vector(acceleration),
        flu_angular_velocity(row["angular_velocity_ego"]),
    )


def _colours(frame: Frame, camera: str) -> Iterator[Record]:
    """The recorded file where viewers know its format, else its pixels."""
    path = frame.image_file(camera)
    if path.suffix in _CODED:
        yield CodedPicture(camera, path.read_bytes(), _CODED[path.suffix])
    else:
        pixels = frame.read(camera)
        yield Pixels(camera, "image", "mono8" if pixels.ndim == 2 else "rgb8", pixels)


def _depth(frame: Frame, camera: str) -> Iterator[Record]:
    yield Pixels(camera, "image", "32FC1", frame.read(camera).astype("<f4"))


def _tags(frame: Frame, camera: str) -> Iterator[Record]:
    tags = frame.read(camera)
    yield Pixels(camera, "image", "mono8", tags)
    yield _view(camera, TAGS, tags)


def _instances(frame: Frame, camera: str) -> Iterator[Record]:
    pixels = frame.read(camera)
    yield Pixels(camera, "image", "mono16", pixels[..., Instance.ID].astype("<u2"))
    yield Pixels(camera, "tags", "mono8", pixels[..., Instance.TAG].astype(np.uint8))
    yield _view(camera, INSTANCES, pixels)


def _flow(frame: Frame, camera: str) -> Iterator[Record]:
    flow = frame.read(camera)
    for axis, what in enumerate(("right", "down")):
        yield Pixels(camera, what, "32FC1", flow[..., axis].astype("<f4"))
    yield _view(camera, FLOW, flow)


def _view(camera: str, content: str, data: NDArray[Any]) -> Pixels:
    """Colours for people, where the numbers themselves look black."""
    return Pixels(camera, "colors", "rgb8", np.asarray(camera_view(content, data, _PALETTE)))


def _points(frame: Frame, lidar: str) -> Iterator[Record]:
    points = frame.read(lidar).copy()
    names = _names(frame, lidar, points.shape[1])
    points[:, [1, *(i for i, name in enumerate(names) if name == "y_measured")]] *= -1
    yield Cloud(lidar, _structured(points, names))


def _tagged_points(frame: Frame, lidar: str) -> Iterator[Record]:
    points = frame.read(lidar).copy()
    points["y"] *= -1
    yield Cloud(lidar, points)


def _detections(frame: Frame, radar: str) -> Iterator[Record]:
    found = frame.read(radar)
    names = tuple(column.name for column in sensor_kind("radar").columns)
    own = _names(frame, radar, found.shape[1])
    if own[: len(names)] != names:
        yield Cloud(radar, _structured(found, own))
        return
    places, _ = radar_points(found)
    columns = [
        found[:, Detection.RANGE_RATE], -found[:, Detection.AZIMUTH],
        found[:, Detection.ALTITUDE], found[:, Detection.DEPTH],
    ]  # fmt: skip
    rows = np.column_stack([places, *columns, found[:, len(names) :]])
    yield Cloud(radar, _structured(rows, (*(RADAR_POINT.names or ()), *own[len(names) :])))


def _reading(frame: Frame, sensor: str) -> Iterator[Record]:
    values = frame.read(sensor)
    kind = sensor_kind(frame.episode.sensor(sensor).kind)
    if kind.name == "imu":
        acceleration, turn = flu_vector(values[:3]), flu_angular_velocity(values[3:6])
        yield Inertial(sensor, acceleration, turn, float(values[6]))
    elif kind.name == "gnss":
        place = satellite_fix(frame, sensor)
        yield Position(sensor, place.latitude_deg, place.longitude_deg, place.altitude_m)
    else:
        names = (
            column.name if column.count == 1 else f"{column.name}[{index}]"
            for column in kind.columns
            for index in range(column.count)
        )
        yield Values(sensor, tuple(names), tuple(float(value) for value in values))


def _messages(frame: Frame, sensor: str) -> Iterator[Record]:
    """One record for each message that was received; none in most frames."""
    names = tuple(column.name for column in sensor_kind(frame.episode.sensor(sensor).kind).columns)
    for message in frame.read(sensor):
        yield Values(sensor, names, tuple(float(value) for value in message))


def _names(frame: Frame, sensor: str, count: int) -> tuple[str, ...]:
    """Names of the columns of a sensor's array."""
    columns = sensor_kind(frame.episode.sensor(sensor).kind).columns
    names = tuple(column.name for column in columns)
    return names if len(names) == count else tuple(f"column_{index}" for index in range(count))


def _structured(rows: NDArray[Any], names: tuple[str, ...]) -> NDArray[Any]:
    """``(N, columns)`` numbers as ``(N,)`` records of float32 with these names."""
    packed = np.ascontiguousarray(rows, "<f4")
    return packed.view(np.dtype([(name, "<f4") for name in names])).reshape(len(rows))


CONTENTS: Final[Mapping[str, Callable[[Frame, str], Iterator[Record]]]] = {
    COLOUR: _colours,
    DEPTH: _depth,
    TAGS: _tags,
    INSTANCES: _instances,
    FLOW: _flow,
    NORMALS: _colours,
    POINTS: _points,
    TAGGED_POINTS: _tagged_points,
    DETECTIONS: _detections,
    READING: _reading,
    MESSAGES: _messages,
}
"""What a sensor gives, by the content of its kind."""
