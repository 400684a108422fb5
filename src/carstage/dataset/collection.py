"""A dataset: its committed episodes, its splits, and questions about all of it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from functools import cached_property

import pyarrow as pa

from carstage.dataset.querying import query_episodes
from carstage.dataset.reading import Episode
from carstage.dataset.saved_frames import Frame
from carstage.dataset.splits import Split, StoredSplits, read_splits
from carstage.dataset.variants import EpisodeVariants, variants_of
from carstage.errors import BadInputError
from carstage.lazy import keep_pandas_lazy
from carstage.storage.address import dataset_root
from carstage.storage.description import read_description
from carstage.storage.opening import open_store
from carstage.storage.remote_path import DatasetPath


class Dataset:
    """A dataset in a folder or an object store.

    What is read from an object store is fetched once, into a bounded cache on this machine.

    Args:
        path: what was given as ``--out``: a folder, or such as ``s3://bucket/prefix``.

    Raises:
        BadInputError: the address is of no store that is known, or a package for it is missing.
        DatasetError: the place holds no dataset, or one of another format version.
        StoreAccessError: the object store lets nobody look.
    """

    def __init__(self, path: str | DatasetPath) -> None:
        keep_pandas_lazy()
        self.path = dataset_root(path)
        self.description = read_description(self.path / "dataset.json")
        self._chosen: tuple[Episode, ...] | None = None

    @property
    def name(self) -> str:
        """The name that it was created with."""
        return str(self.description["name"])

    @cached_property
    def episodes(self) -> tuple[Episode, ...]:
        """The committed episodes, sorted by id.

        Raises:
            DatasetError: a commit marker is damaged.
        """
        if self._chosen is not None:
            return self._chosen
        store = open_store(self.path)
        return tuple(
            Episode(self.path / "episodes" / marker.episode_id / marker.attempt, marker)
            for marker in store.committed().values()
        )

    def episode(self, episode_id: str) -> Episode:
        """One committed episode.

        Raises:
            BadInputError: there is none of that id.
        """
        for episode in self.episodes:
            if episode.id == episode_id:
                return episode
        raise BadInputError(
            f"{self.path} has no episode {episode_id}.",
            f"Episodes: {', '.join(episode.id for episode in self.episodes)}.",
        )

    def only(self, episode_ids: Collection[str]) -> Dataset:
        """The same dataset, of which nothing but these episodes is seen; none: all are.

        Raises:
            BadInputError: it has no episode of such an id.
        """
        if not episode_ids:
            return self
        return self._of(self.episode(name) for name in sorted(set(episode_ids)))

    def as_agent(self, name: str) -> Dataset:
        """The same dataset, with an agent of that name in the ego's place in every episode.

        Raises:
            BadInputError: an episode has no such agent.
        """
        return self._of(episode.agent(name) for episode in self.episodes)

    def as_variant(self, name: str) -> Dataset:
        """The same dataset, of which only the episodes of one variant are seen.

        Raises:
            BadInputError: no episode is a variant of that name.
        """
        chosen = tuple(episode for episode in self.episodes if episode.variant == name)
        if not chosen:
            known = {episode.variant or "" for episode in self.episodes} - {""}
            raise BadInputError(
                f"{self.path} has no variant {name!r}.",
                f"Variants: {', '.join(sorted(known)) or 'none'}.",
            )
        return self._of(chosen)

    def _of(self, episodes: Iterable[Episode]) -> Dataset:
        """The same dataset, of which these are all episodes."""
        seen = Dataset(self.path)
        seen._chosen = tuple(episodes)
        return seen

    def variants(self) -> tuple[EpisodeVariants, ...]:
        """The episodes that were recorded in variants, each with all of them, frame by frame.

        Raises:
            DatasetError: a commit marker or the document of an episode is damaged.
        """
        return variants_of(self.episodes)

    @cached_property
    def stored_splits(self) -> StoredSplits | None:
        """What ``carstage split`` has stored; ``None``: nothing.

        Raises:
            DatasetError: ``splits.json`` is damaged.
        """
        return read_splits(self.path)

    def splits(self) -> dict[str, Split]:
        """The split of each committed episode by its id; without stored splits all ``train``.

        Raises:
            DatasetError: ``splits.json`` or a commit marker is damaged.
        """
        stored = self.stored_splits
        if stored is None:
            return {episode.id: "train" for episode in self.episodes}
        # Of those that were drawn no document is read.
        drawn = stored.episodes
        return {e.id: drawn.get(e.id) or stored.of(e.id, e.base_id) for e in self.episodes}

    def split(self, name: Split) -> tuple[Episode, ...]:
        """The episodes of one split, sorted by id.

        Args:
            name: ``train``, ``val`` or ``test``.

        Raises:
            BadInputError: no episode is in it.
            DatasetError: ``splits.json`` or a commit marker is damaged.
        """
        splits = self.splits()
        chosen = tuple(episode for episode in self.episodes if splits[episode.id] == name)
        if not chosen:
            raise BadInputError(
                f"{self.path} has no episode in split {name!r}.",
                f"Make splits: carstage split {self.path} --val 0.2 --test 0.1.",
            )
        return chosen

    def iter_frames(self) -> Iterator[Frame]:
        """The frames of all episodes; sensors are read when they are asked for.

        Raises:
            DatasetError: a table is missing or damaged.
        """
        return (frame for episode in self.episodes for frame in episode.iter_frames())

    def sql(self, query: str) -> pa.Table:
        """The result of an SQL query over the label tables of all episodes (extra ``sql``).

        Args:
            query: DuckDB's SQL over ``objects``, ``camera_objects``, ``ego``, ``sensor_poses`` and
                ``frames``, such as ``SELECT class, count(*) FROM objects GROUP BY class``. Those of
                agents are ``agent_objects`` and so on, with the column ``agent``.

        Raises:
            BadInputError: DuckDB is not installed, or refuses the query.
            DatasetError: a table is missing or damaged.
        """
        return query_episodes([episode.tables for episode in self.episodes], query).table
