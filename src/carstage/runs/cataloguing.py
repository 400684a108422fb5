"""What a run commits goes into a catalog, where one is named."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

from carstage.catalog.address import CATALOG_VARIABLE, catalog_address
from carstage.runs.events import EpisodeCommitted, OnEvent, RunEvent, RunFinished
from carstage.runs.folder import RunFolder
from carstage.runs.reading import read_document
from carstage.storage import DatasetPath

Follow: TypeAlias = Callable[[OnEvent | None, RunFolder], OnEvent | None]
"""Gives what a run has to call with its events, from what the caller wants to be called."""


@contextmanager
def run_catalog(
    given: str | None, out: DatasetPath, notice: Callable[[str], None]
) -> Iterator[Follow]:
    """A stretch in which committed episodes are written to the catalog.

    Without a catalog nothing is done, and no database library is loaded.

    Args:
        given: address of the catalog; None: that of ``CARSTAGE_CATALOG``, if it is set.
        out: the dataset.
        notice: called with a sentence where episodes are not in the catalog.

    Raises:
        BadInputError: the address is none, or a package is not installed.
        CatalogError: the catalog cannot be opened, or is of a newer schema.
    """
    if not given and not os.environ.get(CATALOG_VARIABLE):
        yield lambda on_event, folder: on_event
        return
    from carstage.catalog import CatalogFollower, run_row

    with CatalogFollower(catalog_address(given), out, notice) as follower:

        def follow(on_event: OnEvent | None, folder: RunFolder) -> OnEvent:
            def pass_on(event: RunEvent) -> None:
                if isinstance(event, EpisodeCommitted):
                    follower.committed(event.episode_id, folder.run_id)
                elif isinstance(event, RunFinished):
                    names = ("plan.json", "status.json")
                    plan, status = (read_document(folder.path / name) or {} for name in names)
                    follower.ended({"run_id": folder.run_id, **run_row(plan, status)})
                if on_event is not None:
                    on_event(event)

            return pass_on

        yield follow
