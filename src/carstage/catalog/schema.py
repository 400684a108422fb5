"""The tables of a catalog, the same for SQLite and PostgreSQL.

A change here needs a module in ``migrations/versions``; a test compares the two.
"""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    String,
    Table,
    UniqueConstraint,
)

METADATA = MetaData(
    naming_convention={
        "ix": "ix_%(table_name)s_%(column_0_N_name)s",
        "uq": "uq_%(table_name)s_%(column_0_N_name)s",
        "fk": "fk_%(table_name)s_%(column_0_N_name)s",
        "pk": "pk_%(table_name)s",
    }
)

# SQLite counts on its own only in a column that is called INTEGER.
_ID = BigInteger().with_variant(Integer, "sqlite")


def _of(table: str, **options: Any) -> Column[Any]:
    """A reference to a row, which goes with that row."""
    return Column(
        table.rstrip("s"),
        _ID,
        ForeignKey(f"{table}.id", ondelete="CASCADE"),
        nullable=False,
        **options,
    )


DATASETS = Table(
    "datasets",
    METADATA,
    Column("id", _ID, primary_key=True),
    Column("location", String, nullable=False, unique=True),
    Column("name", String, nullable=False),
    Column("created_by", String, nullable=False),
)

RUNS = Table(
    "runs",
    METADATA,
    Column("id", _ID, primary_key=True),
    _of("datasets"),
    Column("run_id", String, nullable=False),
    Column("name", String),
    Column("state", String),
    Column("shard", String),
    Column("total", Integer),
    Column("committed", Integer),
    Column("failed", Integer),
    Column("skipped", Integer),
    UniqueConstraint("dataset", "run_id"),
)

EPISODES = Table(
    "episodes",
    METADATA,
    Column("id", _ID, primary_key=True),
    _of("datasets"),
    Column("episode_id", String, nullable=False),
    Column("attempt", String, nullable=False),
    Column("marker_hash", String, nullable=False),
    Column("run_id", String),
    Column("frames", Integer, nullable=False),
    Column("duration_s", Float, nullable=False),
    Column("files", Integer, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("map", String, nullable=False),
    Column("weather", String),
    Column("variant", String),
    Column("base_id", String),
    Column("scenario", String, nullable=False),
    Column("split", String),
    Column("carstage", String),
    Column("client", String),
    Column("server", String),
    Column("self_test", Boolean),
    UniqueConstraint("dataset", "episode_id"),
    Index(None, "dataset", "id"),
    Index(None, "map", "id"),
    Index(None, "weather", "id"),
    Index(None, "variant", "id"),
    Index(None, "split", "id"),
)

ATTEMPTS = Table(
    "attempts",
    METADATA,
    _of("datasets", primary_key=True),
    Column("episode_id", String, primary_key=True),
    Column("attempt", String, primary_key=True),
    Column("state", String, nullable=False),
)

SENSORS = Table(
    "sensors",
    METADATA,
    _of("episodes", primary_key=True),
    Column("sensor_id", String, primary_key=True),
    Column("kind", String, nullable=False),
    Column("width", Integer, nullable=False),
    Column("height", Integer, nullable=False),
    Column("labelled", Boolean, nullable=False),
    Index(None, "kind", "episode"),
)

ARTIFACTS = Table(
    "artifacts",
    METADATA,
    _of("episodes", primary_key=True),
    Column("path", String, primary_key=True),
    Column("files", Integer, nullable=False),
    Column("bytes", BigInteger, nullable=False),
    Column("hash", String, nullable=False),
)

SPLITS = Table(
    "splits",
    METADATA,
    _of("datasets", primary_key=True),
    Column("name", String, primary_key=True),
    Column("share", Float, nullable=False),
    Column("seed", BigInteger, nullable=False),
    Column("episodes", Integer, nullable=False),
)

LABEL_SUMMARIES = Table(
    "label_summaries",
    METADATA,
    _of("episodes", primary_key=True),
    Column("class", String, primary_key=True),
    Column("tracks", Integer, nullable=False),
    Column("rows", Integer, nullable=False),
    Column("frames_1", Integer, nullable=False),
    Column("frames_3", Integer, nullable=False),
    Column("frames_5", Integer, nullable=False),
    Column("frames_10", Integer, nullable=False),
    Column("most_in_frame", Integer, nullable=False),
    Column("nearest_m", Float),
    Index(None, "class", "episode"),
)
