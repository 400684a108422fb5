"""Pages of episodes, and all that a catalog knows of one."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from sqlalchemy import Select, select

from carstage.catalog.schema import (
    ARTIFACTS,
    ATTEMPTS,
    DATASETS,
    EPISODES,
    LABEL_SUMMARIES,
    SENSORS,
)
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from sqlalchemy.engine import Connection

    from carstage.catalog.database import Catalog

PAGE_SIZE = 50
_LARGEST_PAGE = 10_000
_SHOWN = (
    "episode_id",
    "attempt",
    "run_id",
    "frames",
    "duration_s",
    "files",
    "bytes",
    "map",
    "weather",
    "scenario",
    "split",
    "carstage",
    "client",
    "server",
    "self_test",
)


@dataclass(frozen=True, slots=True)
class PageFilter:
    """Which episodes; all that is given has to hold.

    Attributes:
        town: name of the map.
        weather: weather preset.
        split: ``train``, ``val`` or ``test``.
        sensor: kind of a sensor that the rig has, such as ``lidar``.
        label: class of which there is an object in the episode, such as ``walker_adult``.
    """

    town: str | None = None
    weather: str | None = None
    split: str | None = None
    sensor: str | None = None
    label: str | None = None

    @property
    def is_empty(self) -> bool:
        """Whether it lets every episode pass."""
        return all(getattr(self, one.name) is None for one in fields(self))


@dataclass(frozen=True, slots=True)
class Page:
    """Some episodes.

    Attributes:
        episodes: rows of the catalog; ``dataset`` is the dataset's location.
        after: what to give for the next page; None: this is the last one.
    """

    episodes: tuple[dict[str, Any], ...]
    after: int | None


def list_episodes(
    catalog: Catalog,
    location: str | None = None,
    wanted: PageFilter = PageFilter(),
    *,
    limit: int = PAGE_SIZE,
    after: int = 0,
) -> Page:
    """A page of episodes, in the order in which they came into the catalog.

    The cost does not depend on the number of pages before it.

    Args:
        catalog: is read.
        location: of the one dataset, as the catalog knows it; None: all datasets.
        wanted: which episodes.
        limit: at most so many.
        after: ``Page.after`` of the page before.

    Raises:
        BadInputError: the catalog does not know the dataset, or the limit is out of range.
        CatalogError: the catalog cannot be read.
    """
    if not 1 <= limit <= _LARGEST_PAGE:
        raise BadInputError(f"limit: {limit} is no size of a page.", f"Give 1 to {_LARGEST_PAGE}.")
    with catalog.reading() as connection:
        key = None if location is None else _dataset_key(connection, catalog, location)
        query = page_query(key, wanted).where(EPISODES.c.id > after).limit(limit + 1)
        rows = [dict(row) for row in connection.execute(query).mappings()]
    more = len(rows) > limit
    rows = rows[:limit]
    last = rows[-1]["id"] if more else None
    for row in rows:
        del row["id"]
    return Page(tuple(rows), last)


def wanted_episodes(
    catalog: Catalog, location: str, wanted: PageFilter
) -> list[tuple[str, str, str | None]]:
    """Id, attempt and version of Car-STAGE of all episodes that a filter lets pass.

    Args:
        catalog: is read.
        location: of the dataset.
        wanted: which episodes.

    Raises:
        BadInputError: the catalog does not know the dataset.
        CatalogError: the catalog cannot be read.
    """
    columns = (EPISODES.c.episode_id, EPISODES.c.attempt, EPISODES.c.carstage)
    with catalog.reading() as connection:
        key = _dataset_key(connection, catalog, location)
        query = page_query(key, wanted).with_only_columns(*columns)
        return [(row[0], row[1], row[2]) for row in connection.execute(query)]


def show_episode(catalog: Catalog, location: str, episode_id: str) -> dict[str, Any]:
    """What a catalog knows of an episode: its row, ``sensors``, ``artifacts``, ``labels``.

    Args:
        catalog: is read.
        location: of its dataset.
        episode_id: its id.

    Raises:
        BadInputError: the catalog does not know the dataset or the episode.
        CatalogError: the catalog cannot be read.
    """
    with catalog.reading() as connection:
        key = _dataset_key(connection, catalog, location)
        query = page_query(key, PageFilter()).where(EPISODES.c.episode_id == episode_id)
        found = connection.execute(query).mappings().one_or_none()
        if found is None:
            raise BadInputError(
                f"The catalog {catalog.address.shown} has no episode {episode_id}.",
                "Bring it up to date: carstage catalog rebuild DATASET --update.",
            )
        row = dict(found)
        number = row.pop("id")
        for name, table in (
            ("sensors", SENSORS),
            ("artifacts", ARTIFACTS),
            ("labels", LABEL_SUMMARIES),
        ):
            columns = [column for column in table.c if column.name != "episode"]
            of_episode = select(*columns).where(table.c.episode == number).order_by(columns[0])
            row[name] = [dict(one) for one in connection.execute(of_episode).mappings()]
        tried = select(ATTEMPTS.c.attempt, ATTEMPTS.c.state).where(
            ATTEMPTS.c.dataset == key, ATTEMPTS.c.episode_id == episode_id
        )
        row["attempts"] = {one.attempt: one.state for one in connection.execute(tried)}
    return row


def page_query(key: int | None, wanted: PageFilter) -> Select[Any]:
    """The rows of a page, by their number.

    Args:
        key: number of the dataset; None: all.
        wanted: which episodes.
    """
    shown = [EPISODES.c[name] for name in _SHOWN]
    query = select(EPISODES.c.id, DATASETS.c.location.label("dataset"), *shown).join(
        DATASETS, DATASETS.c.id == EPISODES.c.dataset
    )
    order = EPISODES.c.id
    if key is not None:
        query = query.where(EPISODES.c.dataset == key)
    columns = (("town", "map"), ("weather", "weather"), ("split", "split"))
    for name, column in columns:
        value = getattr(wanted, name)
        if value is not None:
            query = query.where(EPISODES.c[column] == value)
    if wanted.sensor is not None:
        of_kind = select(SENSORS.c.episode).where(SENSORS.c.kind == wanted.sensor)
        query = query.where(EPISODES.c.id.in_(of_kind))
    if wanted.label is not None:
        labels = LABEL_SUMMARIES
        query = query.join(labels, labels.c.episode == EPISODES.c.id)
        query = query.where(labels.c["class"] == wanted.label)
    return query.order_by(order)


def _dataset_key(connection: Connection, catalog: Catalog, location: str) -> int:
    query = select(DATASETS.c.id).where(DATASETS.c.location == location)
    key = connection.execute(query).scalar_one_or_none()
    if key is None:
        raise BadInputError(
            f"The catalog {catalog.address.shown} does not know this dataset ({location}).",
            "Add it: carstage catalog rebuild DATASET.",
        )
    return int(key)
