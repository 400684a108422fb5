"""Codecs of the ranging sensors."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.codec import Codec, Content
from carstage.codecs.extras import need
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.sensor_kinds.columns import Point

_FIELDS = ("x", "y", "z", "intensity")
_TAGGED_FIELDS = (*_FIELDS, "object_idx", "object_tag")
_LAZ_STEP_M = 0.0005
_LAZ_INTENSITY = 65535.0


class LidarBin(Codec):
    """The points as they were measured; decodes to ``(N, 4)`` float32 x, y, z (m), intensity.

    Coordinates are of the sensor in CARLA's axes: x forward, y right, z up.

    Attributes:
        fields: names of a point's float32.
    """

    suffixes: ClassVar = (".bin",)
    fields: ClassVar[tuple[str, ...]] = _FIELDS

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[Content, ...]:
        """See ``Codec.encode``."""
        points = self._points(payload)
        counts = meta.get("counts")
        if counts is not None and sum(counts) != len(points):
            raise ValueError(f"a LiDAR record says {sum(counts)} points and holds {len(points)}")
        return (payload,)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        return self._points(contents[0])

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return self._points(payload)

    def _points(self, content: bytes | memoryview) -> NDArray[np.float32]:
        return _points(content, len(self.fields))


class LidarNpz(LidarBin):
    """The points under the name ``points`` in a compressed NPZ."""

    suffixes: ClassVar = (".npz",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        (content,) = super().encode(meta, payload)
        return (pack_npz({"points": self._points(content)}),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        points = unpack_npz(contents[0], "points").astype("<f4", copy=False)
        return self._points(points.tobytes())


class _HeadedPoints(LidarBin):
    """The points after a header of text; numbers stay as they are.

    Attributes:
        end: what ends the header.
    """

    end: ClassVar[bytes]

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        (content,) = super().encode(meta, payload)
        return (b"".join((self._header(len(content) // (4 * len(self.fields))), content)),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        head, end, body = contents[0].partition(self.end)
        points = self._points(body)
        if head + end != self._header(len(points)):
            raise ValueError(f"not the header of {len(points)} points of a LiDAR")
        return points

    def _header(self, count: int) -> bytes:
        raise NotImplementedError


class LidarPly(_HeadedPoints):
    """Binary PLY with x, y, z and intensity."""

    suffixes: ClassVar = (".ply",)
    end: ClassVar = b"end_header\n"

    def _header(self, count: int) -> bytes:
        lines = (
            *("ply", "format binary_little_endian 1.0", f"element vertex {count}"),
            *(f"property float {name}" for name in self.fields),
            "end_header\n",
        )
        return "\n".join(lines).encode("ascii")


class LidarPcd(_HeadedPoints):
    """Binary PCD 0.7 with x, y, z and intensity."""

    suffixes: ClassVar = (".pcd",)
    end: ClassVar = b"DATA binary\n"

    def _header(self, count: int) -> bytes:
        sizes, types, counts = (" ".join(one * len(self.fields)) for one in "4F1")
        lines = (
            *("VERSION 0.7", f"FIELDS {' '.join(self.fields)}", f"SIZE {sizes}", f"TYPE {types}"),
            *(f"COUNT {counts}", f"WIDTH {count}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0"),
            *(f"POINTS {count}", "DATA binary\n"),
        )
        return "\n".join(lines).encode("ascii")


class TaggedLidarBin(LidarBin):
    """The same with object and semantic tag: decodes to ``(N, 6)`` float32.

    See :class:`carstage.sensor_kinds.columns.TaggedPoint`.
    """

    fields: ClassVar = _TAGGED_FIELDS


class TaggedLidarNpz(LidarNpz):
    """Points with tags, see :class:`LidarNpz`."""

    fields: ClassVar = _TAGGED_FIELDS


class TaggedLidarPly(LidarPly):
    """Points with tags, see :class:`LidarPly`."""

    fields: ClassVar = _TAGGED_FIELDS


class TaggedLidarPcd(LidarPcd):
    """Points with tags, see :class:`LidarPcd`."""

    fields: ClassVar = _TAGGED_FIELDS


class LidarLaz(LidarBin):
    """LAZ: a third of the size, coordinates to 0.25 mm, intensity to 1/65535 (extra ``laz``)."""

    suffixes: ClassVar = (".laz",)
    lossless: ClassVar = False

    def __init__(self) -> None:
        self._laspy = need("laspy", extra="laz", codec="laz")
        need("lazrs", extra="laz", codec="laz")

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        (content,) = super().encode(meta, payload)
        points = self._points(content)
        header = self._laspy.LasHeader(point_format=0, version="1.2")
        header.creation_date = None
        header.generating_software = "carstage"
        header.scales = np.full(3, _LAZ_STEP_M)
        cloud = self._laspy.LasData(header)
        cloud.xyz = points[:, :3].astype(np.float64)
        cloud.intensity = np.rint(np.clip(points[:, Point.INTENSITY], 0.0, 1.0) * _LAZ_INTENSITY)
        stream = io.BytesIO()
        cloud.write(stream, do_compress=True)
        return (stream.getvalue(),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        try:
            cloud = self._laspy.read(io.BytesIO(contents[0]))
            xyz, intensity = np.asarray(cloud.xyz), np.asarray(cloud.intensity)
        except Exception as error:  # the library and its decompressor raise types of their own
            raise ValueError(f"damaged LAZ: {error}") from error
        return np.column_stack([xyz, intensity / _LAZ_INTENSITY]).astype(np.float32)


def _points(content: bytes | memoryview, width: int) -> NDArray[np.float32]:
    if len(content) % (4 * width):
        raise ValueError(f"{len(content)} bytes are no whole number of points")
    points = np.frombuffer(content, "<f4").reshape(-1, width)
    # A sum of squares is finite only if all numbers are; one that overflows says nothing.
    numbers = points.reshape(-1)
    with np.errstate(over="ignore", invalid="ignore"):
        squares = numbers @ numbers
    if not np.isfinite(squares) and not np.isfinite(numbers).all():
        raise ValueError("a coordinate is not finite")
    return points
