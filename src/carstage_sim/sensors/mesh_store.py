"""Meshes of actors on disk: a shape takes a twentieth of a second to make and a thousandth to read.

A file holds one mesh; its name is a hash of what the mesh follows from and of the code that makes
it, so a file is never wrong, only out of use.
"""

from __future__ import annotations

import hashlib
import logging
import zipfile
from collections.abc import Callable
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import carstage_sim
from carstage_sim.cache import mark_used, written_atomically
from carstage_sim.mesh import TriangleMesh

logger = logging.getLogger(__name__)

_SOURCES = ("content", "sensors/actors.py", "mesh.py", "labels.py", "geometry.py")


class MeshStore:
    """Gives the mesh of a model key: the stored one, or one that is made and stored.

    Args:
        make: makes the mesh of a key.
        identity: all that a key's mesh follows from, except the code; None for what is not kept.
        folder: where meshes lie; created if missing. A folder that cannot be written costs time.
    """

    def __init__(
        self,
        make: Callable[[str], TriangleMesh],
        identity: Callable[[str], str | None],
        folder: Path,
    ) -> None:
        self._make = make
        self._identity = identity
        self._folder = folder

    def __call__(self, key: str) -> TriangleMesh:
        """The mesh of a model key."""
        identity = self._identity(key)
        if identity is None:
            return self._make(key)
        digest = hashlib.sha256(f"{_code_digest()}\n{identity}".encode()).hexdigest()[:24]
        path = self._folder / f"{digest}.npz"
        names = [field.name for field in fields(TriangleMesh)]
        mark_used(path)
        try:
            # np.load given a path would leave a file open that is no archive.
            with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
                return TriangleMesh(**{name: stored[name] for name in names})
        except FileNotFoundError:
            pass
        except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
            logger.warning("mesh %s is unreadable, making it again: %s", path, error)
        mesh = self._make(key)
        self._keep(path, {name: getattr(mesh, name) for name in names})
        return mesh

    def _keep(self, path: Path, arrays: dict[str, NDArray[Any]]) -> None:
        try:
            with written_atomically(path) as file:
                np.savez(file, allow_pickle=False, **arrays)
        except OSError as error:
            logger.warning("mesh not kept in %s: %s", self._folder, error)


@cache
def _code_digest() -> str:
    """Hash of all code that makes a mesh, and of numpy's version."""
    root = Path(carstage_sim.__file__).parent
    digest = hashlib.sha256(np.__version__.encode())
    for entry in _SOURCES:
        path = root / entry
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()
