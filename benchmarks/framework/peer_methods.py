"""How CARLA-2DBBox and CarFree decide what a camera sees, on the pictures of a labelled scene.

**CARLA-2DBBox** (M. Adib, github.com/MukhlasAdib/CARLA-2DBBox, read at 1f12634) takes the rectangle
around a box's projected vertices. The object must be within 100 m and, by the bearing of its pivot,
within the field of view. In the middle half of the rectangle, pixels count whose depth is not less
than the pivot's by more than the half diagonal of the box's floor. Its description asks that they
are half of the pixels there; its code asks for half as many pixels as there are rows.

**CarFree** (J. Jang, H. Lee, J.-C. Kim: CarFree: Hassle-Free Object Detection Dataset Generation
Using Carla Autonomous Driving Simulator, Applied Sciences 2022, 12(1), 281;
github.com/AveesLab/CarFree, read at 9874508) has no depth. All vertices must be before the camera.
The rectangle must hold a pixel of the class, and its four corners must not all lie in rectangles of
other vehicles. It is made tight around the pixels of the class within. It is left out if it is
small, or if its corners are all of the class: then it is taken for a piece of something larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.geometry import FloatArray, Rectangle, box_corners, project, transform_points

FARTHEST_M: Final = 100.0
PATCH_SHARE: Final = 0.5
"""Of the rectangle's sides, and of the pixels that must count."""
LEAST_VEHICLE_PX: Final = 10
LEAST_WALKER_PX: Final = 7


@dataclass(frozen=True, slots=True, eq=False)
class PeerObject:
    """An object as both methods get it.

    Attributes:
        corners: ``(8, 3)`` of its box in optical axes (m).
        pivot: ``(3,)`` the actor's place in optical axes (m).
        half_diagonal_m: of the box's floor.
        is_walker: else it is a vehicle.
    """

    corners: FloatArray
    pivot: FloatArray
    half_diagonal_m: float
    is_walker: bool

    @classmethod
    def of(
        cls,
        optical_from_world: FloatArray,
        world_from_box: FloatArray,
        extent_m: FloatArray,
        location_m: FloatArray,
        *,
        is_walker: bool,
    ) -> PeerObject:
        """From the world's state."""
        return cls(
            transform_points(optical_from_world, box_corners(world_from_box, extent_m)),
            transform_points(optical_from_world, location_m[None])[0],
            float(np.hypot(extent_m[0], extent_m[1])),
            is_walker,
        )


@dataclass(frozen=True, slots=True)
class PeerDecision:
    """What a method says of an object.

    Attributes:
        visible: the decision.
        box: its 2D box within the picture, half open; None where it has none.
    """

    visible: bool
    box: Rectangle | None = None


HIDDEN: Final = PeerDecision(visible=False)


def depth_patch(
    one: PeerObject, k: FloatArray, depth_m: NDArray[np.float32], *, as_described: bool = False
) -> PeerDecision:
    """CARLA-2DBBox.

    Args:
        one: the object.
        k: ``(3, 3)`` intrinsics.
        depth_m: ``(H, W)`` z-depth.
        as_described: half of the patch's pixels must count, as its README says; else half as many
            pixels as the patch has rows, as its code does.
    """
    height, width = depth_m.shape
    bearing = abs(np.arctan2(one.pivot[0], one.pivot[2]))
    half_view = np.arctan2(width / 2, k[0, 0])
    if np.linalg.norm(one.pivot) >= FARTHEST_M or bearing >= half_view:
        return HIDDEN
    # As there, vertices behind the camera are projected through it.
    uv = one.corners[:, :2] * (k[0, 0], k[1, 1]) / one.corners[:, 2:] + (k[0, 2], k[1, 2])
    (u0, v0), (u1, v1) = uv.min(axis=0), uv.max(axis=0)
    middle_u, middle_v = int((u0 + u1) / 2), int((v0 + v1) / 2)
    beside, above = int((u1 - u0) * PATCH_SHARE / 2), int((v1 - v0) * PATCH_SHARE / 2)
    rows = slice(max(0, middle_v - above), max(0, middle_v + above))
    columns = slice(max(0, middle_u - beside), max(0, middle_u + beside))
    patch = depth_m[rows, columns]
    counted = int((one.pivot[2] - patch < one.half_diagonal_m).sum())
    wanted = (patch.size if as_described else patch.shape[0]) * PATCH_SHARE
    box = _clipped((u0, v0, u1, v1), width, height)
    return PeerDecision(visible=counted > wanted, box=box)


def class_pixels(
    objects: Sequence[PeerObject],
    k: FloatArray,
    is_vehicle: NDArray[np.bool_],
    is_walker: NDArray[np.bool_],
    *,
    any_size: bool = False,
) -> list[PeerDecision]:
    """CarFree, for all objects of a picture.

    Args:
        objects: all that may be in the picture.
        k: ``(3, 3)`` intrinsics.
        is_vehicle, is_walker: ``(H, W)`` pixels of the two classes.
        any_size: small boxes stay.
    """
    height, width = is_vehicle.shape
    before = [one if (one.corners[:, 2] > 0).all() else None for one in objects]
    whole = [None if one is None else _whole_pixels(one, k, width, height) for one in before]
    covered = np.zeros((len(objects), height, width), np.bool_)
    for number, (one, box) in enumerate(zip(objects, whole, strict=True)):
        if box is not None and not one.is_walker and _holds(is_vehicle, box):
            x0, y0, x1, y1 = box
            covered[number, y0 : y1 + 1, x0 : x1 + 1] = True
    found = []
    for number, (one, box) in enumerate(zip(objects, whole, strict=True)):
        pixels = is_walker if one.is_walker else is_vehicle
        if box is None or not _holds(pixels, box):
            found.append(HIDDEN)
            continue
        # Its rectangles of other pedestrians have a vehicle's colour: they cover no pedestrian.
        others = np.asarray(np.delete(covered, number, axis=0).any(axis=0), np.bool_)
        if not one.is_walker and _corners_all(others, box, outwards=1):
            found.append(HIDDEN)
            continue
        found.append(_fitted(pixels, box, one.is_walker, any_size=any_size))
    return found


def _fitted(
    pixels: NDArray[np.bool_], box: tuple[int, int, int, int], is_walker: bool, *, any_size: bool
) -> PeerDecision:
    """The rectangle made tight, and whether it stays."""
    x0, y0, x1, y1 = box
    inside = pixels[y0:y1, x0:x1]
    columns, rows = np.flatnonzero(inside.any(axis=0)), np.flatnonzero(inside.any(axis=1))
    tight = (
        x0 + int(columns[0]), y0 + int(rows[0]), x0 + int(columns[-1]), y0 + int(rows[-1])
    )  # fmt: skip
    least = 0 if any_size else LEAST_WALKER_PX if is_walker else LEAST_VEHICLE_PX
    large = tight[2] - tight[0] > least and tight[3] - tight[1] > least
    stays = (large or any_size) and not _corners_all(pixels, tight, outwards=-1)
    box_px = (float(tight[0]), float(tight[1]), tight[2] + 1.0, tight[3] + 1.0)
    return PeerDecision(visible=stays, box=box_px)


def _whole_pixels(
    one: PeerObject, k: FloatArray, width: int, height: int
) -> tuple[int, int, int, int] | None:
    """The rectangle around the vertices, one pixel away from the picture's edges."""
    uv = project(one.corners, k, 0.0).astype(np.int64)
    low = np.clip(uv.min(axis=0), 1, (width - 2, height - 2))
    high = np.clip(uv.max(axis=0), 1, (width - 2, height - 2))
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _holds(pixels: NDArray[np.bool_], box: tuple[int, int, int, int]) -> bool:
    x0, y0, x1, y1 = box
    return bool(pixels[y0:y1, x0:x1].any())


def _corners_all(
    pixels: NDArray[np.bool_], box: tuple[int, int, int, int], *, outwards: int
) -> bool:
    """Whether the four corners, moved by a pixel, are all set."""
    x0, y0, x1, y1 = box
    height, width = pixels.shape
    columns = np.clip([x0 - outwards, x1 + outwards], 0, width - 1)
    rows = np.clip([y0 - outwards, y1 + outwards], 0, height - 1)
    return bool(pixels[np.ix_(rows, columns)].all())


def _clipped(box: Rectangle, width: int, height: int) -> Rectangle | None:
    x0, x1 = (float(np.clip(value, 0, width)) for value in (box[0], box[2]))
    y0, y1 = (float(np.clip(value, 0, height)) for value in (box[1], box[3]))
    return (x0, y0, x1, y1) if x1 > x0 and y1 > y0 else None
