"""Visibility by pixels: who owns each pixel of a box's silhouette.

Each pixel of the silhouette of the slightly inflated box is the object's own, in front of it (an
occluder) or behind it (background seen past the object). A car fills only part of its silhouette;
so the share of own among own and background pixels (the fill) estimates how many of the pixels in
front would be its own: a lone car has occlusion 0, a hidden one 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.rle import encode_mask
from carstage.geometry import Z_NEAR_M, FloatArray, Rectangle

BOX_MARGIN_M: Final = 0.05
"""How much a box is inflated, and the slack of the depth gate."""

FILL_PRIOR: Final = 0.8
"""Share of its silhouette that an object fills when none of it is visible."""

GROUND_STRIP_M: Final = 0.05
"""Points this close to the box's bottom are taken for the road, unless a tag says otherwise."""

_TINY: Final = 1e-300


@dataclass(frozen=True, slots=True)
class ModalMask:
    """An object's own pixels: a crop of the image and where it lies."""

    crop: NDArray[np.bool_]
    x0: int
    y0: int

    def bounds(self) -> Rectangle:
        """Tight bounds of the set pixels, half open (px)."""
        columns = np.flatnonzero(self.crop.any(axis=0))
        rows = np.flatnonzero(self.crop.any(axis=1))
        return (
            float(self.x0 + columns[0]),
            float(self.y0 + rows[0]),
            float(self.x0 + columns[-1] + 1),
            float(self.y0 + rows[-1] + 1),
        )

    def rle(self, width: int, height: int) -> str:
        """COCO's compressed run lengths in an image of this size."""
        return encode_mask(self.crop, self.x0, self.y0, width, height)


@dataclass(frozen=True, slots=True)
class PixelVisibility:
    """Pixel counts of one object in one image.

    Attributes:
        visible_px: own pixels.
        front_px: pixels of occluders.
        hull_px: all pixels whose centre lies in the inflated box's silhouette.
        method: how own pixels were found, ``instance`` or ``depth``.
        mask: the own pixels; None without any.
    """

    visible_px: int
    front_px: int
    hull_px: int
    method: str
    mask: ModalMask | None

    @property
    def amodal_px(self) -> float:
        """Estimated pixels of the object's part in the image, were nothing in front of it."""
        if self.visible_px == 0:
            return FILL_PRIOR * self.hull_px
        fill = self.visible_px / (self.hull_px - self.front_px)
        return self.visible_px + fill * self.front_px

    @property
    def amodal_method(self) -> str:
        """``hull_depth``, or ``hull_prior`` when no pixel is visible."""
        return "hull_depth" if self.visible_px else "hull_prior"

    @property
    def occlusion_ratio(self) -> float:
        """Share of the amodal pixels that are hidden; equals front over hull if any is visible."""
        return 1.0 - self.visible_px / self.amodal_px if self.visible_px else 1.0


@dataclass(frozen=True, slots=True)
class ImageEvidence:
    """The images of one camera in one frame, decoded once.

    Attributes:
        depth_m: ``(H, W)`` float32 z-depth.
        instance_id: ``(H, W)`` uint16, low 16 bits of actor ids; None: use the depth method.
        tag: ``(H, W)`` uint8 semantic tags, or None.
    """

    depth_m: NDArray[np.float32]
    instance_id: NDArray[np.uint16] | None
    tag: NDArray[np.uint8] | None


@dataclass(frozen=True, slots=True)
class BoxView:
    """A box as rays of a camera meet it.

    Attributes:
        origin_box: ``(3,)`` camera position in box axes (m).
        box_from_optical: ``(3, 3)`` directions from optical to box axes.
        extent_m: ``(3,)`` half sizes, not inflated.
        region: x0, y0, x1, y1 whole pixels around the inflated box's silhouette in the image.
    """

    origin_box: FloatArray
    box_from_optical: FloatArray
    extent_m: FloatArray
    region: tuple[int, int, int, int]


def box_interval(
    view: BoxView, k: FloatArray, z_near_m: float = Z_NEAR_M
) -> tuple[FloatArray, FloatArray]:
    """Z-depths at which the pixels' rays enter and leave the inflated box (slab test).

    The ray through a pixel's centre is ``d = K^-1 (i + 0.5, j + 0.5, 1)``: its third component is
    1, so that the ray's parameter is z-depth. A ray misses the box where enter > leave; that is
    exactly where the pixel's centre lies outside the silhouette.

    Returns:
        enter, leave: each ``(h, w)`` of ``view.region``; enter is at least ``z_near_m``.
    """
    x0, y0, x1, y1 = view.region
    x = (np.arange(x0, x1) + 0.5 - k[0, 2]) / k[0, 0]
    y = (np.arange(y0, y1) + 0.5 - k[1, 2]) / k[1, 1]
    enter: FloatArray = np.full((len(y), len(x)), z_near_m)
    leave: FloatArray = np.full_like(enter, np.inf)
    half = view.extent_m + BOX_MARGIN_M
    for axis in range(3):
        a, b, c = view.box_from_optical[axis]
        direction = (a * x)[None, :] + (b * y + c)[:, None]
        # A ray along the slab never meets its planes: infinitely far is right, NaN is not.
        direction[direction == 0.0] = _TINY
        inverse = np.reciprocal(direction, out=direction)
        low = inverse * (-half[axis] - view.origin_box[axis])
        high = np.multiply(inverse, half[axis] - view.origin_box[axis], out=inverse)
        np.maximum(enter, np.minimum(low, high), out=enter)
        np.minimum(leave, np.maximum(low, high, out=low), out=leave)
    return enter, leave


def measure(
    view: BoxView,
    k: FloatArray,
    evidence: ImageEvidence,
    actor_id: int,
    tags: NDArray[np.bool_],
) -> PixelVisibility:
    """Count an object's own, front and background pixels.

    Args:
        view: the box as the camera sees it.
        k: ``(3, 3)`` intrinsics.
        evidence: the camera's images.
        actor_id: the object's id; its low 16 bits are looked for.
        tags: ``(256,)`` which tags the object's pixels may carry.
    """
    x0, y0, x1, y1 = view.region
    rectangle = np.s_[y0:y1, x0:x1]
    enter, leave = box_interval(view, k)
    depth = evidence.depth_m[rectangle]
    hull = enter <= leave
    own = hull.copy()
    if evidence.tag is not None:
        own &= tags[evidence.tag[rectangle]]
    if evidence.instance_id is not None:
        # Untagged geometry is transparent to the instance camera and ids collide: depth decides.
        own &= evidence.instance_id[rectangle] == (actor_id & 0xFFFF)
        own &= (depth >= enter - BOX_MARGIN_M) & (depth <= leave + BOX_MARGIN_M)
        method = "instance"
    else:
        own &= (depth >= enter) & (depth <= leave)
        if evidence.tag is None:
            _remove_road(own, view, k, depth)
        method = "depth"
    front = hull & ~own & (depth < enter)
    # The inflated box reaches into the road: a descending ray that meets the road before it could
    # have met no more of the object than that strip.
    _remove_road(front, view, k, depth)
    visible_px = int(np.count_nonzero(own))
    return PixelVisibility(
        visible_px=visible_px,
        front_px=int(np.count_nonzero(front)),
        hull_px=int(np.count_nonzero(hull)),
        method=method,
        mask=ModalMask(own, x0, y0) if visible_px else None,
    )


def _remove_road(
    mask: NDArray[np.bool_], view: BoxView, k: FloatArray, depth: NDArray[np.float32]
) -> None:
    """Unset pixels whose descending ray ends below the strip at the bottom of the box."""
    row, column = np.nonzero(mask)
    x = (column + view.region[0] + 0.5 - k[0, 2]) / k[0, 0]
    y = (row + view.region[1] + 0.5 - k[1, 2]) / k[1, 1]
    a, b, c = view.box_from_optical[2]
    slope = a * x + b * y + c
    height = view.origin_box[2] + depth[row, column] * slope
    mask[row, column] = (slope >= 0.0) | (height >= GROUND_STRIP_M - view.extent_m[2])


def occlusion_bin(ratio: float) -> int:
    """``occluded_px``: 0 up to a ratio of 0.10, 1 up to 0.50, else 2."""
    return 0 if ratio <= 0.10 else 1 if ratio <= 0.50 else 2


def visibility_token(visibility: float) -> int:
    """nuScenes' visibility token: 1 below 0.4, 2 below 0.6, 3 below 0.8, else 4."""
    return 1 + sum(visibility >= bound for bound in (0.4, 0.6, 0.8))


def low_id_is_shared(actor_id: int, live_ids: NDArray[np.uint32]) -> bool:
    """Whether another live actor has the same low 16 bits, all that an instance image holds."""
    same = (live_ids & np.uint32(0xFFFF)) == np.uint32(actor_id & 0xFFFF)
    return bool(np.any(same & (live_ids != np.uint32(actor_id))))
