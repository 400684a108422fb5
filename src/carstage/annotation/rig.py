"""The sensors of an episode that labels depend on: where they are and what they see."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from carstage.errors import AnnotationError
from carstage.geometry import FloatArray, intrinsics, pose_matrix
from carstage.rawlog.reader import WorldFrame

# CARLA's defaults; with any other value the image is no pinhole projection.
_PINHOLE_ATTRIBUTES: Final = {
    "lens_circle_falloff": 5.0,
    "lens_circle_multiplier": 0.0,
    "lens_k": -1.0,
    "lens_kcube": 0.0,
    "lens_x_size": 0.08,
    "lens_y_size": 0.08,
}
_DEFAULT_SIZE: Final = ("800", "600")
_DEFAULT_FOV: Final = "90.0"


@dataclass(frozen=True, slots=True)
class Mount:
    """A sensor's place on the ego.

    Attributes:
        sensor_id: its name in the spec.
        actor_id: its actor on the server; None when not recorded.
        ego_from_sensor: ``(4, 4)``.
    """

    sensor_id: str
    actor_id: int | None
    ego_from_sensor: FloatArray

    @classmethod
    def from_spec(cls, sensor: Mapping[str, Any], actor_ids: Mapping[str, int]) -> Mount:
        """Read one entry of ``spec.sensors``."""
        pose: Mapping[str, float] = sensor.get("pose", {})
        location = [pose.get(f"{axis}_m", 0.0) for axis in "xyz"]
        rotation = [pose.get(f"{angle}_deg", 0.0) for angle in ("pitch", "yaw", "roll")]
        return cls(
            sensor_id=sensor["id"],
            actor_id=actor_ids.get(sensor["id"]),
            ego_from_sensor=pose_matrix(location, rotation),
        )

    def world_from_sensor(self, world: WorldFrame, world_from_ego: FloatArray) -> FloatArray:
        """``(4, 4)`` pose of this frame: the snapshot's, else the ego's times the mount."""
        if self.actor_id is not None:
            try:
                row = world.row(self.actor_id)
            except KeyError:
                pass
            else:
                return pose_matrix(world.location[row], world.rotation_deg[row])
        return np.asarray(world_from_ego @ self.ego_from_sensor, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class LabelledCamera:
    """A camera that objects are labelled for.

    Attributes:
        mount: where it is.
        width: of the image (px).
        height: of the image (px).
        k: ``(3, 3)`` intrinsics.
        pinhole: no lens distortion, so that boxes can be projected.
        depth: stream of the depth camera with the same pose and intrinsics.
        instance: stream of the instance camera, or None.
    """

    mount: Mount
    width: int
    height: int
    k: FloatArray
    pinhole: bool
    depth: str
    instance: str | None

    @classmethod
    def from_spec(cls, sensor: Mapping[str, Any], actor_ids: Mapping[str, int]) -> LabelledCamera:
        """Read one labelled entry of ``spec.sensors``.

        Raises:
            AnnotationError: when it names no depth camera or its attributes are no numbers.
        """
        attributes: Mapping[str, str] = sensor.get("attributes", {})
        depth = sensor.get("depth")
        if not depth:
            raise AnnotationError(
                f"Labelled camera {sensor['id']} has no depth camera in the spec.",
                "Plan the episode again: labelled cameras get a hidden depth twin.",
            )
        try:
            width = int(attributes.get("image_size_x", _DEFAULT_SIZE[0]))
            height = int(attributes.get("image_size_y", _DEFAULT_SIZE[1]))
            fov_deg = float(attributes.get("fov", _DEFAULT_FOV))
            pinhole = all(
                float(attributes.get(name, default)) == default
                for name, default in _PINHOLE_ATTRIBUTES.items()
            )
        except ValueError as error:
            raise AnnotationError(
                f"An attribute of camera {sensor['id']} is not a number: {error}."
            ) from error
        return cls(
            mount=Mount.from_spec(sensor, actor_ids),
            width=width,
            height=height,
            k=intrinsics(width, height, fov_deg),
            pinhole=pinhole,
            depth=depth,
            instance=sensor.get("instance"),
        )
