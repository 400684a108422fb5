"""Colour pictures from a camera's hits: shading, edges sampled again, 8-bit sRGB."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage_sim.render.bvh import build_tree
from carstage_sim.render.cast import new_scratch
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.materials import material_table
from carstage_sim.render.overlay import draw_shapes
from carstage_sim.render.scene import Frame, SceneStore
from carstage_sim.render.shading import shade_rays
from carstage_sim.render.sky import Lighting, SkyModel
from carstage_sim.world.debug_shapes import DebugShapes
from carstage_sim.world.state import Weather

_OFFSETS = np.array([[-0.34, -0.20], [0.34, -0.14], [0.0, 0.36]], np.float32)
"""Extra rays of an edge pixel: places (right, down) from the pixel's centre, in pixels."""
_EDGE_CODES = 24
"""Difference of 8-bit codes between neighbours from which both are sampled again."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A camera's hits and what is needed to send more rays through its pixels.

    Attributes:
        width, height: pixels.
        fov_deg: horizontal field of view.
        rotation: ``(3, 3)`` world_from_camera.
        hits: of the pixel centres, row by row.
        skip_row: instance row that rays pass through, -1 for none.
        low, high: interval of depths.
        shapes: debug shapes to draw, None for none.
    """

    width: int
    height: int
    fov_deg: float
    rotation: NDArray[np.float64]
    hits: Hits
    skip_row: int
    low: float
    high: float
    shapes: DebugShapes | None = None


def _srgb_codes() -> NDArray[np.uint8]:
    """8-bit sRGB code of linear values in steps of 1/8191."""
    linear = np.arange(8192) / 8191.0
    curve = np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.rint(curve * 255.0).astype(np.uint8)


class PictureMaker:
    """Paints pictures.

    Args:
        caster: runs the kernels.
    """

    def __init__(self, caster: RayCaster) -> None:
        self._caster = caster
        self._materials = material_table()
        self._codes = _srgb_codes()
        self.sky = SkyModel()

    def warm_up(self, store: SceneStore) -> None:
        """Compile, or load, the kernels of building, casting and shading."""
        build_tree(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32), 1)
        frame = store.frame([])
        rays = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], np.float32)
        hits = self._caster.cast(frame.scene, np.zeros(3), rays, low=0.1, high=1000.0)
        self._shade(frame, hits, -1, 1e-3, self.sky.lighting(Weather(), 0.0))
        line = np.array([[[2.0, 0.0, 0.0], [2.0, 1.0, 0.0]]])
        draw_shapes(
            line, np.ones(1, np.float32), np.zeros(1, np.bool_), np.zeros((1, 3), np.uint8),
            focal_px=1.0, near_m=0.1,
            depth=np.ones((2, 2), np.float32), pixels=np.zeros((2, 2, 3), np.uint8),
        )  # fmt: skip

    def _shade(
        self, frame: Frame, hits: Hits, skip_row: int, pixel_angle: float, light: Lighting
    ) -> NDArray[np.float32]:
        colours = np.empty((len(hits.t), 3), np.float32)

        def work(first: int, last: int) -> None:
            shade_rays(
                frame.scene, new_scratch(), frame.static, frame.actors, frame.looks, frame.colour,
                frame.light_state,
                self._materials, light, frame.lamps, hits.origin, hits.directions, skip_row,
                np.float32(pixel_angle), first, last,
                hits.t, hits.row, hits.triangle, hits.weights, colours,
            )  # fmt: skip

        self._caster.in_bands(len(colours), work)
        return colours

    def paint(self, frame: Frame, picture: Picture, light: Lighting) -> NDArray[np.uint8]:
        """``(H, W, 3)`` uint8 sRGB picture; pixels on edges are the mean of several rays."""
        angle = 2.0 * np.tan(np.radians(picture.fov_deg) / 2.0) / picture.width
        colours = self._shade(frame, picture.hits, picture.skip_row, angle, light)
        codes = self._encode(colours).reshape(picture.height, picture.width, 3)
        (edges,) = np.nonzero(_rough(codes).reshape(-1))
        if len(edges):
            # The offset is in pixels: right along the second axis of the camera, down its third.
            right = (picture.rotation[:, 1] * angle).astype(np.float32)
            down = (-picture.rotation[:, 2] * angle).astype(np.float32)
            rays = picture.hits.directions[edges][:, None, :] + (
                _OFFSETS[:, :1] * right + _OFFSETS[:, 1:] * down
            )
            hits = self._caster.cast(
                frame.scene,
                picture.hits.origin,
                rays.reshape(-1, 3),
                low=picture.low,
                high=picture.high,
                skip_row=picture.skip_row,
            )
            extra = self._shade(frame, hits, picture.skip_row, angle, light)
            total = extra.reshape(len(edges), len(_OFFSETS), 3).sum(axis=1) + colours[edges]
            codes.reshape(-1, 3)[edges] = self._encode(total / np.float32(len(_OFFSETS) + 1))
        if picture.shapes is not None:
            _draw(picture.shapes, picture, codes)
        return codes

    def _encode(self, colours: NDArray[np.float32]) -> NDArray[np.uint8]:
        """8-bit sRGB codes of linear display light."""
        return self._codes[(colours * np.float32(8191.0) + np.float32(0.5)).astype(np.int32)]


def _draw(shapes: DebugShapes, picture: Picture, codes: NDArray[np.uint8]) -> None:
    """Draw debug shapes over a picture."""
    offset = shapes.segments - picture.hits.origin.astype(np.float64)
    # Sums written out: a matrix product may add in another order on another machine.
    ends = sum(offset[..., axis, None] * picture.rotation[axis] for axis in range(3))
    draw_shapes(
        ends,
        shapes.size,
        shapes.is_point,
        shapes.colour,
        focal_px=picture.width / (2.0 * np.tan(np.radians(picture.fov_deg) / 2.0)),
        near_m=picture.low,
        depth=picture.hits.t.reshape(picture.height, picture.width),
        pixels=codes,
    )


def _rough(codes: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """``(H, W)`` pixels that differ from a neighbour by more than one can overlook."""

    def differ(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.bool_]:
        apart = (np.maximum(a, b) - np.minimum(a, b)) > _EDGE_CODES
        result: NDArray[np.bool_] = apart[..., 0] | apart[..., 1] | apart[..., 2]
        return result

    rough = np.zeros(codes.shape[:2], np.bool_)
    across = differ(codes[:, 1:], codes[:, :-1])
    along = differ(codes[1:], codes[:-1])
    rough[:, 1:] |= across
    rough[:, :-1] |= across
    rough[1:] |= along
    rough[:-1] |= along
    return rough
