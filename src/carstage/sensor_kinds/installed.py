"""Modules of other packages that register what is theirs: found by entry points, or named."""

from __future__ import annotations

import sys
import threading
from functools import lru_cache
from importlib import import_module
from typing import Any, Iterable


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
    entries: Iterable[Any] = _entries().select(group=group)
    return entries


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
