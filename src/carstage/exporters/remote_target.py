"""Exports into an object store: made in a folder here, then sent."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from carstage.cache import cache_folder
from carstage.errors import BadInputError
from carstage.exporters.target import DOCUMENT
from carstage.storage import DatasetPath, RemotePath, open_store
from carstage.storage.remote_files import remote_files

_SENT_AT_ONCE = 8


def check_remote_target(out: RemotePath, dataset: DatasetPath, *, overwrite: bool) -> None:
    """Refuse a place that the export may not become.

    Raises:
        BadInputError: something is there and may not be replaced, is no export although it shall
            be replaced, or the dataset and it lie in one another.
        StoreAccessError: the store lets nobody look.
    """
    source, target = f"{dataset}/", f"{out}/"
    if isinstance(dataset, RemotePath) and (source.startswith(target) or target.startswith(source)):
        raise BadInputError(
            f"{out} and the dataset {dataset} lie in one another.", "Name another place."
        )
    open_store(out).check()
    if not out.is_dir():
        return
    if not overwrite:
        raise BadInputError(f"{out} exists already.", "Name another place or add --overwrite.")
    if not (out / DOCUMENT).is_file():
        raise BadInputError(
            f"{out} was not written by `carstage export`: it has no {DOCUMENT}.",
            "Remove it yourself or name another place.",
        )


@contextmanager
def remote_folder(out: RemotePath) -> Iterator[Path]:
    """Give a new folder of this machine that is sent to ``out`` when the block succeeds.

    ``export.json`` goes last, and what stood there before goes first: without it, nothing there is
    an export. The folder takes as much room here as the export has.

    Raises:
        StorageError: sending failed; the same command with ``--overwrite`` may be given again.
    """
    parent = cache_folder() / "exports"
    parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(dir=parent))
    try:
        yield folder
        _send(folder, out)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _send(folder: Path, out: RemotePath) -> None:
    files = remote_files(out.root)
    names = sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    names.remove(DOCUMENT)
    before = {found.key for found in files.below(out.key)}
    files.delete([(out / DOCUMENT).key])
    with ThreadPoolExecutor(_SENT_AT_ONCE) as threads:
        for _ in threads.map(lambda name: files.write((out / name).key, folder / name), names):
            pass
    kept = {(out / name).key for name in (*names, DOCUMENT)}
    files.delete(before - kept)
    files.write((out / DOCUMENT).key, folder / DOCUMENT)
