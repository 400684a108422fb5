"""Codecs of the cameras. The raw record is BGRA8; alpha is dropped, the order becomes R, G, B."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from carstage.codecs.codec import Codec, image_bgra
from carstage.codecs.extras import need
from carstage.codecs.png import PngPacker, ZlibOfRuns, pixel_words, unpack_png
from carstage.sensor_kinds.columns import Bgra


class RgbBuffer:
    """An RGB image that is filled from BGRA images of one size."""

    def __init__(self) -> None:
        self._rgb: NDArray[np.uint8] = np.empty((0, 0, 3), np.uint8)

    def fill(self, bgra: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The buffer, ``(H, W, 3)``, until the next call."""
        # Numba takes half a second to import: only processes that encode pictures shall pay.
        from carstage.codecs.bgra_kernels import colours

        height, width = bgra.shape[:2]
        if self._rgb.shape[:2] != (height, width):
            self._rgb = np.empty((height, width, 3), np.uint8)
        colours(pixel_words(bgra), self._rgb.reshape(height, 3 * width))
        return self._rgb


class RgbPng(Codec):
    """8-bit RGB by libdeflate; decodes to ``(H, W, 3)`` uint8."""

    suffixes: ClassVar = (".png",)

    def __init__(self, packer: PngPacker | None = None) -> None:
        self._packer = packer or PngPacker()

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        return (self._packer.pack_bgra(image_bgra(meta, payload)),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        return rgb_pixels(contents[0])

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return image_bgra(meta, payload)[..., 2::-1]


class RgbRunsPng(RgbPng):
    """The same by Huffman codes and runs alone: for colours half the work of libdeflate.

    Files are as large where pictures have the noise of a camera, a sixth larger without it.
    """

    def __init__(self) -> None:
        super().__init__(PngPacker(ZlibOfRuns()))


class RgbFpng(RgbPng):
    """PNG by fpng: half the work of the default, some percent larger (extra ``fast-png``)."""

    def __init__(self) -> None:
        super().__init__()
        self._rgb = RgbBuffer()
        self._fpng = need("fpng", extra="fast-png", codec="fpng")

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        content: bytes = self._fpng.from_ndarray(self._rgb.fill(image_bgra(meta, payload)))
        return (content,)


class RgbJpeg(Codec):
    """JPEG of quality 95 without chroma subsampling: about a quarter of the PNG's size, lossy."""

    suffixes: ClassVar = (".jpg",)
    lossless: ClassVar = False
    quality: ClassVar = 95

    def __init__(self) -> None:
        self._rgb = RgbBuffer()

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        stream = io.BytesIO()
        picture = Image.fromarray(self._rgb.fill(image_bgra(meta, payload)))
        picture.save(stream, format="JPEG", quality=self.quality, subsampling=0)
        return (stream.getvalue(),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        try:
            with Image.open(io.BytesIO(contents[0]), formats=["JPEG"]) as picture:
                return np.asarray(picture.convert("RGB"))
        except (OSError, SyntaxError, ValueError) as error:
            raise ValueError(f"damaged JPEG: {error}") from error

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return image_bgra(meta, payload)[..., 2::-1]


class SemanticPng(Codec):
    """8-bit grey, the tag (the raw image's red channel); decodes to ``(H, W)`` uint8."""

    suffixes: ClassVar = (".png",)

    def __init__(self) -> None:
        self._packer = PngPacker()

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        return (self._packer.pack(image_bgra(meta, payload)[..., Bgra.RED]),)

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        return grey_pixels(contents[0], np.uint8)

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        return image_bgra(meta, payload)[..., Bgra.RED]


class InstancePng(Codec):
    """16-bit grey id and 8-bit grey tag; decodes to ``(H, W, 2)`` uint16: id, tag.

    In CARLA's instance image the tag is the red channel and the id is ``G + 256 B``.
    """

    suffixes: ClassVar = (".png", ".tag.png")

    def __init__(self) -> None:
        self._id_packer = PngPacker()
        self._tag_packer = PngPacker()

    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[bytes, ...]:
        """See ``Codec.encode``."""
        bgra = image_bgra(meta, payload)
        return self._id_packer.pack(_instance_id(bgra)), self._tag_packer.pack(bgra[..., Bgra.RED])

    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """See ``Codec.decode``."""
        ids, tags = grey_pixels(contents[0], np.uint16), grey_pixels(contents[1], np.uint8)
        if ids.shape != tags.shape:
            raise ValueError(f"id image {ids.shape} and tag image {tags.shape} differ in size")
        return np.stack([ids, tags.astype(np.uint16)], axis=-1)

    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """See ``Codec.raw_array``."""
        bgra = image_bgra(meta, payload)
        return np.stack([_instance_id(bgra), bgra[..., Bgra.RED].astype(np.uint16)], axis=-1)


def _instance_id(bgra: NDArray[np.uint8]) -> NDArray[np.uint16]:
    # B and G, read as one big-endian word, are 256 B + G.
    return bgra.view(">u2")[..., 0].astype(np.uint16)


def rgb_pixels(content: bytes) -> NDArray[np.uint8]:
    """``(H, W, 3)`` uint8 of a PNG file; ``ValueError`` for another pixel type."""
    pixels = unpack_png(content)
    if pixels.ndim != 3:
        raise ValueError(f"an RGB image is needed, not shape {pixels.shape}")
    return pixels.astype(np.uint8, copy=False)


def grey_pixels(content: bytes, dtype: type[np.unsignedinteger[Any]]) -> NDArray[Any]:
    """``(H, W)`` of a PNG file; ``ValueError`` for another pixel type than ``dtype``."""
    pixels = unpack_png(content)
    if pixels.ndim != 2 or pixels.dtype != dtype:
        raise ValueError(
            f"a grey image of type {np.dtype(dtype)} is needed, "
            f"not shape {pixels.shape} of type {pixels.dtype}"
        )
    return pixels
