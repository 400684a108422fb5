"""Boxes of a level that cameras see to be empty are told of; others are not."""

from __future__ import annotations

from typing import Any

import pyarrow as pa
import pytest

from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.level import check_level_boxes

CAR, POLE, DRIVING = 2**52 + 1, 2**52 + 2, 50


def found(*seen: tuple[int, int | None, int | None, int | None]) -> list[Any]:
    """Findings of rows of track, visible, front and silhouette pixels."""
    objects = pa.table(
        {
            "track_id": [CAR, POLE, DRIVING],
            "class": ["car", "pole", "car"],
            "is_static": [True, True, False],
        }
    )
    names = ("track_id", "visible_px", "front_px", "hull_px")
    schema = pa.schema([("track_id", pa.int64()), *((name, pa.uint32()) for name in names[1:])])
    rows = [dict(zip(names, row, strict=True)) for row in seen]
    findings = Findings("episode")
    tables = LabelTables(objects, pa.Table.from_pylist(rows, schema=schema), objects)
    check_level_boxes(tables, findings)
    return list(findings.problems())


def test_a_box_without_its_car_is_told_of() -> None:
    (problem,) = found((CAR, 10, 100, 500), (CAR, 5, 0, 300))
    assert (problem.check, problem.severity) == ("level_boxes", "warning")
    assert "15 of the 700 pixels" in problem.message


@pytest.mark.parametrize(
    "row",
    [
        (CAR, 400, 100, 800),  # it is there
        (CAR, 0, 700, 800),  # something stands before it
        (CAR, 0, 0, 300),  # too far away to tell
        (CAR, None, None, None),  # pixels were not counted
        (POLE, 10, 0, 800),  # most of a lamp's box is empty
        (DRIVING, 0, 0, 800),  # not of the level
    ],
)
def test_what_may_be_right_is_not(row: tuple[int, int | None, int | None, int | None]) -> None:
    assert found(row) == []
