"""From patches of a configuration to those of an episode: pictures, sizes and places drawn."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.config import Config
from carstage.config.explain import error_of
from carstage.config.patches import LARGEST_PICTURE_BYTES, ends, patch_file
from carstage.files.bounded import read_bounded
from carstage.plan.draws import Draws
from carstage.spec.patches import BOARDS, PICTURE_PX, SIDES, PatchPicture, PatchSpec

_STREAMS = 3000
"""Above those of agents; one for each patch's places, one for its pattern."""
_MOST_PIXELS = 1 << 26
_NOISE_CELLS, _CHECKS, _BLOBS_PX, _BLOBS = 24, 8, 48, 14


def plan_patches(config: Config, index: int, draws: Draws) -> tuple[PatchSpec, ...]:
    """The patches of an episode.

    Args:
        config: what the user asks for.
        index: of the episode.
        draws: random numbers of the configuration's seed.

    Raises:
        ConfigError: a picture cannot be read.
    """
    made = []
    shown = None if config.show_patches else False
    for number, patch in enumerate(config.patches):
        stream = _STREAMS + 2 * number
        size, distance, side, across = draws.uniform(index, stream, 4)
        (up,) = draws.uniform(index, stream + 1, 1)
        low, high = ends(patch.size)
        near_m, far_m = ends(patch.distance_m)
        made.append(
            PatchSpec(
                name=f"patch{number}",
                target=patch.target,
                picture=_picture(patch.pattern, patch.file, number, draws.word(index, stream + 1)),
                size=round(low + size * (high - low), 4),
                position=(round(across, 4), round(up, 4))
                if patch.position == "random"
                else patch.position,
                board=patch.board or BOARDS[patch.target],
                distance_m=round(near_m + distance * (far_m - near_m), 3),
                side=SIDES[int(side * 2)] if patch.side == "random" else patch.side,
                shown=shown,
            )
        )
    return tuple(made)


def _picture(pattern: str | None, file: str | None, number: int, seed: int) -> PatchPicture:
    if pattern is not None:
        return _stored(PATTERN_MAKERS[pattern](np.random.Generator(np.random.PCG64(seed))))
    assert file is not None
    path = patch_file(file)
    try:
        status = path.stat()
        return _read(path, status.st_size, status.st_mtime_ns)
    except (OSError, ValueError) as error:
        message = f"{path} cannot be read as a picture: {error}."
        hint = f"Name a PNG or JPEG file of at most {_MOST_PIXELS >> 20} million pixels."
        raise error_of([(("patches", number, "file"), message, hint)]) from error


@lru_cache(maxsize=16)
def _read(path: Path, size: int, changed_ns: int) -> PatchPicture:
    """A picture of the user's, brought to at most ``PICTURE_PX``.

    Raises:
        OSError: it cannot be read, or is no picture.
        ValueError: it has too many pixels.
    """
    from PIL import Image

    del size, changed_ns  # of the file: another one is read anew
    content = read_bounded(path, LARGEST_PICTURE_BYTES)
    try:
        with Image.open(io.BytesIO(content), formats=("PNG", "JPEG", "WEBP", "BMP")) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise ValueError(f"it has {image.width} x {image.height} pixels")
            pixels = np.asarray(image.convert("RGB"))
    except (SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(str(error)) from error
    return _stored(_reduced(pixels))


def _reduced(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Means of equal squares, in whole numbers, so that every machine gets the same."""
    step = -(-max(pixels.shape[:2]) // PICTURE_PX)
    height, width = (max(1, side // step) for side in pixels.shape[:2])
    square = min(step, *pixels.shape[:2])
    cut = pixels[: height * square, : width * square].astype(np.int64)
    sums = cut.reshape(height, square, width, square, 3).sum(axis=(1, 3))
    means: NDArray[np.uint8] = ((sums + square * square // 2) // (square * square)).astype(np.uint8)
    return means


def _stored(pixels: NDArray[np.uint8]) -> PatchPicture:
    height, width = pixels.shape[:2]
    text = base64.b64encode(np.ascontiguousarray(pixels).tobytes()).decode()
    return PatchPicture(width, height, text)


def _noise(rng: np.random.Generator) -> NDArray[np.uint8]:
    return rng.integers(0, 256, (_NOISE_CELLS, _NOISE_CELLS, 3), dtype=np.uint8)


def _checker(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Two colours that are far from each other."""
    first = rng.integers(0, 256, 3)
    colours = np.stack([first, (first + 128) % 256]).astype(np.uint8)
    cells = np.add.outer(np.arange(_CHECKS), np.arange(_CHECKS)) % 2
    found: NDArray[np.uint8] = colours[cells]
    return found


def _blobs(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Round blobs one over the other, of sums and products alone: the same bytes everywhere."""
    places = (np.arange(_BLOBS_PX) + 0.5) / _BLOBS_PX
    picture = np.broadcast_to(rng.integers(0, 256, 3).astype(np.float64), (_BLOBS_PX, _BLOBS_PX, 3))
    for _ in range(_BLOBS):
        x, y, radius = rng.random(3)
        colour = rng.integers(0, 256, 3).astype(np.float64)
        radius = 0.05 + 0.2 * radius
        away = ((places - x) ** 2)[None, :] + ((places - y) ** 2)[:, None]
        share = 1.0 / (1.0 + (away / radius**2) ** 4)
        picture = picture + (colour - picture) * share[..., None]
    return np.floor(picture + 0.5).astype(np.uint8)


PATTERN_MAKERS: dict[str, Callable[[np.random.Generator], NDArray[Any]]] = {
    "noise": _noise,
    "checker": _checker,
    "blobs": _blobs,
}
