"""The rig of an episode as its calibration document has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carstage.codecs import codec_for
from carstage.errors import DatasetError
from carstage.geometry import (
    Z_NEAR_M,
    BrownConrady,
    FloatArray,
    Lens,
    back_project,
    is_pinhole,
    lens_mask,
    lens_of,
    pixel_rays,
    project,
)
from carstage.sensor_kinds import content_of
from carstage.spec import FlashSpec
from carstage.spec.fields import Fields


@dataclass(frozen=True, slots=True)
class SensorCalibration:
    """One sensor of a rig.

    Attributes:
        id: the user's name of it.
        kind: short name of the kind, such as ``rgb``.
        blueprint: CARLA's blueprint id.
        attributes: the blueprint's attributes as they were set.
        attach_to: ``ego``, ``world`` or a pattern of actor types.
        attachment: ``rigid``, ``follow`` or a spring arm.
        carrier_from_sensor: ``(4, 4)`` pose on what carries it, on the map for ``world``.
        ego_from_sensor: ``(4, 4)`` pose on the ego vehicle, CARLA's left-handed axes (m); NaN
            where it changes from frame to frame, see ``Sensor.calibration_at``.
        codec: name of the codec of its files.
        labelled: whether ``camera_objects.parquet`` has rows of it.
        depth: the depth sensor of the dataset with the same pose and intrinsics, if there is one.
        instance: the instance sensor likewise.
        width, height: size of the image (px); 0 for what is no camera.
        fov_deg: horizontal field of view; 0 for what is no camera.
        k: ``(3, 3)`` intrinsics; zeros for what is no camera.
        lens: the camera model that its pictures were re-projected to; None: CARLA's own.
        flash: of a flash LiDAR: what it measures.
        attach_index: which actor of the pattern carries it, by distance from the ego at the start.
    """

    id: str
    kind: str
    blueprint: str
    attributes: Mapping[str, str]
    attach_to: str
    attachment: str
    carrier_from_sensor: NDArray[np.float64]
    ego_from_sensor: NDArray[np.float64]
    codec: str
    labelled: bool
    depth: str | None
    instance: str | None
    width: int
    height: int
    fov_deg: float
    k: NDArray[np.float64]
    lens: Lens | None = None
    flash: FlashSpec | None = None
    attach_index: int = 0

    @property
    def content(self) -> str:
        """What a frame is, as the table of sensor kinds has it; empty for an unknown kind."""
        return content_of(self.kind)

    @property
    def is_camera(self) -> bool:
        """Whether it takes images."""
        return self.width > 0

    @property
    def on_ego(self) -> bool:
        """Whether it sits rigidly on the ego vehicle."""
        return self.attach_to == "ego" and self.attachment == "rigid"

    @property
    def is_pinhole(self) -> bool:
        """Whether it is a camera without lens distortion."""
        if self.lens is not None:
            return isinstance(self.lens, BrownConrady) and self.lens.is_pinhole
        return self.is_camera and is_pinhole(self.attributes)

    @property
    def is_projective(self) -> bool:
        """Whether points of the world can be projected into its pictures."""
        return self.is_pinhole or self.lens is not None

    @property
    def bent(self) -> Lens | None:
        """The camera model where ``k`` alone does not project; None of a pinhole."""
        return None if self.is_pinhole else self.lens

    def project(self, points_optical: ArrayLike, z_near_m: float = Z_NEAR_M) -> FloatArray:
        """Pixel coordinates ``(..., 2)`` of points ``(..., 3)`` in optical axes.

        NaN where the camera cannot show them. Only where :attr:`is_projective`.

        Args:
            points_optical: x right, y down, z forward (m).
            z_near_m: the near plane of a pinhole.
        """
        if self.bent is None:
            return project(points_optical, self.k, z_near_m)
        return self.bent.project(points_optical)

    def back_project(self, uv: ArrayLike, depth_m: ArrayLike) -> FloatArray:
        """Points ``(..., 3)`` in optical axes of pixel coordinates with the picture's depth (m).

        NaN outside a lens's image circle. Only where :attr:`is_projective`.
        """
        if self.bent is None:
            return back_project(uv, depth_m, self.k)
        return self.bent.rays(uv) * np.asarray(depth_m, dtype=np.float64)[..., None]

    def pixel_rays(self) -> FloatArray:
        """``(H, W, 3)`` rays of all pixels in optical axes; NaN outside a lens's image circle.

        A ray times the depth of its pixel is the point. Only where :attr:`is_projective`.
        """
        return pixel_rays(self.lens_model)

    def mask(self) -> NDArray[np.bool_]:
        """``(H, W)`` which pixels show something; the others lie outside the image circle."""
        return lens_mask(self.lens_model)

    @property
    def lens_model(self) -> Lens:
        """The camera model, also that of a plain pinhole.

        Raises:
            DatasetError: it has CARLA's own lens distortion, or is no camera.
        """
        if self.lens is not None:
            return self.lens
        if not self.is_pinhole:
            raise DatasetError(f"{self.id} has no camera model that projects.")
        (fx, _, cx), (_, fy, cy), _ = self.k.tolist()
        return lens_of("pinhole", (self.width, self.height), (fx, fy), (cx, cy))

    @property
    def is_lossless(self) -> bool:
        """Whether its files hold exactly what was measured."""
        return codec_for(self.kind, self.codec)[1].lossless

    @property
    def carried(self) -> tuple[str, int, str]:
        """What carries it, and how: equal for sensors that keep their places to each other."""
        return self.attach_to, self.attach_index, self.attachment

    def shares_view(self, other: SensorCalibration) -> bool:
        """Whether both are cameras whose pixels look along the same rays in every frame."""
        return (
            self.is_camera
            and (self.width, self.height) == (other.width, other.height)
            and self.carried == other.carried
            and np.array_equal(self.carrier_from_sensor, other.carrier_from_sensor)
            and np.array_equal(self.k, other.k)
            and self.bent == other.bent
            and (self.is_projective, other.is_projective) == (True, True)
        )


@dataclass(frozen=True, slots=True)
class Calibration:
    """The rig of an episode.

    Attributes:
        ego_box: ``location``, ``extent`` (half sizes, m), ``rotation_deg`` of the ego's box.
        sensors: by id, in the order of the spec.
    """

    ego_box: Mapping[str, tuple[float, float, float]]
    sensors: Mapping[str, SensorCalibration]


_TYPES: Mapping[str, tuple[type, ...]] = {
    "kind": (str,),
    "attributes": (dict,),
    "attach_to": (str,),
    "attachment": (str,),
    "labelled": (bool,),
    "depth": (str, NoneType),
    "instance": (str, NoneType),
    "width": (int,),
    "height": (int,),
    "fov_deg": (int, float),
}
"""Of what a sensor's entry holds."""


def calibration_of(name: str, entry: Mapping[str, Any]) -> SensorCalibration:
    """A sensor's entry in the document.

    Raises:
        AttributeError, KeyError, TypeError, ValueError: it is damaged.
    """
    for key, types in _TYPES.items():
        if not isinstance(entry.get(key, 0), types):
            raise TypeError(f"{key} of {name} is {entry.get(key)!r}")
    given = entry["ego_from_sensor"]
    pose = np.full((4, 4), np.nan) if given is None else np.array(given, np.float64)
    if pose.shape != (4, 4):
        raise ValueError(f"ego_from_sensor of {name} has shape {pose.shape}")
    fixed = np.array(entry["carrier_from_sensor"], np.float64)
    if fixed.shape != (4, 4) or not np.isfinite(fixed).all():
        raise ValueError(f"carrier_from_sensor of {name} is no pose")
    k = np.array(entry.get("K", np.zeros((3, 3))), np.float64)
    if k.shape != (3, 3) or (entry.get("width") and not min(k[0, 0], k[1, 1]) > 0.0):
        raise ValueError(f"K of {name} is no matrix of a camera")
    return SensorCalibration(
        id=name,
        kind=entry["kind"],
        blueprint=entry["blueprint"],
        attributes=entry["attributes"],
        attach_to=entry["attach_to"],
        attachment=entry["attachment"],
        carrier_from_sensor=fixed,
        ego_from_sensor=pose,
        codec=entry["files"],
        labelled=entry["labelled"],
        depth=entry["depth"],
        instance=entry["instance"],
        width=entry.get("width", 0),
        height=entry.get("height", 0),
        fov_deg=entry.get("fov_deg", 0.0),
        k=k,
        lens=_lens_of(entry) if "lens" in entry else None,
        flash=FlashSpec.read(Fields(entry["flash"], "flash")) if "flash" in entry else None,
        attach_index=entry.get("attach_index", 0),
    )


def _lens_of(entry: Mapping[str, Any]) -> Lens:
    lens, ((fx, _, cx), (_, fy, cy), _) = entry["lens"], entry["K"]
    size = (entry["width"], entry["height"])
    return lens_of(
        lens["model"], size, (fx, fy), (cx, cy), lens["distortion"], lens["max_angle_deg"]
    )
