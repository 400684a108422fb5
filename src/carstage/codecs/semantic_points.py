"""Codecs of the semantic LiDAR."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.codec import Codec, Content
from carstage.codecs.npz import pack_npz, unpack_npz

SEMANTIC_POINT = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("cos_incidence", "<f4"),
        ("object_idx", "<u4"),
        ("object_tag", "<u4"),
    ]
)
"""A point: position in CARLA's sensor axes (m), cosine of incidence, actor id, semantic tag."""


def points_xyz(points: NDArray[Any]) -> NDArray[np.float64]:
    """``(N, 3)`` positions of the points of a LiDAR or a semantic LiDAR."""
    if points.dtype.names is None:
        return points[:, :3].astype(np.float64)
    return np.column_stack([points[name] for name in "xyz"]).astype(np.float64)


class SemanticLidarBin(Codec):
    """The points as they were measured; decodes to ``(N,)`` of ``SEMANTIC_POINT``."""

    suffixes: ClassVar = (".bin",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[Content, ...]:
        """See ``Codec.encode``."""
        points = _points(payload)
        counts = meta.get("counts")
        if counts is not None and sum(counts) != len(points):
            raise ValueError(f"a record says {sum(counts)} points and holds {len(points)}")
        return (payload,)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        return _points(contents[0])

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return _points(payload)


class SemanticLidarNpz(SemanticLidarBin):
    """The points under the name ``points`` in a compressed NPZ, with named fields."""

    suffixes: ClassVar = (".npz",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        (content,) = super().encode(meta, payload)
        return (pack_npz({"points": _points(content)}),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        points = unpack_npz(contents[0], "points")
        if points.dtype != SEMANTIC_POINT:
            raise ValueError(f"no points of a semantic LiDAR: type {points.dtype}")
        return _points(points.tobytes())


def _points(content: bytes | memoryview) -> NDArray[Any]:
    if len(content) % SEMANTIC_POINT.itemsize:
        raise ValueError(f"{len(content)} bytes are no whole number of points")
    points = np.frombuffer(content, SEMANTIC_POINT)
    if not all(np.isfinite(points[name]).all() for name in ("x", "y", "z", "cos_incidence")):
        raise ValueError("a number is not finite")
    return points
