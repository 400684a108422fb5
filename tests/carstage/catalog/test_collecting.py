"""What is removed as left over, and what never is."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from carstage.catalog import collect, leftovers
from carstage.dataset import Dataset
from carstage.errors import DatasetError
from carstage.runs import held_attempts
from carstage.runs.identity import identify
from carstage.storage import LocalStore
from small_episodes import add_episode

DONE, OPEN = "00000000000000d1", "00000000000000d2"
HOUR_S = 3600.0


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A committed attempt, one that it has overtaken, and one of an episode without a marker."""
    folder = tmp_path / "out"
    add_episode(folder, DONE, attempt="a2")
    for episode_id, attempt in ((DONE, "a1"), (OPEN, "a1")):
        add_episode(folder, episode_id, attempt=attempt, commit=False)
        for path in (folder / "episodes" / episode_id / attempt, *_files(folder, episode_id)):
            os.utime(path, (1e9, 1e9))
    return folder


def _files(folder: Path, episode_id: str) -> list[Path]:
    return list((folder / "episodes" / episode_id / "a1").iterdir())


def found(folder: Path, older_than_s: float | None = None, **options: object) -> set[str]:
    store = LocalStore(folder)
    return {
        f"{one.episode_id}/{one.attempt} {one.reason}"
        for one in leftovers(store, older_than_s=older_than_s, **options)  # type: ignore[arg-type]
    }


def test_only_what_a_marker_has_overtaken_is_left_over(dataset: Path) -> None:
    assert found(dataset) == {f"{DONE}/a1 overtaken"}


def test_an_attempt_without_a_marker_is_left_over_only_when_it_is_old(dataset: Path) -> None:
    young = {"now_s": 1e9 + HOUR_S - 60}
    assert found(dataset, HOUR_S, **young) == {f"{DONE}/a1 overtaken"}
    assert found(dataset, HOUR_S) == {f"{DONE}/a1 overtaken", f"{OPEN}/a1 open"}


def test_a_file_that_was_just_written_makes_an_attempt_young(dataset: Path) -> None:
    (dataset / "episodes" / OPEN / "a1" / "new.txt").write_text("still at work")
    assert found(dataset, HOUR_S) == {f"{DONE}/a1 overtaken"}


def test_removing_leaves_the_episode_whole(dataset: Path) -> None:
    store = LocalStore(dataset)
    assert collect(store, list(leftovers(store, older_than_s=HOUR_S))) == {}
    assert list(store.attempts()) == [(DONE, "a2")]
    assert Dataset(dataset).episode(DONE).objects().num_rows > 0


def test_one_that_is_committed_meanwhile_stays(dataset: Path) -> None:
    store = LocalStore(dataset)
    listed = list(leftovers(store, older_than_s=HOUR_S))
    store.commit(OPEN, "a1", frames=4, versions={})
    kept = collect(store, listed)
    assert [(one.episode_id, one.attempt) for one in kept] == [(OPEN, "a1")]
    assert "stays" in next(iter(kept.values()))
    assert sorted(store.attempts()) == [(DONE, "a2"), (OPEN, "a1")]


def test_what_a_living_run_holds_is_never_left_over(dataset: Path) -> None:
    run = dataset / "runs" / "now"
    run.mkdir(parents=True)
    (run / "status.json").write_text(json.dumps({"state": "recording", **identify()}))
    (dataset / "leases").mkdir(exist_ok=True)
    (dataset / "leases" / f"{OPEN}.1").write_text(json.dumps({"run_id": "now"}))
    held = held_attempts(dataset, LocalStore(dataset))
    assert held == {(OPEN, "a1")}
    assert found(dataset, HOUR_S, held=held) == {f"{DONE}/a1 overtaken"}
    (run / "status.json").write_text(json.dumps({"state": "done", **identify()}))
    assert held_attempts(dataset, LocalStore(dataset)) == set()


def test_nothing_is_removed_where_a_marker_cannot_be_read(dataset: Path) -> None:
    (dataset / "commits" / f"{DONE}.json").write_text("{")
    with pytest.raises(DatasetError):
        found(dataset, HOUR_S)
