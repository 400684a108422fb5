"""Visibility by pixels: who owns each pixel of a box's silhouette, and of a body's beyond it.

Each pixel of the silhouette of the slightly inflated box is the object's own, in front of it (an
occluder) or behind it (background seen past the object). A car fills only part of its silhouette;
so the share of own among own and background pixels (the fill) estimates how many of the pixels in
front would be its own: a lone car has occlusion 0, a hidden one 1.

CARLA's box of a walker is its collision capsule's, which arms and legs leave. Where an instance
picture says whose they are, such pixels are the walker's too.
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

BODY_REACH_M: Final = (0.5, 0.5, 0.2)
"""How far a walker's body may leave its capsule's box: along, across, up and down."""

FILL_PRIOR: Final = 0.8
"""Share of its silhouette that an object fills when none of it is visible."""

GROUND_STRIP_M: Final = 0.05
"""Points this little above the road are taken for it, unless a tag says otherwise."""

_NO_IDS: Final = np.empty((0, 0), dtype=np.uint16)
_NO_TAGS: Final = np.empty((0, 0), dtype=np.uint8)
_NO_RAYS: Final = np.empty((0, 0, 3), dtype=np.float64)
_NO_RAYS.flags.writeable = False  # as those of a lens: one compiled kernel serves both


@dataclass(frozen=True, slots=True)
class ModalMask:
    """An object's own pixels: their tight crop of the image and where it lies."""

    crop: NDArray[np.bool_]
    x0: int
    y0: int

    def bounds(self) -> Rectangle:
        """Tight bounds of the set pixels, half open (px)."""
        height, width = self.crop.shape
        return float(self.x0), float(self.y0), float(self.x0 + width), float(self.y0 + height)

    def rle(self, width: int, height: int) -> str:
        """COCO's compressed run lengths in an image of this size."""
        return encode_mask(self.crop, self.x0, self.y0, width, height)


@dataclass(frozen=True, slots=True)
class PixelVisibility:
    """Pixel counts of one object in one image.

    Attributes:
        visible_px: own pixels.
        outside_px: those of them whose centre lies outside the inflated box's silhouette.
        front_px: pixels of occluders.
        hull_px: all pixels whose centre lies in the inflated box's silhouette.
        method: how own pixels were found, ``instance`` or ``depth``.
        mask: the own pixels; None without any.
    """

    visible_px: int
    outside_px: int
    front_px: int
    hull_px: int
    method: str
    mask: ModalMask | None

    @property
    def amodal_px(self) -> float:
        """Estimated pixels of the object's part in the image, were nothing in front of it.

        What is hidden outside the silhouette is not estimated.
        """
        within = self.visible_px - self.outside_px
        fill = within / (self.hull_px - self.front_px) if within else FILL_PRIOR
        hidden = self.front_px if self.visible_px else self.hull_px
        return self.visible_px + fill * hidden

    @property
    def amodal_method(self) -> str:
        """``hull_depth``, or ``hull_prior`` when no pixel is visible."""
        return "hull_depth" if self.visible_px else "hull_prior"

    @property
    def occlusion_ratio(self) -> float:
        """Share of the amodal pixels that are hidden: front over hull, if none is outside."""
        return 1.0 - self.visible_px / self.amodal_px if self.visible_px else 1.0


@dataclass(frozen=True, slots=True)
class ImageEvidence:
    """The images of one camera in one frame, decoded once.

    Attributes:
        depth_m: ``(H, W)`` float32 depth in the camera model's sense: z-depth of a pinhole.
        instance_id: ``(H, W)`` uint16, low 16 bits of actor ids; None: use the depth method.
        tag: ``(H, W)`` uint8 semantic tags, or None.
        rider_tag: what riders carry; None: the server has no tag of their own.
    """

    depth_m: NDArray[np.float32]
    instance_id: NDArray[np.uint16] | None
    tag: NDArray[np.uint8] | None
    rider_tag: int | None = None


@dataclass(frozen=True, slots=True)
class Reach:
    """The space about a box that belongs to its object alone.

    Attributes:
        half_m: ``(3,)`` its half sizes (m).
        region: x0, y0, x1, y1 whole pixels around it in the image.
    """

    half_m: FloatArray
    region: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class BoxView:
    """A box as rays of a camera meet it.

    Attributes:
        origin_box: ``(3,)`` camera position in box axes (m).
        box_from_optical: ``(3, 3)`` directions from optical to box axes.
        extent_m: ``(3,)`` half sizes, not inflated.
        ground_m: height of the road in box axes; the bottom of the box or above it.
        region: x0, y0, x1, y1 whole pixels around the inflated box's silhouette in the image.
        reach: where the object may be outside its box; None: it is not.
    """

    origin_box: FloatArray
    box_from_optical: FloatArray
    extent_m: FloatArray
    ground_m: float
    region: tuple[int, int, int, int]
    reach: Reach | None = None


def measure(
    view: BoxView,
    k: FloatArray,
    evidence: ImageEvidence,
    actor_id: int | None,
    tags: NDArray[np.bool_],
    rays: FloatArray | None = None,
) -> PixelVisibility:
    """Count an object's own, front and background pixels.

    The ray through a pixel's centre is ``d = K^-1 (i + 0.5, j + 0.5, 1)``: its third component is
    1, so that the ray's parameter is z-depth; rays of a lens are given. A slab test gives where it
    enters and leaves the inflated box; it misses the box exactly where the centre lies outside the
    silhouette.

    - Own by ``instance``: the id is the object's, the tag one of its class, the depth within the
      box or 5 cm off it (untagged geometry is transparent to the instance camera and ids collide).
      Where the object may leave its box: also if what the pixel shows is within its reach.
    - Own by ``depth``: the depth is within the box, and the tag one of the object's; without tags,
      what is at the road is not its own.
    - Front: the depth is before the box. A descending ray that meets the road there could have met
      no more of the object than the strip by which the box reaches into the road: not in front.

    Args:
        view: the box as the camera sees it.
        k: ``(3, 3)`` intrinsics.
        evidence: the camera's images.
        actor_id: the object's id; its low 16 bits are looked for. None: no pixel carries its id, as
            with objects of the level.
        tags: ``(256,)`` which tags the object's pixels may carry.
        rays: ``(H, W, 3)`` rays of the pixels of a lens, not to be written to; None: of ``k``.
    """
    # Half a second to import, which only processes that count pixels shall need.
    from carstage.annotation.pixel_kernel import classify

    ids = evidence.instance_id if actor_id is not None else None
    by_id = ids is not None
    reach = view.reach if by_id and view.reach is not None else Reach(view.extent_m, view.region)
    x0, y0, x1, y1 = reach.region
    own = np.zeros((max(0, y1 - y0), max(0, x1 - x0)), dtype=np.bool_)
    within_px, outside_px, front_px, hull_px, left, top, right, bottom = classify(
        view.region,
        (float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2])),
        _NO_RAYS if rays is None else rays,
        view.origin_box,
        view.box_from_optical,
        view.extent_m + BOX_MARGIN_M,
        reach.region,
        reach.half_m,
        view.ground_m + GROUND_STRIP_M,
        Z_NEAR_M,
        BOX_MARGIN_M if by_id else 0.0,
        evidence.depth_m,
        _NO_IDS if ids is None else ids,
        (actor_id or 0) & 0xFFFF,
        _NO_TAGS if evidence.tag is None else evidence.tag,
        tags,
        not by_id and evidence.tag is None,
        own,
    )
    visible_px = within_px + outside_px
    mask = ModalMask(own[top:bottom, left:right], x0 + left, y0 + top) if visible_px else None
    method = "instance" if by_id else "depth"
    return PixelVisibility(visible_px, outside_px, front_px, hull_px, method, mask)


def occlusion_bin(ratio: float) -> int:
    """``occluded_px``: 0 up to a ratio of 0.10, 1 up to 0.50, else 2."""
    return 0 if ratio <= 0.10 else 1 if ratio <= 0.50 else 2


def visibility_token(visibility: float) -> int:
    """nuScenes' visibility token: 1 below 0.4, 2 below 0.6, 3 below 0.8, else 4."""
    return 1 + sum(visibility >= bound for bound in (0.4, 0.6, 0.8))


def shared_low_ids(live_ids: NDArray[np.uint32]) -> frozenset[int]:
    """Low 16 bits, all that an instance image holds, that more than one live actor has."""
    low, count = np.unique(live_ids & np.uint32(0xFFFF), return_counts=True)
    return frozenset(low[count > 1].tolist())
