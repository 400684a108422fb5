"""What pixels met, and their bytes, in one pass over them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from carstage_sim.kernels import device, kernel
from carstage_sim.render.crew import Shared, alone, do

FAR_M = 1000.0
"""Largest depth; also what a depth image shows for the sky."""
ENVIRONMENT_ID = 0x8000
"""First instance id of level objects: actor ids count up from 1 and do not come near."""

InParts: TypeAlias = Callable[[Shared, tuple[Any, ...], int], None]
"""Has a kernel, with its data, cover a number of pixels; see ``RayCaster.in_parts``."""

_STEPS_PER_M = (2**24 - 1) / FAR_M
_OPAQUE = np.uint32(0xFF000000)
_BYTE = np.uint32(0xFF)


def in_one(shared: Shared, data: tuple[Any, ...], count: int) -> None:
    """All pixels as one part, here."""
    alone(shared, data, 0, count)


@device
def aim_ray(rotation, right, up, k, rays):  # type: ignore[no-untyped-def]
    """World direction of a ray by its slopes; see ``view.pixel_rays``."""
    for axis in range(3):
        rays[k, axis] = np.float32(
            rotation[axis, 0] + rotation[axis, 1] * right[k] + rotation[axis, 2] * up[k]
        )


@device
def _ray_directions(rotation, right, up, rays, worker, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        aim_ray(rotation, right, up, k, rays)


@kernel
def ray_directions(data, board, job, work):  # type: ignore[no-untyped-def]
    """World directions of rays by their slopes; see ``view.pixel_rays``."""
    do(_ray_directions, data, board, job, work)


@device
def _hit_tags(row, triangle, static, static_tag, actor_tag, sky, tags, worker, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        if row[k] == static:
            tags[k] = static_tag[triangle[k]]
        elif row[k] >= 0:
            tags[k] = actor_tag[triangle[k]]
        else:
            tags[k] = sky


@kernel
def hit_tags(data, board, job, work):  # type: ignore[no-untyped-def]
    """The semantic tag of what each ray met; see ``View.tags``.

    Args:
        static: the row of what belongs to the town.
        sky: the tag of what met nothing.
    """
    do(_hit_tags, data, board, job, work)


@device
def _hit_ids(row, triangle, static, static_object, actor_id, ids, worker, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        ids[k] = 0
        if row[k] == static:
            number = np.int64(static_object[triangle[k]])
            if number > 0:
                ids[k] = ENVIRONMENT_ID | ((number - 1) & (ENVIRONMENT_ID - 1))
        elif row[k] >= 0:
            ids[k] = np.int64(actor_id[row[k]]) & 0xFFFF


@kernel
def hit_ids(data, board, job, work):  # type: ignore[no-untyped-def]
    """The instance id of what each ray met; see ``View.instance_ids``."""
    do(_hit_ids, data, board, job, work)


@device
def _depth_words(depth_m, words, worker, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        metres = np.float64(depth_m[k])
        if not metres < FAR_M:  # nor is what is not a number
            metres = np.float64(FAR_M)
        metres = max(metres, np.float64(0.0))
        code = np.uint32(np.rint(metres * _STEPS_PER_M))
        low, middle = code & _BYTE, code & np.uint32(0xFF00)
        words[k] = low << np.uint32(16) | middle | code >> np.uint32(16) | _OPAQUE


@kernel
def depth_words(data, board, job, work):  # type: ignore[no-untyped-def]
    """BGRA bytes of depths as little-endian words: the code's low byte in R, its high one in B."""
    do(_depth_words, data, board, job, work)


@device
def _instance_words(tags, ids, words, worker, first, last):  # type: ignore[no-untyped-def]
    for k in range(first, last):
        number = np.uint32(ids[k])
        words[k] = (
            np.uint32(tags[k]) << np.uint32(16)
            | (number & _BYTE) << np.uint32(8)
            | number >> np.uint32(8)
            | _OPAQUE
        )


@kernel
def instance_words(data, board, job, work):  # type: ignore[no-untyped-def]
    """BGRA bytes as little-endian words: tag in R, id low byte in G, high in B."""
    do(_instance_words, data, board, job, work)


@device
def _normal_words(normals, words, worker, first, last):  # type: ignore[no-untyped-def]
    half, zero = np.float32(127.5), np.float32(128.0)
    for k in range(first, last):
        # Half a step more than zero's code, as the fraction is cut off.
        x, y, z = (
            np.uint32(normals[k, 0] * half + zero),
            np.uint32(normals[k, 1] * half + zero),
            np.uint32(normals[k, 2] * half + zero),
        )
        words[k] = x << np.uint32(16) | y << np.uint32(8) | z | _OPAQUE


@kernel
def normal_words(data, board, job, work):  # type: ignore[no-untyped-def]
    """BGRA bytes of normals as little-endian words: x in R, y in G, z in B, -1 to 1 as 0 to 255."""
    do(_normal_words, data, board, job, work)


def bytes_of(words: NDArray[np.uint32], shape: tuple[int, ...]) -> NDArray[np.uint8]:
    """``(*shape, 4)`` bytes of flat words."""
    return words.view(np.uint8).reshape(*shape, 4)
