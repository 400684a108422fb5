"""Modules of other packages that register what is theirs: found by entry points, or named."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any, Iterable, Optional

_ENDS = (".dist-info", ".egg-info")


class InstalledModules:
    """The modules that installed packages name in a group of entry points.

    Under a Python that is older than 3.10 nothing is looked up: only collectors run there, and
    their plan names the modules.

    Args:
        group: of the entry points.
    """

    def __init__(self, group: str) -> None:
        self._group = group
        self._scanned = False
        self._scanning = threading.RLock()

    def load(self) -> None:
        """Import them; the first call only. Other threads wait until they are there."""
        if sys.version_info < (3, 10):
            return
        with self._scanning:  # reentrant: a module may ask while it is imported
            if self._scanned:
                return
            self._scanned = True
            import_plugins(entry.module for entry in installed_entries(self._group))


def installed_entries(group: str) -> Iterable[Any]:
    """The entry points of a group that installed packages declare, since Python 3.10."""
    declared = _declared()
    if declared is not None and b"[%s]" % group.encode() not in declared:
        return ()
    entries: Iterable[Any] = _entries().select(group=group)
    return entries


@lru_cache(maxsize=None)
def _declared() -> Optional[bytes]:
    """What all installed packages say of entry points; None: they cannot all be found in folders.

    Most often no package names a group. To learn that from ``importlib.metadata`` takes 40 ms of
    every process, most of them for loading it; to read the files takes two.
    """
    finders = [one for one in sys.meta_path if hasattr(one, "find_distributions")]
    if finders != [PathFinder]:
        return None
    texts = []
    for place in map(Path, dict.fromkeys(sys.path)):
        if place.suffix == ".egg" or place.is_file():
            return None
        try:
            with os.scandir(place) as entries:
                records = [Path(one.path) for one in entries if one.name.lower().endswith(_ENDS)]
        except OSError:  # there is no such folder, and so no package in it
            continue
        for record in records:
            with suppress(OSError):  # it declares none
                texts.append((record / "entry_points.txt").read_bytes())
    return b"\n".join(texts)


@lru_cache(maxsize=None)
def _entries() -> Any:
    """Those of all groups: who reads them for one reads the files of every installed package."""
    from importlib.metadata import entry_points

    return entry_points()


def import_plugins(modules: Iterable[str]) -> None:
    """Import modules that register something.

    Raises:
        ImportError: one cannot be imported.
    """
    for module in modules:
        import_module(module)
