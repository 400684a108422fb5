"""What the measurements make of their readings, on readings that are made up."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import analytic_scene
from benchmarks.framework import memory, overhead
from benchmarks.framework.conversion import compare
from benchmarks.framework.frames_check import Comparison, Recorded, lateness_in
from benchmarks.framework.journal import ENTRY, Sent, digest_of, read_journal
from carstage.bench.verdict import Verdict

MB = 1_000_000


def value(verdict: Verdict, name: str) -> Any:
    return verdict.record()["figures"][name]["value"]


def test_overhead_is_what_capture_adds_scaled_by_the_machine() -> None:
    captured = [overhead.Block(100, 0.20, 2.80, 9.0, 100_000)] * 3
    discarded = [overhead.Block(100, 0.10, 1.20, 8.0)] * 3
    verdict = overhead.judge(captured, discarded, slow=2.0)
    assert verdict.ok
    assert value(verdict, "tick_thread_cpu_ms_added") == pytest.approx(1.0)
    assert value(verdict, "scaled_tick_thread_cpu_ms_added") == pytest.approx(0.5)
    assert value(verdict, "logging_cpu_ms_per_camera_frame") == pytest.approx(3.0)
    assert value(verdict, "scaled_logging_cpu_ms_per_camera_frame") == pytest.approx(1.5)
    assert not overhead.judge(captured, discarded, slow=1.4).ok


def test_overhead_with_a_thin_cloud_proves_nothing() -> None:
    block = overhead.Block(100, 0.1, 1.0, 8.0, lidar_points=50_000)
    assert not overhead.judge([block], [block], slow=1.0).ok


def sample(tick: int, queued: int, resident: int) -> memory.Sample:
    return memory.Sample(tick, queued, tick / 100, resident)


@pytest.mark.parametrize(
    ("queued", "grown", "late", "ok"),
    [
        (100, 100, 100, True),
        (106, 100, 100, False),  # the collector lets in more than it may
        (50, 50, 50, False),  # the queue was never full: nothing is shown
        (100, 120, 100, False),  # more memory than the queue explains
        (100, 100, 103, True),
        (100, 100, 175, False),  # it grows on and on
    ],
)
def test_memory_is_bounded_by_the_budget(queued: int, grown: int, late: int, ok: bool) -> None:
    base = 30
    samples = [sample(0, 0, base * MB)]
    samples += [sample(tick, queued * MB, (base + grown) * MB) for tick in range(1, 90)]
    samples += [sample(tick, queued * MB, (base + late) * MB) for tick in range(90, 100)]
    assert memory.judge(samples, frames=100, budget_bytes=100 * MB).ok is ok


def test_memory_of_an_unfinished_recording_is_no_proof() -> None:
    samples = [sample(tick, 100 * MB, 130 * MB if tick else 30 * MB) for tick in range(50)]
    assert not memory.judge(samples, frames=100, budget_bytes=100 * MB).ok


def row(tick: int, **states: str) -> dict[str, Any]:
    sensors = {name: {"state": state} for name, state in ({"CAM": "ok"} | states).items()}
    return {"tick": tick, "frame": 100 + tick, "sensors": sensors}


RIGHT = Recorded(100, 5.0, b"a")
SENT = Sent(5.0, b"a")


@pytest.mark.parametrize(
    ("record", "sent", "fault"),
    [
        (RIGHT, SENT, None),
        (None, SENT, "no record"),
        (RIGHT, None, "no message"),
        (Recorded(101, 5.0, b"a"), SENT, "frame"),
        (Recorded(100, 5.1, b"a"), SENT, "time"),
        (Recorded(100, 5.0, b"b"), SENT, "data"),
    ],
)
def test_a_record_that_is_not_what_was_sent_is_found(
    record: Recorded | None, sent: Sent | None, fault: str | None
) -> None:
    found = Comparison()
    found.add_row(row(0))
    found.add_record("CAM", row(0), record, sent)
    assert dict(found.wrong) == ({("CAM", fault): 1} if fault else {})


def test_a_ledger_that_skips_a_tick_or_is_not_ok_is_found() -> None:
    found = Comparison()
    found.add_row(row(0))
    found.add_row(row(2, CAM="late"))
    assert dict(found.wrong) == {("ledger", "tick"): 1, ("CAM", "late"): 1}


def test_only_data_that_change_can_tell_frames_apart() -> None:
    found = Comparison()
    for tick in range(3):
        found.add_record("CAM", row(0), RIGHT if tick < 2 else Recorded(100, 5.0, b"c"), SENT)
    assert found.changed == 2


def test_the_late_frame_is_looked_up_and_others_that_are_blamed_are_counted() -> None:
    ledger = [row(0, DEPTH="ok"), row(1, DEPTH="late"), row(2, DEPTH="late")]
    found = lateness_in(ledger, 101)
    assert (found.state, found.others) == ("late", 0)
    assert lateness_in(ledger, 100).state == "ok"
    assert lateness_in(ledger, 102).others == 1  # DEPTH is blamed before its frame was late
    assert lateness_in([row(0, DEPTH="late", CAM="missing")], 100).others == 1
    assert lateness_in(ledger, 7).state == "no such frame"


def test_a_journal_is_read_up_to_its_last_whole_entry(tmp_path: Path) -> None:
    digest = digest_of(memoryview(b"data"))
    path = tmp_path / "journal"
    path.write_bytes(ENTRY.pack(7, 100, 5.0, digest) + ENTRY.pack(7, 101, 5.1, digest)[:-1])
    assert read_journal(path) == {(7, 100): Sent(5.0, digest)}


def test_conversion_is_compared_with_its_encoder_on_the_same_records(tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    steps: list[int] = []
    verdict = compare(
        tmp_path / "raw", "CAM_FRONT", tmp_path / "files", 2, lambda done, _: steps.append(done)
    )
    assert steps == [1, 2]
    assert value(verdict, "frames") == 3
    assert value(verdict, "conversion_cpu_ms") > 0
    assert not (tmp_path / "files").exists()
