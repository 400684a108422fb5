"""The first schema: datasets, runs, episodes, attempts, sensors, artifacts, splits, labels."""

# ruff: noqa: D103 (one function makes one table)

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None

_ID = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    _datasets()
    _attempts()
    _episodes()
    _runs()
    _splits()
    _artifacts()
    _label_summaries()
    _sensors()


def _datasets() -> None:
    op.create_table(
        "datasets",
        sa.Column("id", _ID, nullable=False),
        sa.Column("location", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("created_by", sa.String(), nullable=False),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_datasets")),
        sa.UniqueConstraint("location", name=op.f("uq_datasets_location")),
    )


def _attempts() -> None:
    op.create_table(
        "attempts",
        sa.Column("dataset", _ID, nullable=False),
        sa.Column("episode_id", sa.String(), nullable=False),
        sa.Column("attempt", sa.String(), nullable=False),
        sa.Column("state", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["dataset"], ["datasets.id"], name=op.f("fk_attempts_dataset"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("dataset", "episode_id", "attempt", name=op.f("pk_attempts")),
    )


def _episodes() -> None:
    op.create_table(
        "episodes",
        sa.Column("id", _ID, nullable=False),
        sa.Column("dataset", _ID, nullable=False),
        sa.Column("episode_id", sa.String(), nullable=False),
        sa.Column("attempt", sa.String(), nullable=False),
        sa.Column("marker_hash", sa.String(), nullable=False),
        sa.Column("run_id", sa.String(), nullable=True),
        sa.Column("frames", sa.Integer(), nullable=False),
        sa.Column("duration_s", sa.Float(), nullable=False),
        sa.Column("files", sa.Integer(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("map", sa.String(), nullable=False),
        sa.Column("weather", sa.String(), nullable=True),
        sa.Column("scenario", sa.String(), nullable=False),
        sa.Column("split", sa.String(), nullable=True),
        sa.Column("carstage", sa.String(), nullable=True),
        sa.Column("client", sa.String(), nullable=True),
        sa.Column("server", sa.String(), nullable=True),
        sa.Column("self_test", sa.Boolean(), nullable=True),
        sa.ForeignKeyConstraint(
            ["dataset"], ["datasets.id"], name=op.f("fk_episodes_dataset"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_episodes")),
        sa.UniqueConstraint("dataset", "episode_id", name=op.f("uq_episodes_dataset_episode_id")),
    )
    op.create_index(op.f("ix_episodes_dataset_id"), "episodes", ["dataset", "id"], unique=False)
    op.create_index(op.f("ix_episodes_map_id"), "episodes", ["map", "id"], unique=False)
    op.create_index(op.f("ix_episodes_split_id"), "episodes", ["split", "id"], unique=False)
    op.create_index(op.f("ix_episodes_weather_id"), "episodes", ["weather", "id"], unique=False)


def _runs() -> None:
    op.create_table(
        "runs",
        sa.Column("id", _ID, nullable=False),
        sa.Column("dataset", _ID, nullable=False),
        sa.Column("run_id", sa.String(), nullable=False),
        sa.Column("name", sa.String(), nullable=True),
        sa.Column("state", sa.String(), nullable=True),
        sa.Column("shard", sa.String(), nullable=True),
        sa.Column("total", sa.Integer(), nullable=True),
        sa.Column("committed", sa.Integer(), nullable=True),
        sa.Column("failed", sa.Integer(), nullable=True),
        sa.Column("skipped", sa.Integer(), nullable=True),
        sa.ForeignKeyConstraint(
            ["dataset"], ["datasets.id"], name=op.f("fk_runs_dataset"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f("pk_runs")),
        sa.UniqueConstraint("dataset", "run_id", name=op.f("uq_runs_dataset_run_id")),
    )


def _splits() -> None:
    op.create_table(
        "splits",
        sa.Column("dataset", _ID, nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("share", sa.Float(), nullable=False),
        sa.Column("seed", sa.BigInteger(), nullable=False),
        sa.Column("episodes", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["dataset"], ["datasets.id"], name=op.f("fk_splits_dataset"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("dataset", "name", name=op.f("pk_splits")),
    )


def _artifacts() -> None:
    op.create_table(
        "artifacts",
        sa.Column("episode", _ID, nullable=False),
        sa.Column("path", sa.String(), nullable=False),
        sa.Column("files", sa.Integer(), nullable=False),
        sa.Column("bytes", sa.BigInteger(), nullable=False),
        sa.Column("hash", sa.String(), nullable=False),
        sa.ForeignKeyConstraint(
            ["episode"], ["episodes.id"], name=op.f("fk_artifacts_episode"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("episode", "path", name=op.f("pk_artifacts")),
    )


def _label_summaries() -> None:
    op.create_table(
        "label_summaries",
        sa.Column("episode", _ID, nullable=False),
        sa.Column("class", sa.String(), nullable=False),
        sa.Column("tracks", sa.Integer(), nullable=False),
        sa.Column("rows", sa.Integer(), nullable=False),
        sa.Column("frames_1", sa.Integer(), nullable=False),
        sa.Column("frames_3", sa.Integer(), nullable=False),
        sa.Column("frames_5", sa.Integer(), nullable=False),
        sa.Column("frames_10", sa.Integer(), nullable=False),
        sa.Column("most_in_frame", sa.Integer(), nullable=False),
        sa.Column("nearest_m", sa.Float(), nullable=True),
        sa.ForeignKeyConstraint(
            ["episode"],
            ["episodes.id"],
            name=op.f("fk_label_summaries_episode"),
            ondelete="CASCADE",
        ),
        sa.PrimaryKeyConstraint("episode", "class", name=op.f("pk_label_summaries")),
    )
    op.create_index(
        op.f("ix_label_summaries_class_episode"),
        "label_summaries",
        ["class", "episode"],
        unique=False,
    )


def _sensors() -> None:
    op.create_table(
        "sensors",
        sa.Column("episode", _ID, nullable=False),
        sa.Column("sensor_id", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("width", sa.Integer(), nullable=False),
        sa.Column("height", sa.Integer(), nullable=False),
        sa.Column("labelled", sa.Boolean(), nullable=False),
        sa.ForeignKeyConstraint(
            ["episode"], ["episodes.id"], name=op.f("fk_sensors_episode"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("episode", "sensor_id", name=op.f("pk_sensors")),
    )
    op.create_index(op.f("ix_sensors_kind_episode"), "sensors", ["kind", "episode"], unique=False)
