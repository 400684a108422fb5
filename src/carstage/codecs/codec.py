"""The contract of a codec, and which ones there are by sensor kind and name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from carstage.errors import BadInputError
from carstage.sensor_kinds import installed_entries, known_kind, load_object, sensor_kind

ENTRY_POINT_GROUP = "carstage.codecs"

Content = bytes | memoryview
"""What a file will hold."""


class Codec(ABC):
    """Turns one frame of one sensor into file contents, and back.

    The contract (``carstage.testing.codec.CodecTests`` checks an implementation):

    * ``encode`` returns one content per entry of ``suffixes``; the same record always gives the
      same bytes, whatever was encoded before.
    * ``decode(encode(record))`` gives the same array as ``raw_array(record)``, exactly if
      ``lossless``.
    * ``decode`` raises ``ValueError`` (or a subclass) for damaged content, nothing else.

    An instance belongs to one thread: it may keep buffers between calls.

    Attributes:
        suffixes: ends of the file names, such as ``(".png", ".tag.png")``.
        lossless: whether nothing of the frame is lost.
    """

    suffixes: ClassVar[tuple[str, ...]]
    lossless: ClassVar[bool] = True

    @abstractmethod
    def encode(self, meta: Mapping[str, Any], payload: memoryview) -> tuple[Content, ...]:
        """Content of the frame's files.

        Args:
            meta: what a data record of the raw log says, see ``docs/formats/raw-log.md``.
            payload: the record's bytes. What is written as it came need not be copied: the
                payload stays as long as it is held.

        Raises:
            ValueError: the payload does not have the size that the meta says.
        """

    @abstractmethod
    def decode(self, contents: Sequence[bytes]) -> NDArray[Any]:
        """The frame's array from the contents of its files, in the order of ``suffixes``.

        Several threads may call it at once.

        Raises:
            ValueError: the content is damaged.
        """

    @abstractmethod
    def raw_array(self, meta: Mapping[str, Any], payload: memoryview) -> NDArray[Any]:
        """The array that ``decode`` shall give, straight from the raw record."""


_Class = TypeVar("_Class", bound=type[Codec])
_added: dict[tuple[str, str], type[Codec]] = {}


def register(kind: str, name: str) -> Callable[[_Class], _Class]:
    """Class decorator: add a codec to those that the table has for ``kind``.

    Args:
        kind: sensor kind, such as ``rgb``.
        name: what users write under ``conversion.codecs``.
    """

    def decorate(codec: _Class) -> _Class:
        _added[kind, name] = codec
        return codec

    return decorate


def codec_names(kind: str) -> tuple[str, ...]:
    """Names of the codecs for a sensor kind, the default first; empty for an unknown kind."""
    _load_installed()
    row = known_kind(kind)
    listed = list(row.codecs) if row is not None else []
    added = sorted(name for known, name in _added if known == kind and name not in listed)
    return (*listed, *added)


def codec_for(kind: str, name: str | None = None) -> tuple[str, Codec]:
    """A codec for a sensor kind, with its name.

    Args:
        kind: sensor kind.
        name: name of the codec, ``None`` for the kind's default.

    Raises:
        BadInputError: no such codec.
    """
    names = codec_names(kind)
    chosen = name if name is not None else next(iter(names), None)
    if chosen is None or chosen not in names:
        known = ", ".join(names) or "none"
        raise BadInputError(
            f"conversion.codecs: no codec {name!r} for sensors of kind {kind!r}.",
            f"Codecs of that kind: {known}.",
        )
    codec = _added.get((kind, chosen)) or load_object(sensor_kind(kind).codecs[chosen])
    return chosen, codec()


@cache
def _load_installed() -> None:
    """Import the codecs that other distributions declare as entry points, once."""
    for entry in installed_entries(ENTRY_POINT_GROUP):
        entry.load()


def image_shape(meta: Mapping[str, Any], payload: memoryview) -> tuple[int, int]:
    """Height and width of a camera record.

    Raises:
        ValueError: the payload is not ``height * width`` BGRA pixels.
    """
    height, width = int(meta["height"]), int(meta["width"])
    if height < 1 or width < 1 or payload.nbytes != 4 * height * width:
        raise ValueError(
            f"a camera record of {payload.nbytes} bytes is no {width}x{height} BGRA image"
        )
    return height, width


def image_bgra(meta: Mapping[str, Any], payload: memoryview) -> NDArray[np.uint8]:
    """``(H, W, 4)`` uint8 view of a camera record, order B, G, R, A."""
    height, width = image_shape(meta, payload)
    return np.frombuffer(payload, np.uint8).reshape(height, width, 4)
