"""Compares a catalog with the markers of a dataset, and the markers with the files."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from sqlalchemy import select

from carstage.catalog.address import location_of
from carstage.catalog.schema import DATASETS, EPISODES
from carstage.catalog.summaries import hash_of_marker
from carstage.dataset import Dataset, Episode
from carstage.files.bounded import open_regular
from carstage.files.hashing import hash_of_file

if TYPE_CHECKING:
    from carstage.catalog.database import Catalog

Kind = Literal["not_in_catalog", "not_in_dataset", "other_marker", "missing", "size", "hash"]


@dataclass(frozen=True, slots=True)
class Difference:
    """Something that is not as it should be.

    Attributes:
        kind: ``not_in_catalog``, ``not_in_dataset``, ``other_marker``: what ``rebuild`` puts right.
            ``missing``, ``size``, ``hash``: a file is not the one of the marker.
        episode_id: the episode's.
        message: one sentence.
    """

    kind: Kind
    episode_id: str
    message: str

    def to_json(self) -> dict[str, Any]:
        """For ``--json``."""
        return {"kind": self.kind, "episode_id": self.episode_id, "message": self.message}


def verify(
    catalog: Catalog,
    dataset: Dataset,
    *,
    deep: bool = False,
    progress: Callable[[int, int], object] = lambda done, total: None,
) -> Iterator[Difference]:
    """Everything in which catalog, markers and files differ.

    Args:
        catalog: is read.
        dataset: is read.
        deep: read every file and compute its hash, too.
        progress: called with the number of episodes that are done, and of all.

    Raises:
        CatalogError: the catalog cannot be read.
        DatasetError: a marker cannot be read.
    """
    known = _known(catalog, location_of(dataset.path, catalog.address))
    present = {episode.id for episode in dataset.episodes}
    for episode_id in sorted(known.keys() - present):
        yield Difference("not_in_dataset", episode_id, "It is in the catalog, but has no marker.")
    for done, episode in enumerate(dataset.episodes, 1):
        found = known.get(episode.id)
        if found is None:
            yield Difference("not_in_catalog", episode.id, "It has a marker, but is not there.")
        elif found != hash_of_marker(episode.marker):
            yield Difference("other_marker", episode.id, "The catalog knows another marker of it.")
        yield from _files(episode, deep=deep)
        progress(done, len(dataset.episodes))


def _known(catalog: Catalog, location: str) -> Mapping[str, str]:
    """Hash of the marker by episode."""
    query = (
        select(EPISODES.c.episode_id, EPISODES.c.marker_hash)
        .join(DATASETS, DATASETS.c.id == EPISODES.c.dataset)
        .where(DATASETS.c.location == location)
    )
    with catalog.reading() as connection:
        return {row.episode_id: row.marker_hash for row in connection.execute(query)}


def _files(episode: Episode, *, deep: bool) -> Iterator[Difference]:
    """The files of an episode that are not those of its marker."""
    for entry in episode.marker.files:
        path = episode.folder / entry.path
        try:
            size = path.stat().st_size
            if size != entry.bytes:
                text = f"{entry.path} has {size} bytes, not {entry.bytes}."
                yield Difference("size", episode.id, text)
            elif deep:
                with os.fdopen(open_regular(path), "rb") as file:
                    found, _ = hash_of_file(file, entry.hash)
                if found != entry.hash:
                    text = f"{entry.path} has another hash than its marker says."
                    yield Difference("hash", episode.id, text)
        except OSError as error:
            text = f"{entry.path} cannot be read: {error.strerror or error}."
            yield Difference("missing", episode.id, text)
