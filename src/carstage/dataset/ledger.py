"""The ledger ``frames.parquet``: times of the saved frames, and which sensors delivered."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import pyarrow as pa

from carstage.dataset.tables import require_columns


def recorded_frames(sensors: Collection[str], ledger: pa.Table) -> dict[str, list[int]]:
    """By sensor, the saved frames of which there is data.

    Raises:
        DatasetError: the ledger lacks a column.
    """
    states = [f"{sensor}.{what}" for sensor in sensors for what in ("state", "reason")]
    require_columns(ledger, ("tick", "k", "server_frame", "timestamp_s", *states), "frames.parquet")
    ks = ledger["k"].to_pylist()
    return {
        sensor: [
            k
            for k, state in zip(ks, ledger[f"{sensor}.state"].to_pylist(), strict=True)
            if k is not None and state == "ok"
        ]
        for sensor in sensors
    }


def saved_times_s(ledger: pa.Table) -> dict[int, float]:
    """The time of each saved frame."""
    ks: list[Any] = ledger["k"].to_pylist()
    times: list[Any] = ledger["timestamp_s"].to_pylist()
    return {k: time_s for k, time_s in zip(ks, times, strict=True) if k is not None}
