"""``record``: what another program ticks becomes episodes, one for each life of its ego.

The collector follows the frames (``carstage.collector.following``); all after its raw log is as in
a run: conversion, labels, ledger, commit. An episode is converted when its ego is gone.
"""

from __future__ import annotations

import json
import secrets
import selectors
import shutil
import threading
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from carstage.config import Config
from carstage.config.servers import RemoteServerConfig
from carstage.errors import (
    BadInputError,
    CarStageError,
    CollectorError,
    DiskFullError,
    ServerError,
    StorageError,
)
from carstage.execution import CollectorProcess
from carstage.plan import EpisodePlan, ServerFacts, plan_episodes
from carstage.plan.estimate import costs_of, estimate_run
from carstage.rawlog.writing import write_episode_file
from carstage.releases import refusal
from carstage.runs.attempt_commit import AttemptCommit, Job
from carstage.runs.attempts import clear_up_all
from carstage.runs.cataloguing import run_catalog
from carstage.runs.commit_queue import CommitQueue
from carstage.runs.continuing import environment_of
from carstage.runs.events import AttemptReserved, EpisodeFailed, Notice, OnEvent
from carstage.runs.folder import CurrentEpisode, RunFolder
from carstage.runs.interruption import ANSWER_S, Interruption
from carstage.runs.keeping import FOLLOWING_PLAN
from carstage.runs.orphans import marked
from carstage.runs.outcome import SOME_FAILED, RunResult
from carstage.runs.pending import Pending, pending_recordings, write_pending
from carstage.runs.preflight import check_disk, check_open_files, check_output, work_folder
from carstage.runs.reading import read_document
from carstage.runs.record import RunRecord
from carstage.runs.rig_source import RigSource, config_of, settings_of
from carstage.runs.run_session import RunSession
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.sensor_kinds import plugins_of, registered_kinds
from carstage.server import ClientPython, find_client, probe_version
from carstage.server.asking import ask_server
from carstage.spec import EpisodeSpec, SpecError, Stand
from carstage.spec.scenario import RecordedSpec
from carstage.storage import RemotePath, Store, open_store

DEFAULT_WAIT_S = 120.0
END_S = 600.0
"""After Ctrl-C, what is recorded is still converted and committed; that may take so long."""
CALL_S = 20.0
POLL_S = 0.2
LEAST_S = 60.0
"""So much simulated time must have room on the disk; nobody knows how long a drive will be."""
_UNNAMED = "recorded-"
"""What the collector calls a recording, before its length and so its id are known."""
_UNRESERVED = "a0"
"""Attempt of a drive that is kept, as the dataset could give it none: no store gives that."""
_ERRORS: Mapping[str, type[CarStageError]] = {
    **dict.fromkeys(("scene", "plan", "version"), BadInputError),
    "connection": ServerError,
    "disk": DiskFullError,
}
"""By what the collector calls its errors."""
_BYTES_PER_MB = 1_000_000
_RECORDING_BYTES = 8


def record_beside(
    server: str,
    ego: str,
    rig: RigSource,
    out: Path | str,
    on_event: OnEvent | None = None,
    *,
    settings: tuple[str, ...] = (),
    wait_s: float = DEFAULT_WAIT_S,
    episodes: int | None = None,
    catalog: str | None = None,
    work: Path | str | None = None,
    stop: threading.Event | None = None,
) -> RunResult:
    """Record an ego that another program drives and ticks, until it is gone; then the next one.

    Nothing of the server is changed but for the rig's sensors, which go at the end.

    Args:
        server: ``HOST:PORT``.
        ego: its ``role_name``, its actor id, or a pattern of blueprints such as ``vehicle.*``.
        rig: what is recorded, see ``RigSource``; of a whole configuration, keys that say what
            drives where (map, traffic, duration) do not count.
        out: folder of the dataset, or its place in an object store.
        on_event: called with each typed event of ``carstage.runs.events``.
        settings: overrides such as ``labels.method=pixels``.
        wait_s: how long an ego is waited for.
        episodes: end after so many; None: when no further ego comes.
        catalog: also write what is committed to this catalog.
        work: folder of this machine for raw recordings and logs.
        stop: ends the recording when it is set, from another thread.

    Raises:
        BadInputError: no server, no such ego, a rig that does not fit, or a world that is not
            synchronous with a fixed step.
        ServerError: the server was gone before the ego; what it showed is committed.
        DiskFullError: the disk is full; what was committed before stays.
        CarStageError: recording or committing failed.
    """
    host, port = _address(server)
    asked, left_out = settings_of(rig, settings)
    asked["server"] = {**asked["server"], "kind": "remote", "host": host, "port": port}
    config = config_of(asked)
    patience_s = max(wait_s, CALL_S)
    version = _version_of(host, port, config, patience_s)
    store = open_store(out)
    place = work_folder(store.root, work)

    def notice(sentence: str) -> None:
        if on_event is not None:
            on_event(Notice(sentence))

    if left_out:
        notice(
            f"{', '.join(left_out)}: the other program decides on it; the rest of the "
            "configuration counts."
        )
    with Interruption(notice, end_s=END_S) as interruption, ExitStack() as stack:
        stack.enter_context(store.within(lambda: interruption.left_before_s(ANSWER_S)))
        check_output(place)
        check_open_files()
        store.check()
        clear_up_all(place, store, notice)
        _check_room(asked, ask_server(host, port, version, patience_s), place, store)
        assert isinstance(config.server, RemoteServerConfig)
        server_python = config.server.client_python, config.server.create_client_env
        client = find_client(version, server_python[0], create=server_python[1])
        follow = stack.enter_context(run_catalog(catalog, store.root, notice))
        store.initialise(config.name)
        folder = stack.enter_context(RunFolder(place))
        stack.enter_context(marked(folder.run_id))
        wakeup = stack.enter_context(WakeupPipe())
        record = RunRecord(folder, interruption, follow(on_event, folder))
        environment = environment_of(version, client.client)
        session = _FollowingSession(asked, config, client, store, record, interruption, wakeup)
        session.prepare(ego, wait_s, episodes, environment, stop or threading.Event())
        nothing = EpisodePlan.empty()
        folder.write_plan(config, nothing, environment)
        return session.run(nothing, nothing)


class _FollowingSession(RunSession):
    """A recording: its collector, and what it recorded on its way into the dataset."""

    def __init__(
        self,
        asked: Mapping[str, Any],
        config: Config,
        client: ClientPython,
        store: Store,
        record: RunRecord,
        interruption: Interruption,
        wakeup: WakeupPipe,
    ) -> None:
        super().__init__(store, record, interruption)
        self._asked = asked
        self._config = config
        self._client = client
        self._wakeup = wakeup
        self._specs: list[EpisodeSpec] = []
        self._spec: EpisodeSpec | None = None
        self._recording = secrets.token_hex(_RECORDING_BYTES)
        self._last_words: dict[str, Any] = {}
        self._problem: CarStageError | None = None

    def prepare(
        self,
        ego: str,
        wait_s: float,
        episodes: int | None,
        environment: Mapping[str, str],
        stop: threading.Event,
    ) -> None:
        """Say what is waited for."""
        self._environment = environment
        self._stop = stop
        server = self._config.server
        self._queue = CommitQueue(
            self._config,
            self._store,
            self._record,
            self._wakeup,
            environment,
            raw_must_last=True,
            failed=self._failed,
            irreplaceable=True,
        )
        self._plan: dict[str, Any] = {
            "server": {"host": server.host, "port": server.port, "timeout_s": CALL_S},  # type: ignore[union-attr]
            "ego": ego,
            "wait_s": wait_s,
            "folder": str(self._folder.raw.absolute()),
            "queue_bytes": self._config.output.raw_queue_mb * _BYTES_PER_MB,
            "plugins": plugins_of(sensor.kind for sensor in self._config.sensors),
        }
        if episodes is not None:
            self._plan["episodes"] = episodes

    @property
    def frames(self) -> int:
        """Frames of the episodes that were committed."""
        return self._queue.frames

    def _execute(self, todo: EpisodePlan) -> None:
        del todo  # what comes is not planned
        self._folder.raw.mkdir(exist_ok=True)
        with self._interruption.deferred(), ExitStack() as stack:
            self._queue.converters.pool()
            self._convert_pending()
            collector = stack.enter_context(
                CollectorProcess(
                    self._plan,
                    plan_path=self._folder.path / FOLLOWING_PLAN,
                    log_path=self._folder.logs / "collector.log",
                    python=str(self._client.path),
                    module="carstage.collector.following",
                )
            )
            stack.enter_context(self._interruption.kills(collector.kill))
            self._record.notice(f"Waiting for the ego {self._plan['ego']!r}.")
            self._listen(collector)
            code = collector.wait(CALL_S)
        with self._interruption.deferred():
            while not self._queue.empty:
                self._poll(self._wakeup)
        if self._problem is not None:
            raise self._problem
        if code != 0:
            raise self._explained(code)
        self._interruption.check()

    def _convert_pending(self) -> None:
        """Begin to convert what earlier recordings into this dataset could not."""
        jobs = []
        for recording in pending_recordings(self._folder.work):
            header = read_document(recording.folder / "episode.json") or {}
            with suppress(SpecError, KeyError):  # not ours
                spec = EpisodeSpec.from_json(header["spec"], kinds=registered_kinds())
                if isinstance(spec.scenario, RecordedSpec):
                    jobs.append(Job(spec, recording.episode_id))
                    if recording.attempt == _UNRESERVED:
                        reserved = recording.folder.with_name(self._reserved(recording.episode_id))
                        _name(recording.folder, reserved, spec)
        for episode_id in self._queue.take_pending(jobs):
            self._specs += [job.spec for job in jobs if job.episode_id == episode_id]
            self._status.episodes.total += 1
            self._attempted = True
        self._queue.begin_all()

    def _listen(self, collector: CollectorProcess) -> None:
        """Do what the collector's events ask for, until it ends."""
        stopping = False
        while not collector.ended:
            self._poll(collector, *(() if stopping else (self._interruption,)))
            for event in collector.read_events():
                self._on_event(collector, event)
            if not stopping and (self._interruption.requested or self._stop.is_set()):
                stopping = True
                collector.stop()

    def _poll(self, *sources: Any) -> None:
        """Wait for one of the sources; commit what is converted, renew the heartbeat."""
        with selectors.DefaultSelector() as selector:
            for source in sources:
                selector.register(source, selectors.EVENT_READ)
            selector.select(POLL_S)
        self._wakeup.clear()
        self._queue.commit_converted()
        self._record.beat()

    def _on_event(self, collector: CollectorProcess, event: dict[str, Any]) -> None:
        match event["event"]:
            case "ego_found":
                try:
                    self._spec = self._planned(event)
                except CarStageError as error:
                    self._problem = error
                    collector.stop()
                    return
                self._status.episodes.total += 1
                self._status.current = CurrentEpisode(
                    f"{_UNNAMED}{event['part']}", int(event["part"]), "a1"
                )
                self._record.enter("recording")
                self._record.notice(f"Found the ego: {event['type_id']} on {event['map']}.")
                collector.send_line(json.dumps(self._spec.to_json()))
            case "ego_gone":
                self._take(Path(event["folder"]), int(event["ticks"]), int(event["incomplete"]))
            case "error":
                self._last_words = event
        self._record.copy_event(event)

    def _planned(self, seen: Mapping[str, Any]) -> EpisodeSpec:
        """The specification of what was seen; its number of steps comes with the end."""
        server: Any = self._config.server
        fps = round(1.0 / float(seen["step_s"]), 9)
        asked = {**self._asked, "map": {"choice": seen["map"]}, "fps": fps, "duration_s": 1 / fps}
        self._config = config_of(asked)
        version = str(seen["server_version"])
        facts = ask_server(server.host, server.port, version)
        spec = plan_episodes(self._config, facts)[0]
        timing = spec.timing
        substep_s, substeps = float(seen["max_substep_delta_time_s"]), int(seen["max_substeps"])
        if substep_s * substeps >= spec.step_s:
            timing = replace(timing, max_substep_delta_time_s=substep_s, max_substeps=substeps)
        self._folder.write_plan(self._config, EpisodePlan.empty(), self._environment)
        return replace(
            spec,
            warmup_ticks=0,
            timing=timing,
            ego=replace(
                spec.ego,
                blueprint=str(seen["type_id"]),
                spawn_index=None,
                spawn_place=Stand(*map(float, seen["place"])),
            ),
            scenario=RecordedSpec(
                recording=self._recording,
                part=int(seen["part"]),
                ego_id=int(seen["id"]),
                role=str(seen["role"]),
                client=str(seen["client_version"]),
                server=version,
            ),
            index=int(seen["part"]),
        )

    def _take(self, recorded: Path, ticks: int, incomplete: int) -> None:
        """Hand a recording to the conversion, now that its length and so its id are known."""
        self._status.current = None
        if self._spec is None or not ticks:
            self._status.episodes.total -= 1
            self._record.notice("The ego went before a frame was recorded.")
            shutil.rmtree(recorded, ignore_errors=True)
            return
        spec = replace(self._spec, steps=ticks)
        episode_id = spec.episode_id
        try:
            attempt = self._reserved(episode_id)
        except StorageError:
            self._keep(recorded, spec)
            raise
        self._record.event(AttemptReserved(episode_id=episode_id, attempt=attempt))
        attempt_commit = self._queue.attempt_commit(Job(spec, episode_id), attempt)
        _name(recorded, attempt_commit.raw_folder, spec)
        self._attempted = True
        self._specs.append(spec)
        if incomplete:
            self._record.notice(
                f"Episode {episode_id}: {incomplete} of {ticks} steps lack data of a sensor; "
                "the ledger frames.parquet names them."
            )
        self._queue.add(attempt_commit)
        self._queue.begin_next()

    def _reserved(self, episode_id: str) -> str:
        holder = {"run_id": self._folder.run_id, **self._folder.process}
        return self._store.reserve_attempt(episode_id, holder, 1)

    def _keep(self, recorded: Path, spec: EpisodeSpec) -> None:
        """Leave a drive that the dataset gives no attempt for to the next recording into it."""
        raw_folder = self._folder.raw_attempt(spec.episode_id, _UNRESERVED)
        raw_folder.parent.mkdir(parents=True, exist_ok=True)
        _name(recorded, raw_folder, spec)
        codecs = self._config.conversion.codecs
        write_pending(raw_folder, Pending(codecs, self._environment, None, durable=True))
        self._tell_it_is_kept(spec.episode_id)

    def _tell_it_is_kept(self, episode_id: str) -> None:
        self._record.notice(
            f"Episode {episode_id} is kept as it was recorded: the next `carstage record` into "
            "this dataset converts it."
        )

    def _failed(self, attempt: AttemptCommit, error: CarStageError, final: bool) -> None:
        """An episode could not be converted; nobody can record it again, so it is kept."""
        del final
        episode_id = attempt.job.episode_id
        self._tell_it_is_kept(episode_id)
        self._failures[episode_id] = str(error)
        self._status.episodes.failed += 1
        self._record.event(EpisodeFailed(episode_id, attempt.attempt, str(error)))
        if isinstance(error, DiskFullError):
            raise error

    def _explained(self, code: int | None) -> CarStageError:
        said = self._last_words
        message = str(said.get("message") or f"The collector ended with exit code {code}.")
        hint = str(said.get("hint") or f"See {self._folder.logs / 'collector.log'}.")
        error = _ERRORS.get(str(said.get("kind")), CollectorError)(message, hint)
        if left := list(self._folder.raw.glob(f"{_UNNAMED}*")):
            error.message += f" Lost is what was being recorded, {left[0].name}."
        ids = [spec.episode_id for spec in self._specs if spec.episode_id not in self._failures]
        if ids:
            error.message += f" In the dataset is what was whole: {', '.join(ids)}."
            error.exit_code = SOME_FAILED
        return error

    def _tell_how_to_go_on(self) -> None:
        """Nothing: nobody can make the rest of a drive again."""

    def _interrupt(self) -> None:
        self._status.message = "Ended by the user; what was whole is committed."

    def _interrupted(self) -> None:
        """Nothing is left to do: what was recorded is committed already."""

    def _give_back(self) -> None:
        specs = self._specs
        if specs:
            ids = tuple(spec.episode_id for spec in specs)
            plan = EpisodePlan(lambda i: specs[i], np.arange(len(specs)), ids, costs_of(specs))
            self._folder.write_plan(self._config, plan, self._environment)
        for left in self._folder.raw.glob(f"{_UNNAMED}*"):
            shutil.rmtree(left, ignore_errors=True)  # nobody can finish it
        self._queue.give_back()


def _name(recorded: Path, raw_folder: Path, spec: EpisodeSpec) -> None:
    """Make a recording that of an attempt."""
    recorded.rename(raw_folder)
    header = json.loads((raw_folder / "episode.json").read_bytes())
    header.update(episode_id=spec.episode_id, attempt=raw_folder.name, spec=spec.to_json())
    write_episode_file(str(raw_folder), header)


def _address(server: str) -> tuple[str, int]:
    host, colon, port = server.rpartition(":")
    if not (colon and host and port.isascii() and port.isdigit() and 0 < int(port) < 65_534):
        raise BadInputError(
            f"--server: {server!r} is not HOST:PORT.", "Write, for example, localhost:2000."
        )
    return host, int(port)


def _check_room(asked: Mapping[str, Any], facts: ServerFacts, place: Path, store: Store) -> None:
    """Refuse a disk without room for a short drive, and sensors that the server does not have.

    Raises:
        BadInputError: with the field's path.
    """
    choice = {"map": {"choice": next(iter(facts.maps))}, "duration_s": LEAST_S}
    config = config_of({**asked, **choice})
    check_disk(
        place,
        estimate_run(config, plan_episodes(config, facts)),
        dataset_elsewhere=isinstance(store.root, RemotePath),
        what=f"{LEAST_S:g} s of recording need",
    )


def _version_of(host: str, port: int, config: Config, patience_s: float) -> str:
    """What the server reports; while a program has it load a map, it answers nobody."""
    try:
        version = probe_version(host, port, patience_s)
    except ServerError as error:
        raise BadInputError(
            f"No CARLA server answers at {host}:{port}: {error.message}",
            "Start it first, and check its address and port.",
        ) from error
    reason = refusal(version, {sensor.kind: sensor.row.since for sensor in config.sensors})
    if reason:
        raise BadInputError(f"server: {reason}.", "Use a newer CARLA, or leave such sensors out.")
    return version
