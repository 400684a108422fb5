"""From the pictures that were recorded to the picture of a camera model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.rig import camera_geometry, planned_lens
from carstage.codecs.codec import image_bgra
from carstage.geometry import FloatArray, Lens, focal_length_px, pixel_rays, rotate
from carstage.geometry.lens_sources import FACE_AXES
from carstage.rawlog.reader import Record
from carstage.sensor_kinds.model import COLOUR, DEPTH, FLOW
from carstage.spec import SensorSpec
from carstage.spec.lenses import FACES

Picture = tuple[Mapping[str, Any], memoryview]
"""What a data record says of its payload, and the payload."""


def record_picture(sensor: SensorSpec, records: Sequence[Record | None]) -> Picture | None:
    """A sensor's picture in one tick, as if its camera had that model.

    Args:
        sensor: as it is planned.
        records: of its streams in that tick, in their order.

    Returns:
        None where the tick lacks one of them.

    Raises:
        ValueError: a payload does not have the size that its meta says.
    """
    found = [record for record in records if record is not None]
    if len(found) < len(sensor.streams):
        return None
    if sensor.lens is None:
        return found[0].meta, found[0].payload
    lens = planned_lens(sensor.lens)
    way = _way(lens, camera_geometry(sensor.attributes), face_numbers(sensor))
    pictures = [(record.meta, record.payload) for record in found]
    meta = {**found[0].meta, "width": lens.width, "height": lens.height}
    if sensor.content == FLOW:
        return meta, _flow(pictures, lens, way)
    return meta, _image(pictures, sensor.content, lens, way)


@dataclass(frozen=True, slots=True)
class RayPlaces:
    """Where rays, such as those of a lens's pixels, are in recorded pictures.

    Attributes:
        face, place: see ``reprojection_kernel``.
        factor: ``(H, W)`` from the source's z-depth to what the ray is to be multiplied by.
        faces: numbers of the recorded faces of the cube.
        focal_px: of the sources.
    """

    face: NDArray[np.uint8]
    place: FloatArray
    factor: FloatArray
    faces: tuple[int, ...]
    focal_px: float


def face_numbers(sensor: SensorSpec) -> tuple[int, ...]:
    """Numbers in ``FACES`` of what its streams show."""
    first = [face[0] for face in FACES]
    return (0, *(first.index(name[-1]) for name in sensor.faces or ()))


@lru_cache(maxsize=8)
def _way(lens: Lens, source: tuple[int, int, float], faces: tuple[int, ...]) -> RayPlaces:
    return places_of_rays(pixel_rays(lens), source, faces)


def places_of_rays(
    rays: FloatArray, source: tuple[int, int, float], faces: tuple[int, ...]
) -> RayPlaces:
    """Where rays are in the pictures that were recorded.

    Args:
        rays: ``(H, W, 3)`` in optical axes; NaN where there is none.
        source: width and height (px) and horizontal field of view (deg) of each picture.
        faces: their numbers in ``FACES``.
    """
    from carstage.conversion.reprojection_kernel import NOTHING

    width, height, fov_deg = source
    focal = focal_length_px(width, fov_deg)
    face = np.full(rays.shape[:2], NOTHING, np.uint8)
    place, factor = np.zeros((*rays.shape[:2], 2)), np.ones(rays.shape[:2])
    ahead = np.full(rays.shape[:2], -np.inf)
    for position, number in enumerate(faces):
        in_face = rotate(FACE_AXES[number], rays)
        best = in_face[..., 2] > ahead  # false where there is no ray
        chosen = in_face[best]
        ahead[best], face[best] = chosen[:, 2], position
        place[best] = chosen[:, :2] / chosen[:, 2:] * focal + [width / 2.0, height / 2.0]
        factor[best] = 1.0 / chosen[:, 2]
    return RayPlaces(face, place, factor, faces, focal)


def _image(pictures: Sequence[Picture], content: str, lens: Lens, way: RayPlaces) -> memoryview:
    from carstage.conversion.reprojection_kernel import pick_nearest, sample_colours, sample_depths

    sources = np.stack([image_bgra(meta, payload) for meta, payload in pictures])
    out = np.zeros((lens.height, lens.width, 4), np.uint8)
    if content == COLOUR:
        sample_colours(sources, way.face, way.place, out)
    elif content == DEPTH:
        out[:] = 255  # nothing was hit where nothing is shown
        sample_depths(sources, way.face, way.place, way.factor, out)
    else:
        pick_nearest(sources, way.face, way.place, out)
    return out.reshape(-1).data


def _flow(pictures: Sequence[Picture], lens: Lens, way: RayPlaces) -> memoryview:
    """Flow of the lens's pixels: now less where the lens had the surface a frame ago.

    The source says where its own picture had it. NaN where the lens shows nothing, or did not show
    it then. Values are shares of half the picture with y up, as the client delivers them.
    """
    from carstage.conversion.reprojection_kernel import pick_nearest

    height, width = int(pictures[0][0]["height"]), int(pictures[0][0]["width"])
    shares = [np.frombuffer(one, "<f4").reshape(height, width, 2) for _, one in pictures]
    found = np.full((lens.height, lens.width, 2), np.nan, np.float32)
    pick_nearest(np.stack(shares).view(np.uint8), way.face, way.place, found.view(np.uint8))
    moved = found * np.array([width / 2.0, -height / 2.0])
    before = (way.place - moved - [width / 2.0, height / 2.0]) / way.focal_px
    in_face = np.concatenate([before, np.ones((*before.shape[:2], 1))], axis=-1)
    rays = np.full_like(in_face, np.nan)
    for position, number in enumerate(way.faces):
        own = way.face == position
        rays[own] = rotate(FACE_AXES[number].T, in_face[own])
    then = np.full((lens.height, lens.width, 2), np.nan)
    known = ~np.isnan(rays).any(axis=-1)
    then[known] = lens.project(rays[known])
    u, v = np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5
    flow = np.stack(np.meshgrid(u, v), axis=-1) - then
    if lens.wraps:
        flow[..., 0] -= lens.width * np.round(flow[..., 0] / lens.width)
    scaled = flow / np.array([lens.width / 2.0, -lens.height / 2.0])
    pixels: NDArray[np.float32] = scaled.astype("<f4")
    return pixels.reshape(-1).view(np.uint8).data
