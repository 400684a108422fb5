"""From what the user gives as ``--out`` to the store that it names."""

from __future__ import annotations

from pathlib import Path

from carstage.storage.address import dataset_root
from carstage.storage.local import LocalStore
from carstage.storage.remote_path import RemotePath
from carstage.storage.store import Store


def open_store(address: str | Path | RemotePath) -> Store:
    """The store that an address names; nothing is asked of it yet.

    Args:
        address: a folder, or a URL, see ``dataset_root``.

    Raises:
        BadInputError: the address is of no store that is built in, or a package for it is missing.
        StoreAccessError: the environment's settings for the store cannot be used.
    """
    root = dataset_root(address)
    if isinstance(root, RemotePath):
        from carstage.storage.objects import ObjectStore

        return ObjectStore(root)
    return LocalStore(root)
