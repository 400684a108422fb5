"""The ledger ``frames.parquet``: times of the saved frames, and which sensors delivered."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import pyarrow as pa

from carstage.dataset.tables import require_columns

_LABELS = ".labels"


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


def unlabelled_frames(ledger: pa.Table) -> dict[str, list[int]]:
    """By labelled camera, the saved frames whose picture is there and has no labels.

    Recordings of before there were such columns have no camera here.
    """
    ks: list[Any] = ledger["k"].to_pylist()
    names = {name.removesuffix(_LABELS) for name in ledger.column_names if name.endswith(_LABELS)}
    cameras = sorted(name for name in names if f"{name}.state" in ledger.column_names)
    found = {}
    for camera in cameras:
        pictures, labels = (ledger[f"{camera}.{what}"].to_pylist() for what in ("state", "labels"))
        found[camera] = [
            k
            for k, picture, label in zip(ks, pictures, labels, strict=True)
            if k is not None and picture == "ok" and label != "ok"
        ]
    return found


def saved_times_s(ledger: pa.Table) -> dict[int, float]:
    """The time of each saved frame."""
    ks: list[Any] = ledger["k"].to_pylist()
    times: list[Any] = ledger["timestamp_s"].to_pylist()
    return {k: time_s for k, time_s in zip(ks, times, strict=True) if k is not None}
