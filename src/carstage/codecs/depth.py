"""Codecs of depth images: CARLA's code, centimetres, floats; all decode to metres."""

from __future__ import annotations

import io
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from carstage.codecs.codec import Codec, image_bgra
from carstage.codecs.extras import need
from carstage.codecs.images import RgbPng, grey_pixels, rgb_pixels
from carstage.codecs.npz import pack_npz, unpack_npz
from carstage.codecs.png import PngPacker

DEPTH_STEP_M = 1000.0 / (2**24 - 1)
"""Metres per step of CARLA's 24-bit depth code (``ref_sensors.md``, depth camera)."""

_CM_PER_M = 100.0
_LARGEST_CM = 2**16 - 1


class DepthPng(RgbPng):
    """CARLA's 24-bit code as 8-bit RGB; decodes to ``(H, W)`` float32 metres."""

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        return _metres(_code_of_rgb(rgb_pixels(contents[0])))

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return _metres(_code_of_bgra(image_bgra(meta, payload)))


class _MetresCodec(Codec):
    """Stores the metres themselves, ``(H, W)`` float32."""

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        return (self._pack(self.raw_array(meta, payload)),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        depth_m = self._unpack(contents[0])
        if depth_m.ndim != 2:
            raise ValueError(f"a depth image has two axes, not shape {depth_m.shape}")
        return depth_m.astype(np.float32, copy=False)

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return _metres(_code_of_bgra(image_bgra(meta, payload)))

    @abstractmethod
    def _pack(self, depth_m: NDArray[np.float32]) -> bytes: ...

    @abstractmethod
    def _unpack(self, content: bytes) -> NDArray[Any]: ...


class DepthPng16(_MetresCodec):
    """Centimetres as 16-bit grey, as many depth datasets have it; 655.35 m is "that or farther"."""

    suffixes: ClassVar = (".png",)
    lossless: ClassVar = False

    def __init__(self) -> None:
        self._packer = PngPacker()

    def _pack(self, depth_m: NDArray[np.float32]) -> bytes:
        cm = np.minimum(np.rint(depth_m * _CM_PER_M), _LARGEST_CM).astype(np.uint16)
        return self._packer.pack(cm)

    def _unpack(self, content: bytes) -> NDArray[Any]:
        return grey_pixels(content, np.uint16) / np.float32(_CM_PER_M)


class DepthNpz(_MetresCodec):
    """float32 metres under the name ``depth_m`` in a compressed NPZ."""

    suffixes: ClassVar = (".npz",)

    def _pack(self, depth_m: NDArray[np.float32]) -> bytes:
        return pack_npz({"depth_m": depth_m})

    def _unpack(self, content: bytes) -> NDArray[Any]:
        return unpack_npz(content, "depth_m")


class DepthNpz16(DepthNpz):
    """float16 metres: half the size, 3 significant digits."""

    lossless: ClassVar = False

    def _pack(self, depth_m: NDArray[np.float32]) -> bytes:
        return pack_npz({"depth_m": depth_m.astype(np.float16)})


class DepthExr(_MetresCodec):
    """float32 metres in the channel ``Z`` of an OpenEXR file, ZIP compressed (extra ``exr``)."""

    suffixes: ClassVar = (".exr",)

    def __init__(self) -> None:
        self._openexr = need("OpenEXR", extra="exr", codec="exr")

    def _pack(self, depth_m: NDArray[np.float32]) -> bytes:
        header = {
            "compression": self._openexr.ZIP_COMPRESSION,
            "type": self._openexr.scanlineimage,
        }
        stream = io.BytesIO()
        self._openexr.File(header, {"Z": depth_m}).write(stream)
        return stream.getvalue()

    def _unpack(self, content: bytes) -> NDArray[Any]:
        try:
            with self._openexr.File(io.BytesIO(content)) as file:
                return np.array(file.channels()["Z"].pixels)
        except (RuntimeError, KeyError, TypeError) as error:
            raise ValueError(f"damaged EXR: {error}") from error


def _metres(code: NDArray[np.uint32]) -> NDArray[np.float32]:
    """``1000 code / (2^24 - 1)``, computed in float64, then rounded."""
    depth_m: NDArray[np.float32] = (code * DEPTH_STEP_M).astype(np.float32)
    return depth_m


def _code_of_bgra(bgra: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """``R + 256 G + 65536 B``: B, G, R, A read as one big-endian word, without A."""
    code: NDArray[np.uint32] = bgra.view(">u4")[..., 0].astype(np.uint32) >> np.uint32(8)
    return code


def _code_of_rgb(rgb: NDArray[np.uint8]) -> NDArray[np.uint32]:
    red, green, blue = np.moveaxis(rgb.astype(np.uint32), -1, 0)
    code: NDArray[np.uint32] = red | green << np.uint32(8) | blue << np.uint32(16)
    return code
