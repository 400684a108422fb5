"""Loads what requests need, once, in one thread.

The page is served before that is done. Handlers import where they use, but two threads that import
modules which import each other may see a half-made one: so all of them wait for this.
"""

from __future__ import annotations

import threading
from importlib import import_module

_MODULES = (
    "carstage.config",
    "carstage.plan",
    "carstage.server",
    "carstage.dataset",
    "carstage.report.drawing",
    "carstage.report.statistics",
    "carstage.annotation.schema",
    "carstage.runs.servers",
    "carstage.runs.preflight",
    "carstage.server.asking",
    "carstage.runs.server_lock",
    "carstage.runs.launching",
    "carstage.execution",
    "carstage.web.preview.sensor_picture",
    "pyarrow.compute",
)

_begun = threading.Lock()
_done = threading.Event()


def load() -> None:
    """Import everything; returns when it is there, whoever began."""
    if _done.is_set():
        return
    with _begun:
        for name in _MODULES:
            import_module(name)
        _done.set()
