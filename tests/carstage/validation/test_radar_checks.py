"""Detections of radars with cross sections: rows that are none are left to the schema's check."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pyarrow as pa
import pytest

from carstage.dataset.tables import row_sensor
from carstage.sensor_kinds.columns import RcsDetection
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.radars import RCS_RADAR, check_cross_sections

KIND = row_sensor(RCS_RADAR)
assert KIND is not None
NAMES = [name for name, _ in KIND.columns]
NO_TAG = float(max(TAGS_0_9_14) + 1)


def messages(*rows: dict[str, Any]) -> list[str]:
    table = pa.Table.from_pylist(
        [{"k": k, "timestamp_s": 0.1 * k, **row} for k, row in enumerate(rows)], schema=KIND.schema
    )
    radar: Any = SimpleNamespace(
        id="RADAR", kind=RCS_RADAR, table=table, calibration=SimpleNamespace(attributes={})
    )
    findings = Findings("0")
    episode: Any = SimpleNamespace(sensors=[radar])
    check_cross_sections(episode, findings)
    return [problem.message for problem in findings.problems()]


@pytest.mark.parametrize("count", [0, 2])
def test_lists_of_several_lengths_do_not_end_the_check(count: int) -> None:
    uneven = {name: [1.0] for name in NAMES} | {NAMES[0]: [1.0] * count}
    strange = {name: [1.0] for name in NAMES}
    strange |= {NAMES[RcsDetection.TAG]: [NO_TAG], NAMES[RcsDetection.RCS]: [-99.0]}
    assert messages(uneven, strange) == ["1 of 1 detections have no semantic tag"]
