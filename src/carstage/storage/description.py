"""``dataset.json``: format version, name and the table of semantic tags."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from carstage import __version__
from carstage.errors import DatasetError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
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


def read_description(path: Path) -> dict[str, Any]:
    """The content of an existing ``dataset.json``.

    Raises:
        DatasetError: there is none, it is damaged, or its format version is not ours.
    """
    try:
        document = json.loads(read_bounded(path, LARGEST_DOCUMENT_BYTES))
        version = document["format_version"]
    except FileNotFoundError as error:
        raise DatasetError(
            f"{path.parent} is no Car-STAGE dataset: it has no {path.name}.",
            "Name the folder that was given as --out.",
        ) from error
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(
            f"{path} cannot be read: {error}.", "Name another folder or restore the file."
        ) from error
    if version != FORMAT_VERSION:
        raise DatasetError(
            f"{path} has format version {version!r}; this Car-STAGE knows {FORMAT_VERSION}.",
            "Install the version of Car-STAGE that wrote it.",
        )
    return dict(document)
