"""Codecs of the optical flow camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.codec import Codec
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.codecs.png import PngPacker, unpack_rgb16

_KITTI_STEPS_PER_PX = 64.0
_KITTI_ZERO = 2.0**15
_KITTI_LARGEST = 2**16 - 1


class FlowNpz(Codec):
    """Pixels under the name ``flow``; decodes to ``(H, W, 2)`` float32: to the right, down.

    The value at a pixel of frame t is how far the surface that it shows has moved in the image
    since frame t - 1. CARLA delivers shares of half the image, y up (Unreal's velocity buffer).
    """

    suffixes: ClassVar = (".npz",)

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        return (pack_npz({"flow": self.raw_array(meta, payload)}),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        flow = unpack_npz(contents[0], "flow")
        if flow.ndim != 3 or flow.shape[2] != 2 or flow.dtype != np.float32:
            raise ValueError(f"no optical flow: shape {flow.shape} of type {flow.dtype}")
        return flow

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        height, width = int(meta["height"]), int(meta["width"])
        if height < 1 or width < 1 or payload.nbytes != 8 * height * width:
            raise ValueError(f"{payload.nbytes} bytes are no optical flow of {width}x{height}")
        shares = np.frombuffer(payload, "<f4").reshape(height, width, 2)
        return shares * np.array([width / 2.0, -height / 2.0], np.float32)


class FlowKittiPng(FlowNpz):
    """16-bit RGB PNG as KITTI has it: ``64 u + 2^15``, ``64 v + 2^15``, 1 where there is a value.

    Rounded to 1/64 px. A motion of 512 px or more has no code: its pixel is marked as without a
    value and decodes to NaN. The flow is that of ``FlowNpz``: since the frame before, where KITTI's
    own files look ahead. Source: the readme of KITTI's stereo and flow development kit.
    """

    suffixes: ClassVar = (".png",)
    lossless: ClassVar = False

    def __init__(self) -> None:
        self._packer = PngPacker()

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        flow = self.raw_array(meta, payload)
        steps = np.rint(flow * np.float32(_KITTI_STEPS_PER_PX)) + np.float32(_KITTI_ZERO)
        # NaN compares as false, so it has no value either.
        valid: NDArray[np.bool_] = np.all((steps >= 0) & (steps <= _KITTI_LARGEST), axis=-1)
        coded = np.zeros((*flow.shape[:2], 3), np.uint16)
        coded[..., :2] = np.where(valid[..., None], steps, 0)
        coded[..., 2] = valid
        return (self._packer.pack(coded),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        coded = unpack_rgb16(contents[0])
        steps = coded[..., :2].astype(np.float32) - np.float32(_KITTI_ZERO)
        flow: NDArray[np.float32] = steps / np.float32(_KITTI_STEPS_PER_PX)
        flow[coded[..., 2] == 0] = np.nan
        return flow
