"""Hashes carry the name of their algorithm."""

from __future__ import annotations

import hashlib
import io

import pytest

from carstage.files.hashing import UnknownAlgorithmError, check_hash, hash_of, hash_of_file

#: BLAKE3's official test vectors: 0, 1 and 1025 bytes that count from 0 to 250 again and again.
_BLAKE3 = {
    0: "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262",
    1: "2d3adedff11b61f14c886e35afa036736dcd87a74d27b5c1510225d0f592e213",
    1025: "d00278ae47eb27b34faecf67b4fe263f82d5412916c1ffd97c8cb7fb814b8444",
}


@pytest.mark.parametrize(("length", "digest"), _BLAKE3.items())
def test_new_hashes_are_blake3(length: int, digest: str) -> None:
    content = bytes(i % 251 for i in range(length))
    assert hash_of(content) == hash_of(memoryview(content)) == f"blake3:{digest}"


@pytest.mark.parametrize("like", ["sha256", f"sha256:{'0' * 64}"])
def test_hashes_of_version_1_are_computed_again(like: str) -> None:
    assert hash_of(b"abc", like) == f"sha256:{hashlib.sha256(b'abc').hexdigest()}"


@pytest.mark.parametrize("like", ["blake3", "sha256"])
def test_a_file_has_the_hash_of_its_content(like: str) -> None:
    content = bytes(range(256)) * 10_000  # more than one chunk
    assert hash_of_file(io.BytesIO(content), like) == (hash_of(content, like), len(content))


def test_an_unknown_algorithm_is_refused_by_name() -> None:
    with pytest.raises(UnknownAlgorithmError, match=r"'md5' is unknown.* blake3 and sha256"):
        check_hash("md5:00")
    with pytest.raises(ValueError, match="no digest"):
        check_hash("blake3")
