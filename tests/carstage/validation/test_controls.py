"""The check of the driver's commands: what ledger and applied controls contradict is found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest

import analytic_scene
from carstage.annotation.controls import control_rows
from carstage.annotation.schema import CONTROL_COLUMNS
from carstage.conversion.segment import rows_to_table
from carstage.dataset.reading import Episode
from carstage.rawlog.reader import WorldFrame
from carstage.spec import EpisodeSpec
from carstage.validation.checks.controls import check_controls
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

STEPS, FIRST = 6, 40
DRIVER = {"kind": "class", "name": "mine:Slalom", "parameters": {}}


@pytest.fixture
def spec() -> EpisodeSpec:
    document = analytic_scene.spec(steps=STEPS)
    document = {**document, "save_every": 2, "ego": {**document["ego"], "driver": DRIVER}}
    return EpisodeSpec.from_json(document)


@pytest.fixture
def rows(spec: EpisodeSpec) -> list[dict[str, Any]]:
    none, zero = np.zeros(0, np.uint32), np.zeros((0, 3))
    frames = [
        WorldFrame(
            tick, FIRST + tick, tick / 10, none, zero, zero, zero, zero, zero,
            {"driver": [tick / 10, -0.5, 0.0, 0, 1, 0, -1]},
        )
        for tick in range(STEPS)
    ]  # fmt: skip
    return control_rows(spec, frames, spec.episode_id)


def problems(spec: EpisodeSpec, rows: list[dict[str, Any]]) -> list[str]:
    table = rows_to_table(rows, CONTROL_COLUMNS, "controls.parquet")
    ticks = list(range(STEPS))
    ledger = pa.table(
        {
            "tick": pa.array(ticks, pa.int32()),
            "k": pa.array([None if tick % 2 else tick // 2 for tick in ticks], pa.int32()),
            "server_frame": pa.array([FIRST + tick for tick in ticks], pa.int64()),
        }
    )
    ego = pa.Table.from_pylist(
        [
            {"k": k, "throttle": k / 5, "steer": -0.5, "brake": 0.0, "hand_brake": False}
            for k in range(STEPS // 2)
        ]
    )
    findings = Findings("episode")
    check_controls(
        cast("Episode", SimpleNamespace(id=spec.episode_id, spec=spec, controls=lambda: table)),
        ledger,
        cast("LabelTables", SimpleNamespace(ego=ego)),
        findings,
    )
    return [problem.message for problem in findings.problems()]


def test_rows_say_which_frame_each_command_acted_in(rows: list[dict[str, Any]]) -> None:
    assert [row["k"] for row in rows] == [0, None, 1, None, 2, None]
    assert rows[3]["server_frame"] == FIRST + 3
    assert (rows[3]["throttle"], rows[3]["reverse"], rows[3]["gear"]) == (0.3, True, -1)
    assert rows[3]["hand_brake"] is False


def test_a_sound_table_passes(spec: EpisodeSpec, rows: list[dict[str, Any]]) -> None:
    assert problems(spec, rows) == []


def test_a_command_that_was_not_applied_is_found(
    spec: EpisodeSpec, rows: list[dict[str, Any]]
) -> None:
    rows[2]["throttle"] += 0.25
    assert problems(spec, rows) == ["throttle was commanded as 0.45, 0.2 was applied"]
    rows[2]["throttle"] -= 0.25
    rows[3]["throttle"] = 0.9  # nothing tells of a tick that was not saved
    assert problems(spec, rows) == []


@pytest.mark.parametrize("name", ["tick", "server_frame", "k"])
def test_another_frame_than_the_ledgers_is_found(
    spec: EpisodeSpec, rows: list[dict[str, Any]], name: str
) -> None:
    rows[2][name] += 1
    assert problems(spec, rows) == [f"{name} of controls.parquet is not the ledger's"]


def test_another_episode_is_found(spec: EpisodeSpec, rows: list[dict[str, Any]]) -> None:
    rows[2]["episode_id"] = "0"
    assert problems(spec, rows) == ["episode_id of controls.parquet is not the episode's"]


def test_a_missing_row_is_found(spec: EpisodeSpec, rows: list[dict[str, Any]]) -> None:
    assert problems(spec, rows[:-1]) == ["tick of controls.parquet is not the ledger's"]
