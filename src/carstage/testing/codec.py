"""What every ``Codec`` must do; subclass ``CodecTests`` in a test module and give it records."""

# ruff: noqa: D102 (the name of a test states its rule)

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from carstage.codecs import Codec

RawRecord = tuple[Mapping[str, Any], memoryview]


class CodecTests:
    """The contract of a codec, as tests.

    Override ``codec``, ``records`` and ``bad_records``.

    Attributes:
        tolerance: the most mean difference of a codec that is not lossless.
        empty_is_damage: whether a file of no bytes is damaged; a point cloud may be empty.
    """

    tolerance: float = 0.0
    empty_is_damage: bool = True

    def codec(self) -> Codec:
        """A new instance."""
        raise NotImplementedError

    def records(self) -> list[RawRecord]:
        """At least two raw records with different content, of different sizes if possible."""
        raise NotImplementedError

    def bad_records(self) -> list[RawRecord]:
        """Records whose payload is not what their meta says."""
        raise NotImplementedError

    def test_there_is_one_content_per_suffix(self) -> None:
        codec = self.codec()
        for record in self.records():
            contents = codec.encode(*record)
            assert len(contents) == len(codec.suffixes)
            assert all(isinstance(content, bytes | memoryview) for content in contents)

    def test_decoding_gives_what_was_recorded(self) -> None:
        codec = self.codec()
        for record in self.records():
            decoded, expected = codec.decode(_encoded(codec, record)), codec.raw_array(*record)
            assert decoded.shape == expected.shape
            assert decoded.dtype == expected.dtype
            if codec.lossless:
                np.testing.assert_array_equal(decoded, expected)
            else:
                difference = np.abs(decoded.astype(np.float64) - expected)
                assert difference.mean() <= self.tolerance

    def test_the_same_record_gives_the_same_bytes_whatever_came_before(self) -> None:
        used = self.codec()
        first = [_encoded(used, record) for record in self.records()]
        again = [_encoded(used, record) for record in reversed(self.records())][::-1]
        fresh = [_encoded(self.codec(), record) for record in self.records()]
        assert first == again == fresh

    def test_different_records_give_different_bytes(self) -> None:
        codec = self.codec()
        contents = [_encoded(codec, record) for record in self.records()]
        assert len(set(contents)) == len(contents)

    def test_a_record_of_the_wrong_size_is_refused(self) -> None:
        codec = self.codec()
        for record in self.bad_records():
            with pytest.raises(ValueError, match=r"."):
                codec.encode(*record)

    def test_cut_content_is_reported_as_damage(self) -> None:
        codec = self.codec()
        for record in self.records():
            contents = _encoded(codec, record)
            for index, content in enumerate(contents):
                # Odd lengths: a cut at a whole record may be a shorter, valid file.
                for length in (0, 1, len(content) // 2 | 1):
                    cut = list(contents)
                    cut[index] = content[:length]
                    if length == 0 and not self.empty_is_damage:
                        continue
                    with pytest.raises(ValueError, match=r"."):
                        codec.decode(cut)


def _encoded(codec: Codec, record: RawRecord) -> tuple[bytes, ...]:
    return tuple(bytes(content) for content in codec.encode(*record))
