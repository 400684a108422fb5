"""Processes that share a dataset find what one finds."""

from __future__ import annotations

import json
import os
import shutil
import signal
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

import carstage.validation.sharing
from analytic_dataset import add_episode, attempt_of, make_dataset, recommit
from carstage.dataset.tables import read_table, write_table
from carstage.errors import WorkerLostError
from carstage.validation import validate_dataset
from carstage.validation.checks.findings import Findings
from carstage.validation.sharing import FRAMES
from damage import document, pictures
from recorded_dataset import linked_copy, replace_file
from waiting import await_that

LONG = 4 * FRAMES + 2


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("long")
    return make_dataset(folder / "out", folder / "work", steps=LONG)


def shown_late(dataset: Path) -> None:
    """Pictures of the frame before, on both sides of where two tasks meet."""
    folder = attempt_of(dataset) / "sensors" / "CAM_FRONT"
    contents = [path.read_bytes() for path in sorted(folder.glob("*.png"))]
    for k in range(FRAMES - 2, FRAMES + 3):
        replace_file(folder / f"{k:06d}.png", contents[k - 1])
    recommit(dataset)


def a_file_of_each_frame_changed(dataset: Path) -> None:
    """More problems of one kind than are listed."""
    for path in (attempt_of(dataset) / "sensors" / "DEPTH_FRONT").iterdir():
        content = bytearray(path.read_bytes())
        content[-1] ^= 1
        replace_file(path, bytes(content))


def no_pose_at_the_end(dataset: Path) -> None:
    path = attempt_of(dataset) / "sensor_poses.parquet"
    table = read_table(path)
    last = table["k"].to_numpy() == table["k"].to_numpy().max()
    path.unlink()
    write_table(table.filter(~last), path)
    recommit(dataset)


def no_table(dataset: Path) -> None:
    (attempt_of(dataset) / "objects.parquet").unlink()


def nothing(dataset: Path) -> None:
    pass


DAMAGES = {
    "none": nothing,
    "mirrored": pictures(
        "CAM_FRONT", lambda image: np.ascontiguousarray(image[:, ::-1]), tuple(range(LONG))
    ),
    "late": shown_late,
    "hashes": a_file_of_each_frame_changed,
    "poses": no_pose_at_the_end,
    "unreadable": no_table,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_the_verdict_is_the_same_for_any_number_of_processes(
    long: Path, tmp_path: Path, damage: str
) -> None:
    dataset = linked_copy(long, tmp_path / "copy")
    DAMAGES[damage](dataset)

    alone = validate_dataset(dataset, workers=0).to_json()

    assert json.loads(alone)["ok"] is (damage == "none")
    assert validate_dataset(dataset, workers=3).to_json() == alone


@pytest.mark.end_to_end
@pytest.mark.xdist_group("recorded")
@pytest.mark.parametrize("damaged", [False, True])
def test_the_same_for_what_was_recorded(recorded: Path, tmp_path: Path, damaged: bool) -> None:
    dataset = linked_copy(recorded, tmp_path / "copy")
    if damaged:
        shown_late(dataset)
        shutil.rmtree(attempt_of(dataset) / "sensors" / "FLOW_FRONT")

    alone = validate_dataset(dataset, workers=0)

    assert alone.ok is not damaged
    assert validate_dataset(dataset, workers=2) == alone


def test_what_cannot_be_read_in_the_midst_is_said_alike(long: Path, tmp_path: Path) -> None:
    def on_an_arm(content: Any) -> None:
        content["sensors"]["CAM_FRONT"]["attachment"] = "spring_arm"

    dataset = linked_copy(long, tmp_path / "copy")
    document("calibration.json", on_an_arm)(dataset)
    no_pose_at_the_end(dataset)
    a_file_of_each_frame_changed(dataset)

    alone = validate_dataset(dataset, workers=0)

    assert alone.counts["unreadable"] == {"error": 1, "warning": 0}
    found = {problem.frame for problem in alone.problems if problem.check == "file_hash"}
    assert found == set(range(LONG))  # what was found before that is said, too
    assert validate_dataset(dataset, workers=2) == alone


def test_few_frames_are_looked_at_without_other_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = make_dataset(tmp_path / "out", tmp_path / "work", steps=FRAMES)
    monkeypatch.setattr(carstage.validation.sharing, "process_pool", None)
    assert validate_dataset(few).ok


@pytest.mark.parametrize("kind", ["episodes", "frames"])
def test_of_many_tasks_all_cores_take_some(
    long: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    dataset = long
    if kind == "episodes":
        dataset = make_dataset(tmp_path / "out", tmp_path / "0", steps=2)
        for number in range(1, 4):
            add_episode(dataset, tmp_path, f"{number:016d}", steps=2)
    asked: list[Any] = []
    pool = carstage.validation.sharing.process_pool

    def noted(workers: int, **options: Any) -> Any:
        asked.append(workers)
        return pool(workers, **options)

    monkeypatch.setattr(carstage.validation.sharing, "process_pool", noted)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(3))
    monkeypatch.setattr(carstage.validation.sharing, "_FEWEST_TASKS", 6)

    shared = validate_dataset(dataset)
    assert asked == [3]
    assert shared.ok
    assert shared == validate_dataset(dataset, workers=0)
    assert shared == validate_dataset(dataset, workers=1)  # with larger jobs


def own_processes() -> list[psutil.Process]:
    return psutil.Process().children(recursive=True)


def test_a_process_that_dies_ends_it_with_a_way_out(long: Path) -> None:
    before = set(own_processes())

    def kill_one(*_: int) -> None:
        started = [p for p in own_processes() if p not in before]
        for process in started[-1:]:
            process.send_signal(signal.SIGKILL)

    with pytest.raises(WorkerLostError, match="--workers 1"):
        validate_dataset(long, workers=2, progress=kill_one)
    await_that(lambda: set(own_processes()) <= before)


def test_an_interrupt_ends_the_processes(long: Path) -> None:
    before = set(own_processes())

    def interrupt(*_: int) -> None:
        assert set(own_processes()) > before
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        validate_dataset(long, workers=2, progress=interrupt)
    await_that(lambda: set(own_processes()) <= before)


def test_what_several_find_is_listed_as_if_one_had_found_it() -> None:
    alone, first, then = Findings("e"), Findings("e"), Findings("e")
    for k in range(40):
        sensor = "A" if k % 3 else "B"
        for findings in (alone, first if k < 23 else then):
            findings.add("decode", f"at {k}", frame=k, sensor=sensor)
            findings.add("decode", "of no sensor", severity="warning")
    together = Findings("e")
    together.include(first.taken())
    together.include(then)

    assert together.problems() == alone.problems()
    assert first.problems() == []
    counts: list[Any] = [{"decode": {"error": 0, "warning": 0}} for _ in range(2)]
    for findings, count in zip((alone, together), counts, strict=True):
        findings.count(count)
    assert counts[0] == counts[1] == {"decode": {"error": 40, "warning": 40}}
