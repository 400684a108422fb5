"""How raw recordings are written, and what stays on disk."""

from __future__ import annotations

from typing import Literal

from carstage.config.fields import Section, setting
from carstage.spec.defaults import RAW_QUEUE_MB, RAW_STORE


class Output(Section):
    """How raw recordings are written, and what stays on disk."""

    keep_raw: bool = setting(
        False,
        title="Keep raw recordings",
        description="Keep the raw logs after they have been converted and verified.",
        group="output",
    )
    raw_store: Literal["chunklog", "mmap"] = setting(
        RAW_STORE,
        title="Raw store",
        description="Raw pictures in the log's records, or in memory-mapped files, one per camera "
        "and second (`mmap`, the paper's).",
        group="output",
    )
    raw_queue_mb: int = setting(
        RAW_QUEUE_MB,
        title="Raw queue",
        description="Sensor data in memory that may wait for the disk; when more would, the tick "
        "waits.",
        unit="MB",
        group="output",
        ge=1,
        le=1_000_000,
    )
