"""The sensors of an episode: the requested ones, and those that labels need.

A label needs the depth (and, for pixels, the instances) that its camera sees. A requested sensor of
the same pose and intrinsics serves; where there is none, a hidden twin is added. Points of a
labelled LiDAR take the labels of a semantic LiDAR that scans alike, which is part of the dataset.
A flash LiDAR whose points have tags has hidden instance cameras beside its depth cameras.
Exact voxels are asked of a hidden sensor at their frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from carstage.config import Config, Sensor
from carstage.config.attributes import FlashAttributes, carla_text
from carstage.config.occupancy import Occupancy
from carstage.config.sensors import (
    INSTANCE_SUFFIX,
    SEMANTIC_SUFFIX,
    VOXELS_SUFFIX,
    CameraSensor,
    Pose,
)
from carstage.geometry.lens_sources import face_rotation_deg
from carstage.sensor_kinds import sensor_kind
from carstage.sensor_kinds.attributes import SEMANTIC_LIDAR
from carstage.spec import PoseSpec, SensorSpec
from carstage.spec.lenses import FACES
from carstage.spec.occupancy import LENGTHS
from carstage.spec.sensors import face_of

_RATE = "sensor_tick"
_DEPTH = "depth"
_INSTANCE = "instance"
_SEMANTIC_LIDAR = "semantic_lidar"
_OCCUPANCY = "occupancy"
_SCAN = frozenset(row.carla for row in SEMANTIC_LIDAR.rows)
_GEOMETRY = ("image_size_", "fov", "lens_", "rolling_shutter_")
_NO_GEOMETRY = ("lens_flare_intensity",)


def plan_sensors(config: Config) -> tuple[SensorSpec, ...]:
    """Requested sensors in the rig's order, then the twins."""
    labelled = set(config.labelled_cameras)
    sensors = [_sensor(sensor, config, sensor.id in labelled) for sensor in config.sensors]
    by_depth_alone = config.labels.method == "stage_vo"
    for position, camera in enumerate(list(sensors)):
        if camera.labelled:
            names = {
                kind: _serving(camera, kind, sensors, f".{kind}")
                for kind in sensor_kind(camera.kind).twins
                if kind == _DEPTH or not by_depth_alone
            }
            sensors[position] = replace(
                camera, depth=names.get(_DEPTH), instance=names.get("instance")
            )
    for lidar in [sensor for sensor in sensors if sensor.id in config.labelled_lidars]:
        _serving(lidar, _SEMANTIC_LIDAR, sensors, SEMANTIC_SUFFIX, hidden=False)
    for position, flash in enumerate(list(sensors)):
        if sensor_kind(flash.kind).tags_points and flash.blueprint == sensor_kind(_DEPTH).blueprint:
            instance = _serving(flash, _INSTANCE, sensors, INSTANCE_SUFFIX)
            sensors[position] = replace(flash, instance=instance)
    if config.labels.occupancy is not None and config.labels.occupancy.exact:
        sensors.append(_voxels(config.labels.occupancy, sensors))
    return tuple(_with_faces(sensors))


def _voxels(asked: Occupancy, sensors: Sequence[SensorSpec]) -> SensorSpec:
    """The hidden sensor that says which voxels are occupied, where their frame is."""
    row = sensor_kind(_OCCUPANCY)
    found = SensorSpec(
        id=asked.frame + VOXELS_SUFFIX,
        kind=row.name,
        blueprint=row.blueprint,
        hidden=True,
        labelled=False,
        pose=PoseSpec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        attributes={name.removesuffix("_m"): carla_text(getattr(asked, name)) for name in LENGTHS},
    )
    for one in sensors:
        if one.id == asked.frame:
            return replace(
                found,
                pose=one.pose,
                attach_to=one.attach_to,
                attach_index=one.attach_index,
                attachment=one.attachment,
            )
    return found


def geometry(attributes: Mapping[str, str]) -> dict[str, str]:
    """The attributes that decide which ray a pixel stands for, and of when."""
    return {
        name: text
        for name, text in attributes.items()
        if name.startswith(_GEOMETRY) and name not in _NO_GEOMETRY
    }


def _sensor(sensor: Sensor, config: Config, labelled: bool) -> SensorSpec:
    lens, attributes = None, sensor.attributes
    if isinstance(sensor, CameraSensor) and sensor.lens is not None:
        lens = sensor.lens.spec(sensor.picture_size(config.image_size))
    source = sensor.source(config.image_size)
    faces = None if source is None else source.faces[1:] or None
    return SensorSpec(
        id=sensor.id,
        kind=sensor.kind,
        blueprint=sensor.row.blueprint,
        hidden=False,
        labelled=labelled,
        pose=pose_spec(sensor.pose),
        attributes=_attributes(sensor, config),
        attach_to=sensor.attach_to,
        attach_index=sensor.attach_index,
        attachment=sensor.attachment,
        lens=lens,
        faces=None if faces is None else _face_ids(sensor.id, faces),
        flash=attributes.spec() if isinstance(attributes, FlashAttributes) else None,
    )


def _face_ids(sensor_id: str, faces: Iterable[str]) -> tuple[str, ...]:
    return tuple(f"{sensor_id}.{face[0]}" for face in faces)


def _with_faces(sensors: list[SensorSpec]) -> Iterator[SensorSpec]:
    """The sensors, and after them the hidden ones that record the other faces of cubes."""
    yield from sensors
    for sensor in sensors:
        for face_id in sensor.faces or ():
            face = next(name for name in FACES if name[0] == face_id[-1])
            pose = sensor.pose
            mounted = (pose.pitch_deg, pose.yaw_deg, pose.roll_deg)
            pitch_deg, yaw_deg, roll_deg = face_rotation_deg(mounted, face)
            yield replace(
                sensor,
                id=face_id,
                kind=sensor.kind if sensor.flash is None else _DEPTH,
                hidden=True,
                labelled=False,
                pose=replace(pose, pitch_deg=pitch_deg, yaw_deg=yaw_deg, roll_deg=roll_deg),
                depth=None,
                instance=None,
                lens=None,
                faces=None,
                flash=None,
            )


def _attributes(sensor: Sensor, config: Config) -> dict[str, str]:
    strings = sensor.carla(fps=config.fps, image_size=config.image_size)
    if sensor.rate_hz is not None:
        strings[_RATE] = carla_text(1.0 / sensor.rate_hz)
    return strings


def pose_spec(pose: Pose) -> PoseSpec:
    """A pose as the specification has it."""
    # Adding 0.0 turns -0.0 into 0.0: one pose must not have two ids.
    return PoseSpec(
        x_m=pose.x + 0.0,
        y_m=pose.y + 0.0,
        z_m=pose.z + 0.0,
        roll_deg=pose.roll_deg + 0.0,
        pitch_deg=pose.pitch_deg + 0.0,
        yaw_deg=pose.yaw_deg + 0.0,
    )


def _shared(attributes: Mapping[str, str]) -> dict[str, str]:
    """What a twin has in common with its sensor: along which rays, and when it measures."""
    along = {name: text for name, text in attributes.items() if name in _SCAN or name == _RATE}
    return {**geometry(attributes), **along}


def _view(sensor: SensorSpec) -> tuple[object, ...]:
    """Equal for sensors that see the same at the same time."""
    carrier = (sensor.attach_to, sensor.attach_index, sensor.attachment)
    faces = tuple(face_id[-1] for face_id in sensor.faces or ())
    return (*carrier, sensor.pose, sensor.lens, faces, _shared(sensor.attributes))


def _serving(
    sensor: SensorSpec, kind: str, sensors: list[SensorSpec], suffix: str, hidden: bool = True
) -> str:
    """Id of the sensor of ``kind`` that sees what ``sensor`` sees; appended if there is none."""
    if sensor.kind == kind:
        return sensor.id
    for other in sensors:
        if other.kind == kind and _view(other) == _view(sensor):
            return other.id
    twin = replace(
        sensor,
        id=sensor.id + suffix,
        kind=kind,
        blueprint=sensor_kind(kind).blueprint,
        hidden=hidden,
        labelled=False,
        attributes=_shared(sensor.attributes),
        depth=None,
        instance=None,
        faces=_renamed(sensor, suffix),
        flash=None,
    )
    sensors.append(twin)
    return twin.id


def _renamed(sensor: SensorSpec, suffix: str) -> tuple[str, ...] | None:
    """Faces of a twin, by those of its sensor."""
    if sensor.faces is None:
        return None
    return tuple(face_of(sensor.id + suffix, face_id) for face_id in sensor.faces)
