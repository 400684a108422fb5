"""How the command line loads modules: without looking for garbage among what stays."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def loading() -> Iterator[None]:
    """A stretch in which modules are loaded, or a configuration is checked.

    What it makes stays as long as the process: to look through it again and again takes 40 ms of
    a run. So Python does not look for garbage meanwhile, nor among that later.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
