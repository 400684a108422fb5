"""``dataset.json``: format version, name and the table of semantic tags."""

from __future__ import annotations

import json
from typing import Any

from carstage import __version__
from carstage.errors import DatasetError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
from carstage.files.json_text import parse_json
from carstage.storage.remote_path import DatasetPath
from carstage.tags import TAGS_0_9_14

FORMAT_VERSION = 1


def describe_dataset(name: str) -> bytes:
    """The content of a new ``dataset.json``."""
    document = {
        "format_version": FORMAT_VERSION,
        "name": name,
        "created_by": f"carstage {__version__}",
        "tags": [
            {"value": value, "name": tag.name, "rgb": list(tag.rgb)}
            for value, tag in TAGS_0_9_14.items()
        ],
    }
    return (json.dumps(document, indent=1) + "\n").encode()


def read_description(path: DatasetPath) -> dict[str, Any]:
    """The content of an existing ``dataset.json``.

    Raises:
        DatasetError: there is none, it is damaged, or its format version is not ours.
        StoreAccessError: the store lets nobody look.
    """
    try:
        content = read_bounded(path, LARGEST_DOCUMENT_BYTES)
    except FileNotFoundError as error:
        raise DatasetError(
            f"{path.parent} is no Car-STAGE dataset: it has no {path.name}.",
            "Name what was given as --out.",
        ) from error
    except OSError as error:
        raise _unreadable(str(path), error) from error
    return parse_description(content, str(path))


def parse_description(content: bytes, source: str) -> dict[str, Any]:
    """The document in the content of a ``dataset.json``.

    Args:
        content: bytes of the file.
        source: its name, for messages.

    Raises:
        DatasetError: it is damaged, or its format version is not ours.
    """
    try:
        document = parse_json(content)
        version = document["format_version"]
    except (ValueError, KeyError, TypeError) as error:
        raise _unreadable(source, error) from error
    if version != FORMAT_VERSION:
        raise DatasetError(
            f"{source} has format version {version!r}; this Car-STAGE knows {FORMAT_VERSION}.",
            "Install the version of Car-STAGE that wrote it.",
        )
    return dict(document)


def _unreadable(source: str, error: Exception) -> DatasetError:
    return DatasetError(
        f"{source} cannot be read: {error}.", "Name another dataset or restore the file."
    )
