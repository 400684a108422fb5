"""Codecs of the optical flow camera."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.codecs.codec import Codec, register
from carstage.dataset.codecs.npz import pack_npz, unpack_npz


@register("flow", "npz", default=True)
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
