"""The JSON documents of a dataset, read."""

from __future__ import annotations

import json
from typing import Any

from carstage.errors import DatasetError, StoreAccessError
from carstage.files.bounded import LARGEST_DOCUMENT_BYTES, read_bounded
from carstage.storage.remote_path import DatasetPath


def read_document(path: DatasetPath, version: int) -> dict[str, Any]:
    """A document of a known format version.

    Raises:
        DatasetError: it cannot be read, or is of another version.
        StoreAccessError: the object store lets nobody look.
    """
    try:
        document = json.loads(read_bounded(path, LARGEST_DOCUMENT_BYTES))
        found = document["format_version"]
    except StoreAccessError:  # a ValueError, too; it says nothing of the document
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DatasetError(f"{path} cannot be read: {error!r}.") from error
    if found != version:
        raise DatasetError(
            f"{path} has format version {found!r}; this Car-STAGE knows {version}.",
            "Install the version of Car-STAGE that wrote it.",
        )
    return dict(document)
