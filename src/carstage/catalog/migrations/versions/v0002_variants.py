"""Which variant of which episode each one is."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the columns; episodes of catalogs before them have no variants."""
    op.add_column("episodes", sa.Column("variant", sa.String(), nullable=True))
    op.add_column("episodes", sa.Column("base_id", sa.String(), nullable=True))
    op.create_index(op.f("ix_episodes_variant_id"), "episodes", ["variant", "id"], unique=False)
