"""How the documentation's pictures are written."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from pathlib import Path

from PIL import Image

MOST_BYTES = 300_000
_QUALITIES = (82, 74, 68, 60)
"""Of JPEG, the best first."""


def save_pictures(pictures: Iterable[tuple[str, Image.Image]], folder: Path) -> Iterator[Path]:
    """Write pictures below a folder as they are drawn, and give the path of each.

    Args:
        pictures: file name and picture; names end with ``.jpg`` or ``.png``.
        folder: made where it is missing.
    """
    for name, picture in pictures:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".jpg":
            path.write_bytes(_small_jpeg(picture))
        else:
            picture.save(path, optimize=True)
        yield path


def _small_jpeg(picture: Image.Image) -> bytes:
    """The best of a picture that is no larger than a page should load."""
    for quality in _QUALITIES:
        stream = io.BytesIO()
        # Lines of boxes are one or two pixels wide: their colours need each pixel.
        picture.save(stream, format="JPEG", quality=quality, subsampling=0)
        if stream.tell() <= MOST_BYTES:
            break
    return stream.getvalue()
