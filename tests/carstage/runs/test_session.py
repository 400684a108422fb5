"""What a run makes of recordings with gaps, of a full disk, and of errors while it ends."""

from __future__ import annotations

import errno
import json
from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from carstage.config import check_config
from carstage.errors import (
    CollectorError,
    ConverterDiedError,
    DatasetError,
    DiskFullError,
    ServerError,
    StorageError,
)
from carstage.execution import InlineExecutor
from carstage.plan import EpisodePlan, ServerFacts, plan_episodes
from carstage.runs.attempt_commit import Job
from carstage.runs.events import Notice, RunEvent
from carstage.runs.folder import RunFolder
from carstage.runs.interruption import Interruption
from carstage.runs.record import RunRecord
from carstage.runs.servers import ServerSetup
from carstage.runs.session import Session
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.spec import EpisodeSpec
from carstage.storage import Store, open_store

RETRIES = 2


class Reader:
    """Remembers the notices of a run."""

    def __init__(self) -> None:
        self.notices: list[str] = []

    def __call__(self, event: RunEvent) -> None:
        if isinstance(event, Notice):
            self.notices.append(event.sentence)


class GivenUp:
    """Stands for a recorded attempt."""

    frames_done = 0

    def __init__(self, spec: EpisodeSpec, tries: int) -> None:
        self.job = Job(spec, spec.episode_id, tries)
        self.attempt = f"a{tries + 1}"
        self.given_up = False

    def give_up(self) -> None:
        self.given_up = True


class Execute:
    """An executor that fails instead of recording."""

    def __init__(self, error: BaseException) -> None:
        self._error = error

    in_process = True

    def execute(self, work: Any) -> None:
        del work
        raise self._error


@pytest.fixture(scope="module")
def plan() -> EpisodePlan:
    facts = ServerFacts(maps={"Stage01": 50}, blueprints={}, dialect="0.9.16")
    return plan_episodes(check_config({"pedestrians": {"count": 0}}), facts)


@pytest.fixture(scope="module")
def spec(plan: EpisodePlan) -> EpisodeSpec:
    return plan[0]


Made = tuple[Session, Reader, RunFolder]


@pytest.fixture
def made(tmp_path: Path) -> Iterator[Made]:
    store = open_store(tmp_path)
    store.initialise("test")
    reader = Reader()
    with RunFolder(tmp_path) as folder, Interruption() as interruption, WakeupPipe() as wakeup:
        session = make_session({}, store, folder, interruption, wakeup, reader)
        yield session, reader, folder
        session._queue.converters.end()


def make_session(
    written: Mapping[str, Any],
    store: Store,
    folder: RunFolder,
    interruption: Interruption,
    wakeup: WakeupPipe,
    reader: Reader,
) -> Session:
    config = check_config(written)
    setup = ServerSetup(config)
    record = RunRecord(folder, interruption, reader)
    return Session(
        config, setup, store, record, interruption, wakeup, RETRIES, {}, InlineExecutor()
    )


def run_with(executor: Execute, session: Session, episodes: EpisodePlan) -> None:
    """Run a session, of whose episodes all are there, with another executor."""
    session._executor = executor  # type: ignore[assignment]
    session.run(episodes, episodes[:0])


def events(folder: RunFolder) -> list[str]:
    lines = (folder.path / "events.jsonl").read_text().splitlines()
    return [json.loads(line)["event"] for line in lines]


@pytest.mark.parametrize(("tries", "kept"), [(0, False), (1, False), (2, True)])
def test_recording_with_gaps_is_repeated_and_the_last_one_kept(
    made: Made, spec: EpisodeSpec, tries: int, kept: bool
) -> None:
    session, reader, folder = made
    attempt_commit = GivenUp(spec, tries)
    assert session.recorded(attempt_commit, 3) is kept  # type: ignore[arg-type]
    assert attempt_commit.given_up is not kept
    assert events(folder) == ([] if kept else ["episode_retried"])
    assert "3 of 50 ticks lack data of a sensor" in reader.notices[0]


@pytest.mark.parametrize(
    "timing", [{"on_incomplete": "skip"}, {"sensor_sync": False}, {"mode": "async"}]
)
def test_gaps_are_kept_where_they_were_asked_for(
    made: Made, spec: EpisodeSpec, timing: Mapping[str, Any]
) -> None:
    session, reader, _ = made
    attempt_commit = GivenUp(replace(spec, timing=replace(spec.timing, **timing)), 0)
    assert session.recorded(attempt_commit, 3)  # type: ignore[arg-type]
    assert not attempt_commit.given_up
    assert reader.notices == []


def test_full_disk_is_not_tried_again_and_ends_the_run(made: Made, spec: EpisodeSpec) -> None:
    session, _, folder = made
    error = DiskFullError("Writing failed: No space left on device.", "Make room.")
    with pytest.raises(DiskFullError):
        session.attempt_failed(GivenUp(spec, 0), error, final=False)  # type: ignore[arg-type]
    assert events(folder) == ["episode_failed"]


def test_other_failures_are_tried_again_as_often_as_allowed(made: Made, spec: EpisodeSpec) -> None:
    session, _, folder = made
    for tries in range(RETRIES + 1):
        session.attempt_failed(
            GivenUp(spec, tries),  # type: ignore[arg-type]
            CollectorError("It broke."),
            final=False,
        )
    assert events(folder) == ["episode_retried"] * RETRIES + ["episode_failed"]


def test_attempt_without_a_place_for_its_recording_leaves_no_folder(
    made: Made, spec: EpisodeSpec
) -> None:
    session, _, folder = made
    folder.raw.rmdir()
    folder.raw.write_text("in the way")
    with pytest.raises(NotADirectoryError):
        session.begin(Job(spec, spec.episode_id))
    assert list(folder.work.glob("episodes/*")) == []


def test_start_that_was_killed_takes_one_of_the_tries(made: Made, spec: EpisodeSpec) -> None:
    session, reader, _ = made
    killed = ServerError("The server was killed. Its last words:\nnone")
    job = Job(spec, spec.episode_id)
    for tries in range(RETRIES):
        assert session.start_failed(job, killed)
        taken = session.take()
        assert taken is not None
        assert (taken.tries, taken.first_attempt) == (tries + 1, 1)
        job = taken
    assert not session.start_failed(job, killed)
    said = "The server was killed. It is started again."
    assert reader.notices == [said] * RETRIES


def test_deferred_recording_that_cannot_be_converted_is_recorded_again(
    made: Made, spec: EpisodeSpec
) -> None:
    session, _, folder = made

    class Dead(GivenUp):
        def convert_all(self, pool: Executor) -> None:
            raise ConverterDiedError("A conversion process died.")

    first, second = Dead(spec, 0), Dead(spec, 1)
    for attempt_commit in (first, second):
        session._queue._later.append(attempt_commit)  # type: ignore[arg-type]
    job = session.take()
    assert job is not None
    assert (job.tries, first.given_up) == (1, True)
    assert not second.given_up
    assert events(folder) == ["episode_retried"]


@pytest.mark.parametrize("error", [OSError(errno.EIO, "I/O error"), DatasetError("A bad marker.")])
def test_attempt_that_cannot_be_removed_keeps_no_other_from_it(
    made: Made, plan: EpisodePlan, error: Exception
) -> None:
    session, reader, folder = made
    spec = plan[0]

    class Stubborn(GivenUp):
        def give_up(self) -> None:
            raise error

    last = GivenUp(spec, 1)
    session._queue.under_way.extend([Stubborn(spec, 0), last])  # type: ignore[list-item]
    with pytest.raises(CollectorError):
        run_with(Execute(CollectorError("It broke.")), session, plan[:0])
    assert last.given_up
    assert "could not be removed" in reader.notices[0]
    assert json.loads((folder.path / "status.json").read_bytes())["state"] == "failed"


def test_system_error_of_the_disk_is_explained_in_words(made: Made, plan: EpisodePlan) -> None:
    session, _, folder = made
    full = OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(DiskFullError, match="No space left"):
        run_with(Execute(full), session, plan[:0])
    status = json.loads((folder.path / "status.json").read_bytes())
    assert status["state"] == "failed"
    assert "No space left" in status["message"]


@pytest.mark.parametrize("begun", [False, True])
def test_a_server_lost_on_the_way_says_how_to_go_on(
    made: Made, plan: EpisodePlan, begun: bool
) -> None:
    session, reader, _ = made
    spec = plan[0]

    class Lose(Execute):
        def execute(self, work: Any) -> None:
            if begun:
                session.begin(Job(spec, spec.episode_id))
            super().execute(work)

    with pytest.raises(ServerError, match="No CARLA server"):
        run_with(Lose(ServerError("No CARLA server answers.")), session, plan)
    said = ["1 of 1 episodes are in the dataset. The same command again continues with the rest."]
    assert reader.notices == (said if begun else [])


def test_disk_that_refuses_the_last_words_does_not_hide_why_the_run_ended(
    made: Made, plan: EpisodePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    session, reader, folder = made

    def refuse(*_: object, **__: object) -> None:
        raise StorageError("Writing status.json failed: No space left on device.")

    class Fail(Execute):
        def execute(self, work: Any) -> None:
            monkeypatch.setattr(folder, "write_status", refuse)
            super().execute(work)

    with pytest.raises(CollectorError, match="It broke"):
        run_with(Fail(CollectorError("It broke.")), session, plan[:0])
    assert "The next run on this dataset clears up." in reader.notices[-1]


@pytest.mark.parametrize(
    ("written", "removed"),
    [
        ({}, 2),
        ({"output": {"keep_raw": True}}, 0),
        ({"conversion": {"mode": "deferred"}}, 0),
    ],
)
def test_raw_data_go_while_an_episode_is_recorded_unless_they_must_last(
    tmp_path: Path, spec: EpisodeSpec, written: Mapping[str, Any], removed: int
) -> None:
    class AttemptCommit(GivenUp):
        removed = 0

        def remove_converted(self) -> None:
            self.removed += 1

        def is_ready(self) -> bool:
            return False

    store = open_store(tmp_path)
    store.initialise("test")
    with RunFolder(tmp_path) as folder, Interruption() as interruption, WakeupPipe() as wakeup:
        session = make_session(written, store, folder, interruption, wakeup, Reader())
        commits = AttemptCommit(spec, 0), AttemptCommit(spec, 1)
        session._recording = commits[0]  # type: ignore[assignment]
        session._queue.under_way.append(commits[1])  # type: ignore[arg-type]
        session.poll()
    assert sum(attempt_commit.removed for attempt_commit in commits) == removed
