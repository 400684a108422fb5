"""Where episodes land: an attempt is written aside, one conditional create makes it exist.

``Store`` is the seam, ``LocalStore`` the folder on a disk, ``ObjectStore`` S3 and its like;
``open_store`` picks one for ``--out``.
"""

from carstage.storage.address import dataset_root, local_folder
from carstage.storage.attempt_files import AttemptFiles, FolderFiles
from carstage.storage.local import LocalStore
from carstage.storage.marker import CommitMarker, FileEntry
from carstage.storage.opening import open_store
from carstage.storage.remote_path import DatasetPath, RemotePath
from carstage.storage.store import AttemptSize, Lease, Store

__all__ = [
    "AttemptFiles",
    "AttemptSize",
    "CommitMarker",
    "DatasetPath",
    "FileEntry",
    "FolderFiles",
    "Lease",
    "LocalStore",
    "RemotePath",
    "Store",
    "dataset_root",
    "local_folder",
    "open_store",
]
