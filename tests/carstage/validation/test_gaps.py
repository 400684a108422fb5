"""Frames that an object has no row in are counted, however many they are."""

from __future__ import annotations

import tracemalloc

import pyarrow as pa

from carstage.validation.checks.completeness import check_gaps
from carstage.validation.checks.findings import Findings, Problem


def gaps(ks: list[int]) -> list[Problem]:
    rows = [
        {"k": k, "track_id": 7, "class": "car", "is_ego": False, "is_static": False} for k in ks
    ]
    findings = Findings("0")
    check_gaps(pa.Table.from_pylist(rows), 3, ego_labelled=False, findings=findings)
    return findings.problems()


def test_a_track_without_gap_is_whole() -> None:
    assert gaps([2, 0, 1]) == []
    assert gaps([5]) == []


def test_the_first_gap_is_named_and_all_frames_counted() -> None:
    (problem,) = gaps([9, 0, 1, 5])
    assert problem.frame == 2
    assert "has no row in 6 frames" in problem.message


def test_a_frame_far_away_takes_no_memory() -> None:
    tracemalloc.start()
    try:
        (problem,) = gaps([0, 2_000_000])
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert "has no row in 1999999 frames" in problem.message
    assert peak < 10_000_000
