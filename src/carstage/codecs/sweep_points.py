"""Codecs of the LiDAR whose points are each of their own instant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.codec import Codec, Content
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.geometry.sweep_motion import SweepMotion
from carstage.sensor_kinds.columns import SweepPoint

_RECORD: Final = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "z", "intensity")),
        *((name, "<u4") for name in ("age_us", "ring")),
    ]
)
"""A point as it is recorded: where and how strong it was, its age at the frame, its laser."""
_WIDTH: Final = len(SweepPoint) + 3  # and x, y, z
_MICROSECOND: Final = 1e-6


class SweepBin(Codec):
    """Points without the sensor's motion and as measured; decodes to ``(N, 9)`` float32.

    The columns are those of :class:`carstage.sensor_kinds.columns.SweepPoint`, after x, y, z. A
    record holds the points as measured, and after them the sensor's motion.
    """

    suffixes: ClassVar = (".bin",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[Content, ...]:
        """See ``Codec.encode``."""
        return (self.raw_array(meta, payload).tobytes(),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        if len(contents[0]) % (4 * _WIDTH):
            raise ValueError(f"{len(contents[0])} bytes are no whole number of points")
        return _finite(np.frombuffer(contents[0], "<f4").reshape(-1, _WIDTH))

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        if not len(payload) or len(payload) % _RECORD.itemsize:
            raise ValueError(f"{len(payload)} bytes are no points and a motion")
        records = np.frombuffer(payload, _RECORD)
        counts = meta.get("counts")
        if counts is not None and (sum(counts) != len(records) or counts[-1] != 1):
            raise ValueError(f"a record says {sum(counts)} points and holds {len(records)}")
        numbers = _finite(records[-1:].view("<f4")).astype(np.float64)
        motion = SweepMotion(numbers[:3], numbers[3:])
        return _points(records[:-1], motion)


class SweepNpz(SweepBin):
    """The same under the name ``points`` in a compressed NPZ."""

    suffixes: ClassVar = (".npz",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        return (pack_npz({"points": self.raw_array(meta, payload)}),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        points = unpack_npz(contents[0], "points").astype("<f4", copy=False)
        return super().decode((points.tobytes(),))


def _points(records: NDArray[Any], motion: SweepMotion) -> NDArray[np.float32]:
    measured = np.stack([records[name] for name in "xyz"], axis=1).astype(np.float64)
    age_s = records["age_us"].astype(np.float64) * _MICROSECOND
    points = np.empty((len(records), _WIDTH), "<f4")
    points[:, :3] = motion.undone(measured, age_s)
    points[:, SweepPoint.INTENSITY] = records["intensity"]
    points[:, SweepPoint.TIME] = -age_s
    points[:, SweepPoint.RING] = records["ring"]
    points[:, SweepPoint.X_MEASURED :] = measured
    return _finite(points)


def _finite(numbers: NDArray[np.float32]) -> NDArray[np.float32]:
    if not np.isfinite(numbers).all():
        raise ValueError("a number is not finite")
    return numbers
