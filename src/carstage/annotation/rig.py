"""The sensors of an episode that labels depend on: where they are and what they see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from carstage.errors import AnnotationError
from carstage.geometry import (
    FloatArray,
    Lens,
    intrinsics,
    is_pinhole,
    lens_of,
    multiply,
    pose_matrix,
)
from carstage.rawlog.reader import WorldFrame
from carstage.spec import EGO, RIGID, LensSpec, SensorSpec


def camera_geometry(attributes: Mapping[str, str]) -> tuple[int, int, float]:
    """Width and height (px) and horizontal field of view (deg) from a camera's attributes.

    Raises:
        AnnotationError: one is missing or no number; plans always name them.
    """
    try:
        width, height = int(attributes["image_size_x"]), int(attributes["image_size_y"])
        return width, height, float(attributes["fov"])
    except (KeyError, ValueError) as error:
        raise AnnotationError(
            f"A camera's size or field of view is not in its attributes: {error}.",
            "Plan the episode again.",
        ) from error


def planned_lens(spec: LensSpec) -> Lens:
    """The camera model of a sensor as it is planned."""
    return lens_of(
        spec.model,
        (spec.width, spec.height),
        (spec.fx, spec.fy),
        (spec.cx, spec.cy),
        spec.distortion,
        spec.max_angle_deg,
    )


@dataclass(frozen=True, slots=True)
class Mount:
    """A sensor's place on what carries it.

    Attributes:
        sensor_id: its name in the spec.
        actor_id: its actor on the server; None when not recorded.
        attach_to: ``ego``, ``world`` or a pattern of actor types.
        rigid: whether it keeps its place on its carrier.
        carrier_from_sensor: ``(4, 4)``; of a sensor that follows, without the carrier's rotation.
    """

    sensor_id: str
    actor_id: int | None
    attach_to: str
    rigid: bool
    carrier_from_sensor: FloatArray

    @property
    def on_ego(self) -> bool:
        """Whether it sits rigidly on the ego."""
        return self.attach_to == EGO and self.rigid

    @classmethod
    def from_spec(cls, sensor: SensorSpec, actor_ids: Mapping[str, int]) -> Mount:
        """The place of a planned sensor."""
        pose = sensor.pose
        return cls(
            sensor_id=sensor.id,
            actor_id=actor_ids.get(sensor.id),
            attach_to=sensor.attach_to,
            rigid=sensor.attachment == RIGID,
            carrier_from_sensor=pose_matrix(
                [pose.x_m, pose.y_m, pose.z_m], [pose.pitch_deg, pose.yaw_deg, pose.roll_deg]
            ),
        )

    def world_from_sensor(self, world: WorldFrame, world_from_ego: FloatArray) -> FloatArray:
        """``(4, 4)`` pose of this frame: the snapshot's, else the ego's times the mount.

        Raises:
            AnnotationError: the snapshot lacks a sensor that does not sit on the ego.
        """
        if self.actor_id is not None:
            try:
                row = world.row(self.actor_id)
            except KeyError:
                pass
            else:
                return pose_matrix(world.location[row], world.rotation_deg[row])
        if not self.on_ego:
            raise AnnotationError(
                f"Sensor {self.sensor_id} is not in the snapshot of tick {world.tick}, and its "
                "place does not follow from the ego's.",
                "Record the episode again.",
            )
        return multiply(world_from_ego, self.carrier_from_sensor)


@dataclass(frozen=True, slots=True)
class LabelledCamera:
    """A camera that objects are labelled for.

    Attributes:
        mount: where it is.
        width: of the image (px).
        height: of the image (px).
        k: ``(3, 3)`` intrinsics.
        pinhole: no lens distortion, so that ``k`` alone projects.
        depth: stream of the depth camera with the same pose and intrinsics.
        instance: stream of the instance camera, or None.
        lens: the camera model that its pictures are re-projected to; None: a pinhole, or a lens
            of CARLA's own attributes that nothing can be projected by.
    """

    mount: Mount
    width: int
    height: int
    k: FloatArray
    pinhole: bool
    depth: str
    instance: str | None
    lens: Lens | None = None

    @property
    def is_projective(self) -> bool:
        """Whether boxes can be projected."""
        return self.pinhole or self.lens is not None

    @classmethod
    def from_spec(cls, sensor: SensorSpec, actor_ids: Mapping[str, int]) -> LabelledCamera:
        """A labelled camera as it is planned.

        Raises:
            AnnotationError: when it names no depth camera or its attributes are no numbers.
        """
        attributes, depth = sensor.attributes, sensor.depth
        if not depth:
            raise AnnotationError(
                f"Labelled camera {sensor.id} has no depth camera in the spec.",
                "Plan the episode again: labelled cameras get a hidden depth twin.",
            )
        width, height, fov_deg = camera_geometry(attributes)
        try:
            pinhole = is_pinhole(attributes)
        except ValueError as error:
            raise AnnotationError(
                f"An attribute of camera {sensor.id} is not a number: {error}."
            ) from error
        k, lens = intrinsics(width, height, fov_deg), None
        if sensor.lens is not None:
            lens = planned_lens(sensor.lens)
            width, height, k = lens.width, lens.height, lens.k
            pinhole = sensor.lens.is_pinhole
        return cls(
            mount=Mount.from_spec(sensor, actor_ids),
            width=width,
            height=height,
            k=k,
            pinhole=pinhole,
            depth=depth,
            instance=sensor.instance,
            lens=None if pinhole else lens,
        )
