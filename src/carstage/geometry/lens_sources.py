"""Which pinhole pictures hold all that a lens shows, at its resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from carstage.errors import BadInputError
from carstage.geometry.coordinates import FloatArray, arctan2, length, rotation_matrix
from carstage.geometry.lenses import Lens

FACE_ROTATIONS_DEG: Final[dict[str, tuple[float, float, float]]] = {
    "front": (0.0, 0.0, 0.0),
    "right": (0.0, 90.0, 0.0),
    "left": (0.0, -90.0, 0.0),
    "up": (90.0, 0.0, 0.0),
    "down": (-90.0, 0.0, 0.0),
    "back": (0.0, 180.0, 0.0),
}
"""Pitch, yaw, roll of the cube's faces on the sensor that they stand for."""
FACE_AXES: Final = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    dtype=np.float64,
)
"""``(6, 3, 3)`` optical axes of each face from those of the sensor, in the order above."""

LARGEST_PX: Final = 8192
"""Of a recorded picture, width or height."""
WIDEST_DEG: Final = 75.0
"""From the optical axis, of what one picture holds."""
_MARGIN_PX: Final = 2
"""Beyond what is shown, so that colours are always between recorded pixels."""
_GRID: Final = 384
_FOV_DIGITS: Final = 4


@dataclass(frozen=True, slots=True)
class SourceView:
    """What is recorded for a lens.

    Attributes:
        width, height: of the picture, or of each face (px).
        fov_deg: its horizontal field of view.
        faces: names of the cube's faces that the lens shows, ``front`` always first.
    """

    width: int
    height: int
    fov_deg: float
    faces: tuple[str, ...]


@lru_cache(maxsize=64)
def source_view(lens: Lens, *, cube: bool, oversampling: float = 1.0) -> SourceView:
    """The picture, or the cube's faces, that a lens is re-projected from.

    Args:
        lens: the camera model.
        cube: whether faces of a cube are recorded, else one pinhole picture.
        oversampling: recorded pixels per pixel of the lens, where it resolves most.

    Raises:
        BadInputError: the lens shows too much for one picture, or needs too large ones.
    """
    rays, steps = _sampled(lens)
    return view_of_rays(rays, float(steps.min()), cube=cube, oversampling=oversampling)


def view_of_rays(
    rays: FloatArray, step_rad: float, *, cube: bool, oversampling: float = 1.0
) -> SourceView:
    """The picture, or the cube's faces, that holds rays.

    Args:
        rays: ``(N, 3)`` in optical axes.
        step_rad: the smallest angle between two of them.
        cube: whether faces of a cube are recorded, else one pinhole picture.
        oversampling: recorded pixels per step.

    Raises:
        BadInputError: the rays go too far apart for one picture, or need too large ones.
    """
    focal = oversampling / step_rad
    if cube:
        half = math.ceil(focal) + _MARGIN_PX
        largest = np.abs(rays).argmax(axis=1)
        signs = np.take_along_axis(rays, largest[:, None], axis=1)[:, 0] > 0.0
        hit = set(zip(largest.tolist(), signs.tolist(), strict=True))
        order = {
            "front": (2, True), "right": (0, True), "left": (0, False), "up": (1, False),
            "down": (1, True), "back": (2, False),
        }  # fmt: skip
        faces = tuple(name for name, axis in order.items() if name == "front" or axis in hit)
        return _checked(2 * half, 2 * half, focal, faces)
    angle = float(arctan2(np.abs(rays[:, :2]), rays[:, 2:]).max())
    if angle > math.radians(WIDEST_DEG):
        raise BadInputError(
            f"The picture reaches {math.degrees(angle):.0f} degrees from the optical axis, more "
            f"than one pinhole picture can hold ({WIDEST_DEG:g}).",
            "Use longer focal lengths, or the model kannala_brandt.",
        )
    flat = np.abs(rays[:, :2] / rays[:, 2:]).max(axis=0)
    across, down = (2 * (math.ceil(focal * float(one)) + _MARGIN_PX) for one in flat)
    return _checked(across, down, focal, ("front",))


def _checked(width: int, height: int, focal: float, faces: tuple[str, ...]) -> SourceView:
    if max(width, height) > LARGEST_PX:
        raise BadInputError(
            f"Pictures of {width}x{height} px would have to be recorded for it; at most "
            f"{LARGEST_PX} are.",
            "Use a smaller picture, shorter focal lengths or less oversampling.",
        )
    fov_deg = math.degrees(2.0 * math.atan(width / (2.0 * focal)))
    return SourceView(width, height, round(fov_deg, _FOV_DIGITS), faces)


def _sampled(lens: Lens) -> tuple[FloatArray, FloatArray]:
    """Unit rays ``(N, 3)`` all over the picture, and ``(M,)`` radians per pixel.

    The step is the wider of the two directions: near the poles of an equirectangular picture
    pixels of a row lie ever closer, which need no finer source.
    """
    u, v = np.linspace(0.0, lens.width, _GRID), np.linspace(0.0, lens.height, _GRID)
    sides = [np.column_stack([u, np.full(_GRID, end)]) for end in (0.0, float(lens.height))]
    sides += [np.column_stack([np.full(_GRID, end), v]) for end in (0.0, float(lens.width))]
    inner = np.stack(np.meshgrid(u[1:-1:6], v[1:-1:6]), axis=-1).reshape(-1, 2)
    rays = _unit(lens, inner)
    # On the sphere; of a pinhole's model in the plane z = 1, where its source has its pixels.
    of = _unit if lens.depth_is_range else _rays
    half_right, half_down = np.eye(2) * 0.5
    to_right = length(of(lens, inner + half_right) - of(lens, inner - half_right))
    down = length(of(lens, inner + half_down) - of(lens, inner - half_down))
    per_px = np.maximum(to_right, down)
    found = np.concatenate([rays, _unit(lens, np.concatenate(sides)), _edge_rays(lens)])
    found, per_px = found[~np.isnan(found[:, 0])], per_px[~np.isnan(per_px)]
    if not len(found) or not len(per_px):
        raise BadInputError(
            "No pixel of the picture shows anything.", "Check the focal lengths and cx, cy."
        )
    return found, per_px


def _rays(lens: Lens, uv: FloatArray) -> FloatArray:
    return lens.rays(uv)


def _unit(lens: Lens, uv: FloatArray) -> FloatArray:
    rays = lens.rays(uv)
    return np.asarray(rays / length(rays)[:, None], dtype=np.float64)


def _edge_rays(lens: Lens) -> FloatArray:
    """Rays ``(N, 3)`` of the lens's largest angle that lie in the picture."""
    across, along = math.sin(lens.max_angle_rad), math.cos(lens.max_angle_rad)
    azimuth = [2.0 * math.pi * i / _GRID for i in range(_GRID)]
    rays = np.array([[across * math.cos(a), across * math.sin(a), along] for a in azimuth])
    uv = lens.to_edge(rays)
    within = (uv >= 0.0).all(axis=1) & (uv <= [lens.width, lens.height]).all(axis=1)
    return rays[within]


def face_rotation_deg(rotation_deg: tuple[float, float, float], face: str) -> tuple[float, ...]:
    """Pitch, yaw, roll of a face of the cube around a sensor with that rotation.

    Rounded to a millionth of a degree, so that it is the same on every processor.
    """
    m = rotation_matrix(np.array(rotation_deg)) @ np.round(
        rotation_matrix(np.array(FACE_ROTATIONS_DEG[face]))
    )
    pitch = math.degrees(math.asin(max(-1.0, min(1.0, m[2, 0]))))
    if abs(m[2, 0]) > 1.0 - 1e-9:  # straight up or down: yaw and roll turn about one axis
        yaw, roll = math.atan2(-m[0, 1], m[1, 1]), 0.0
        pitch = math.copysign(90.0, pitch)
    else:
        yaw, roll = math.atan2(m[1, 0], m[0, 0]), math.atan2(-m[2, 1], m[2, 2])
    angles = (pitch, math.degrees(yaw), math.degrees(roll))
    return tuple(round(angle, 6) + 0.0 for angle in angles)
