"""The table of the driver's commands against the ledger and what was applied."""

from __future__ import annotations

import pyarrow as pa

from carstage.annotation.schema import CONTROL_COLUMNS, CONTROLS
from carstage.dataset.reading import Episode
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.recomputing import entries
from carstage.validation.checks.table_schema import require_rows

_OF_THE_LEDGER = ("tick", "k", "server_frame")
_APPLIED = ("throttle", "steer", "brake", "hand_brake")
"""What a server applies as it is told; it chooses gears by itself."""
_SMALL = 1e-6


def check_controls(
    episode: Episode, ledger: pa.Table, tables: LabelTables, findings: Findings
) -> None:
    """Commands are one for each tick, and those of saved frames were applied (check ``controls``).

    Args:
        episode: the episode.
        ledger: its ticks.
        tables: its labels.
        findings: where differences go.
    """
    table = episode.controls()
    if table is None:
        return
    require_rows(table, CONTROL_COLUMNS, CONTROLS)
    for name in _OF_THE_LEDGER:
        if entries(table, name) != entries(ledger, name):
            findings.add("controls", f"{name} of controls.parquet is not the ledger's")
            return
    if set(entries(table, "episode_id")) - {episode.id}:
        findings.add("controls", "episode_id of controls.parquet is not the episode's")
    applied = {row["k"]: row for row in tables.ego.select(["k", *_APPLIED]).to_pylist()}
    for row in table.to_pylist():
        if row["k"] not in applied:
            continue
        told = applied[row["k"]]
        for name in _APPLIED:
            if told[name] is not None and abs(told[name] - row[name]) > _SMALL:
                message = f"{name} was commanded as {row[name]:g}, {told[name]:g} was applied"
                findings.add("controls", message, frame=row["k"])
