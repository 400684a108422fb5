"""Where episodes land: an attempt is written aside, one conditional create makes it exist.

``Store`` is the seam, ``LocalStore`` the folder on a disk; ``open_store`` picks one for ``--out``.
"""

from carstage.storage.address import local_folder
from carstage.storage.local import LocalStore
from carstage.storage.marker import CommitMarker, FileEntry
from carstage.storage.opening import open_store
from carstage.storage.store import AttemptFiles, Store

__all__ = [
    "AttemptFiles",
    "CommitMarker",
    "FileEntry",
    "LocalStore",
    "Store",
    "local_folder",
    "open_store",
]
