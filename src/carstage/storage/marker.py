"""The commit marker: the one JSON file whose existence puts an episode into a dataset."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from carstage.errors import DatasetError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
from carstage.files.hashing import UnknownAlgorithmError, check_hash
from carstage.files.json_text import parse_json
from carstage.storage.remote_path import DatasetPath

FORMAT_VERSION = 2
_SHA256_VERSION = 1
"""Its entries have a field ``sha256`` instead of ``hash``."""


@dataclass(frozen=True, slots=True)
class FileEntry:
    """One file of a committed attempt.

    Attributes:
        path: POSIX path relative to the attempt's folder.
        bytes: size of the file.
        hash: ``<algorithm>:<lower-case hex digest>`` of its content.
    """

    path: str
    bytes: int
    hash: str


@dataclass(frozen=True, slots=True)
class CommitMarker:
    """What ``commits/<episode_id>.json`` says.

    Attributes:
        episode_id: id of the episode, the marker's file name.
        attempt: folder below ``episodes/<episode_id>/`` that holds the files.
        frames: number of saved frames.
        files: every file of the attempt, sorted by path.
        versions: versions of ``carstage``, the client and the server that made it.
        self_test: what the self-test found on that server; None where it was not tested.
    """

    episode_id: str
    attempt: str
    frames: int
    files: tuple[FileEntry, ...]
    versions: Mapping[str, str]
    self_test: Mapping[str, Any] | None = None

    def to_bytes(self) -> bytes:
        """The marker's file content; the same marker always gives the same bytes."""
        document = {
            "format_version": FORMAT_VERSION,
            "episode_id": self.episode_id,
            "attempt": self.attempt,
            "frames": self.frames,
            "files": [
                {"path": entry.path, "bytes": entry.bytes, "hash": entry.hash}
                for entry in self.files
            ],
            "versions": dict(sorted(self.versions.items())),
            "self_test": None if self.self_test is None else dict(self.self_test),
        }
        return (json.dumps(document, indent=1) + "\n").encode()

    @classmethod
    def from_bytes(cls, content: bytes, source: str) -> CommitMarker:
        """Read a marker.

        Args:
            content: bytes of the file.
            source: its name, for messages.

        Raises:
            DatasetError: the content is no marker of a format version that we know, or it has
                hashes of an unknown algorithm.
        """
        try:
            document: dict[str, Any] = parse_json(content)
            version = document["format_version"]
            if version in (_SHA256_VERSION, FORMAT_VERSION):
                return cls(
                    episode_id=str(document["episode_id"]),
                    attempt=str(document["attempt"]),
                    frames=int(document["frames"]),
                    files=tuple(
                        FileEntry(str(f["path"]), int(f["bytes"]), _named_hash(f, version))
                        for f in document["files"]
                    ),
                    versions={str(k): str(v) for k, v in document["versions"].items()},
                    # Markers of before the self-test have no such key.
                    self_test=_self_test(document.get("self_test")),
                )
        except UnknownAlgorithmError as error:
            raise DatasetError(
                f"The commit marker {source} cannot be checked: {error}.",
                "Install a newer Car-STAGE.",
            ) from error
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise DatasetError(
                f"The commit marker {source} is damaged ({error}).",
                "Remove it to record that episode again.",
            ) from error
        raise DatasetError(
            f"The commit marker {source} has format version {version!r}; "
            f"this version of Car-STAGE reads {_SHA256_VERSION} to {FORMAT_VERSION}.",
            "Install a newer Car-STAGE.",
        )


def _self_test(found: Any) -> Mapping[str, Any] | None:
    """The verdict on the server.

    Raises:
        ValueError: it is none.
    """
    if found is not None and not isinstance(found, dict):
        raise ValueError("self_test is no object")
    return found


def _named_hash(entry: Mapping[str, Any], version: int) -> str:
    """The hash of a marker's entry with the name of its algorithm.

    Raises:
        KeyError, ValueError: there is none.
        UnknownAlgorithmError: of its algorithm.
    """
    if version == _SHA256_VERSION:
        return f"sha256:{entry['sha256']}"
    return check_hash(str(entry["hash"]))


def read_marker(path: DatasetPath) -> CommitMarker:
    """Read a commit marker.

    Raises:
        FileNotFoundError: there is none.
        DatasetError: it cannot be read, or is damaged.
    """
    try:
        content = read_bounded(path, LARGEST_DOCUMENT_BYTES)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise DatasetError(
            f"The commit marker {path.name} cannot be read: {error.strerror}.",
            "Remove it to record that episode again.",
        ) from error
    return CommitMarker.from_bytes(content, path.name)
