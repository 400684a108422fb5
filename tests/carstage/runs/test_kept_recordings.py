"""What is recorded to its end outlasts whatever ends a run."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

import analytic_scene
from carstage.config import Config, check_config
from carstage.errors import BadInputError, ServerError, StorageError
from carstage.plan import EpisodePlan, ServerFacts, plan_episodes
from carstage.rawlog.reader import EpisodeLog
from carstage.runs.attempt_commit import Job
from carstage.runs.commit_queue import CommitQueue
from carstage.runs.events import Notice, RunEvent
from carstage.runs.folder import RunFolder
from carstage.runs.following import _FollowingSession
from carstage.runs.interruption import Interruption
from carstage.runs.keeping import FOLLOWING_PLAN, share_of
from carstage.runs.pending import Pending, pending_recordings, write_pending
from carstage.runs.pilot import shortened
from carstage.runs.record import RunRecord
from carstage.runs.server_worker import WorkerHost
from carstage.runs.servers import ServerSetup
from carstage.runs.session import Session
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.spec import EpisodeSpec
from carstage.spec.scenario import RecordedSpec
from carstage.storage import Store, open_store

FACTS = ServerFacts(maps={"Stage01": 50}, blueprints={}, dialect="0.9.16")
DEFERRED = {
    "pedestrians": {"count": 0},
    "vehicles": {"count": 0},
    "conversion": {"mode": "deferred"},
}


@dataclass
class Run:
    """What a session of a run is given."""

    store: Store
    folder: RunFolder
    record: RunRecord
    interruption: Interruption
    wakeup: WakeupPipe
    said: list[str]


@pytest.fixture
def begin(tmp_path: Path) -> Iterator[Callable[[str], Run]]:
    """Begins a run into a new dataset; all end with the test."""
    store = open_store(tmp_path)
    store.initialise("kept")
    with ExitStack() as stack:

        def run(name: str) -> Run:
            said: list[str] = []

            def hear(event: RunEvent) -> None:
                if isinstance(event, Notice):
                    said.append(event.sentence)

            folder = stack.enter_context(RunFolder(tmp_path, name))
            interruption = stack.enter_context(Interruption())
            wakeup = stack.enter_context(WakeupPipe())
            record = RunRecord(folder, interruption, hear)
            return Run(store, folder, record, interruption, wakeup, said)

        yield run


class _Recorded:
    """Records two episodes; then the server does not start any more."""

    in_process, count = True, 1

    def __init__(self, plan: EpisodePlan) -> None:
        self._plan = plan

    def execute(self, host: WorkerHost) -> None:
        for spec in self._plan[:2]:
            attempt = host.begin(Job(spec, spec.episode_id))
            attempt.raw_folder.mkdir(parents=True)
            (attempt.raw_folder / "episode.json").write_text("{}")
            assert host.recorded(attempt, 0)
        raise ServerError("The server does not start.")


def test_what_is_converted_later_stays_when_the_server_is_gone(
    begin: Callable[[str], Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = check_config({**DEFERRED, "episodes": 3})
    plan, run = plan_episodes(config, FACTS), begin("first")
    setup = ServerSetup(config)
    given = (config, setup, run.store, run.record, run.interruption, run.wakeup, 2, {})
    session = Session(*given, _Recorded(plan))  # type: ignore[arg-type]
    monkeypatch.setattr(session, "_test_server", lambda: None)
    with pytest.raises(ServerError):
        session.run(plan, plan)
    waiting = {one.episode_id for one in pending_recordings(tmp_path)}
    assert waiting == set(plan.ids[:2])
    assert any("2 recorded episodes not yet converted" in sentence for sentence in run.said)


def following(run: Run, config: Config) -> _FollowingSession:
    given = (run.store, run.record, run.interruption, run.wakeup)
    session = _FollowingSession({}, config, None, *given)  # type: ignore[arg-type]
    session.prepare("hero", 1.0, None, {}, threading.Event())
    return session


def test_a_drive_that_the_dataset_takes_no_attempt_for_is_kept(
    begin: Callable[[str], Run], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    remote = {"kind": "remote", "host": "127.0.0.1", "port": 2000}
    config = check_config({**DEFERRED, "server": remote})
    run = begin("drive")
    session = following(run, config)
    recorded = run.folder.raw / "recorded-0"
    (recorded / "world").mkdir(parents=True)
    (recorded / "episode.json").write_text("{}")
    (recorded / "world/000000.seg").write_text("a drive")
    beside = RecordedSpec("0" * 16, 0, 7, "hero", "0.9.16", "0.9.16")
    session._spec = replace(plan_episodes(config, FACTS)[0], scenario=beside)

    def refuse(*_: object) -> str:
        raise StorageError("s3://b: creating leases failed (503).")

    reserve = run.store.reserve_attempt
    monkeypatch.setattr(run.store, "reserve_attempt", refuse)
    monkeypatch.setattr(session, "_execute", lambda _: session._take(recorded, 50, 0))
    with pytest.raises(StorageError, match="503"):
        session.run(EpisodePlan.empty(), EpisodePlan.empty())
    (kept,) = pending_recordings(tmp_path)
    assert (kept.folder / "world/000000.seg").read_text() == "a drive"
    header = json.loads((kept.folder / "episode.json").read_bytes())
    assert header["episode_id"] == kept.episode_id
    assert any("next `carstage record`" in sentence for sentence in run.said)

    monkeypatch.setattr(run.store, "reserve_attempt", reserve)
    later = begin("next")
    taken = following(later, config)
    taken._convert_pending()
    taken._queue.converters.kill()
    raw_folder = later.folder.raw_attempt(kept.episode_id, "a1")
    assert (raw_folder / "world/000000.seg").read_text() == "a drive"
    assert json.loads((raw_folder / "episode.json").read_bytes())["attempt"] == "a1"
    assert (tmp_path / "episodes" / kept.episode_id / "a1").is_dir()


def leave_recording(run: Run, environment: dict[str, str]) -> tuple[Job, Pending]:
    """A whole recording that a run, which has ended since, had no time to convert."""
    raw = run.folder.raw_attempt("unnamed", "a1")
    raw.parent.mkdir(parents=True)
    episode_id = analytic_scene.write_raw_log(raw)["episode_id"]
    named = run.folder.raw_attempt(episode_id, "a1")
    named.parent.mkdir()
    raw.rename(named)
    verdict = {"gnss": {"projection": "p", "north": "+y"}, "ok": True}
    pending = Pending({}, environment, verdict, durable=False)
    write_pending(named, pending)
    (run.folder.path / "status.json").write_text('{"state": "interrupted"}')
    return Job(EpisodeLog(named).spec, episode_id), pending


@pytest.mark.parametrize(("irreplaceable", "taken"), [(False, False), (True, True)])
def test_only_what_nobody_can_record_again_is_converted_by_another_version(
    begin: Callable[[str], Run], irreplaceable: bool, taken: bool
) -> None:
    job, _ = leave_recording(begin("old"), {"carstage": "0.0"})
    run = begin("new")
    given = (check_config(DEFERRED), run.store, run.record, run.wakeup, {}, True)
    queue = CommitQueue(*given, lambda *_: None, irreplaceable)
    assert (job.episode_id in queue.take_pending([job])) is taken
    queue.converters.kill()


def test_a_recording_that_waits_again_keeps_what_is_known_of_it(
    begin: Callable[[str], Run], tmp_path: Path
) -> None:
    job, pending = leave_recording(begin("old"), {})
    run = begin("new")
    given = (check_config(DEFERRED), run.store, run.record, run.wakeup, {}, True)
    queue = CommitQueue(*given, lambda *_: None)
    assert queue.take_pending([job]) == {job.episode_id}
    queue.give_back()
    (run.folder.path / "status.json").write_text('{"state": "failed"}')
    (left,) = pending_recordings(tmp_path)
    assert left.pending == replace(pending, converted=[])


def test_codecs_of_another_variant_s_sensors_are_left_out(
    begin: Callable[[str], Run],
) -> None:
    camera, lidar = {"id": "CAM", "kind": "rgb"}, {"id": "TOP", "kind": "lidar"}
    rigs = {"both": [camera, lidar], "one": [camera]}
    config = check_config(
        {
            **DEFERRED,
            "rig": {"sensors": [camera, lidar]},
            "variants": {name: {"rig": {"sensors": rig}} for name, rig in rigs.items()},
            "conversion": {"mode": "deferred", "codecs": {"TOP": "npz"}},
        }
    )
    run = begin("variants")
    queue = CommitQueue(config, run.store, run.record, run.wakeup, {}, True, lambda *_: None)
    for spec in plan_episodes(config, FACTS):
        queue.attempt_commit(Job(spec, spec.episode_id), "a1")  # it names no sensor that is not
        assert shortened(config.model_copy(update={"rig": rig_of(config, spec), "variants": {}}))
    queue.converters.kill()


def rig_of(config: Config, spec: EpisodeSpec) -> Any:
    assert spec.variant is not None
    return config.variants[spec.variant.name].rig


def test_a_share_is_gone_on_with_as_a_share(begin: Callable[[str], Run]) -> None:
    folder = begin("share").folder
    config = check_config(DEFERRED)
    folder.write_plan(config, plan_episodes(config, FACTS), {}, "2/8")
    assert share_of(folder.path) == "2/8"
    (folder.path / FOLLOWING_PLAN).write_text("{}")
    with pytest.raises(BadInputError, match="another program"):
        share_of(folder.path)


def test_a_run_that_nohup_began_does_not_hear_its_terminal_end() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interruption() as interruption:
            signal.raise_signal(signal.SIGHUP)
            assert not interruption.requested
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)
