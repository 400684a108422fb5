"""Well-known binary of points, lines and areas with heights (ISO 13249-3; OGC 06-103r4, 8.2)."""

from __future__ import annotations

import struct
from typing import Literal

import numpy as np

from carstage.geometry import FloatArray

Shape = Literal["Point", "LineString", "Polygon"]
_CODES: dict[Shape, int] = {"Point": 1001, "LineString": 1002, "Polygon": 1003}
_SHAPES = {code: shape for shape, code in _CODES.items()}
_HEAD = struct.Struct("<BI")
_COUNT = struct.Struct("<I")
_PLACE_BYTES = 24


def to_wkb(shape: Shape, places: FloatArray) -> bytes:
    """One shape; the outline of an area is its closed ring.

    Args:
        shape: what it is.
        places: ``(N, 3)``; of a point ``(1, 3)``.
    """
    head = _HEAD.pack(1, _CODES[shape])
    content = np.ascontiguousarray(places, "<f8").tobytes()
    if shape == "Point":
        return head + content
    rings = _COUNT.pack(1) if shape == "Polygon" else b""
    return head + rings + _COUNT.pack(len(places)) + content


def from_wkb(content: bytes) -> tuple[Shape, FloatArray]:
    """The shape and its places ``(N, 3)``, as :func:`to_wkb` writes them.

    Raises:
        ValueError: it is none of those.
    """
    try:
        order, code = _HEAD.unpack_from(content)
        shape, at, count = _SHAPES[code], _HEAD.size, 1
        if shape == "Polygon":
            (rings,) = _COUNT.unpack_from(content, at)
            at += _COUNT.size
            if rings != 1:
                raise ValueError(f"an area of {rings} rings is not read")
        if shape != "Point":
            (count,) = _COUNT.unpack_from(content, at)
            at += _COUNT.size
    except (struct.error, KeyError) as error:
        raise ValueError(f"no point, line or area with heights: {error}") from error
    if order != 1 or len(content) - at != _PLACE_BYTES * count:
        raise ValueError("well-known binary of another length or byte order")
    places = np.frombuffer(content, "<f8", offset=at).reshape(-1, 3)
    if not np.isfinite(places).all():
        raise ValueError("a place is not finite")
    return shape, places.astype(np.float64)
