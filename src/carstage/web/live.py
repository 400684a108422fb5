"""The WebSocket's hub: looks at the folders and sends every client what is new to it.

One task looks twenty times a second while somebody is connected, so that ten pictures a second pass
without a gap, and once a second otherwise, for the queue. A client gets each text message in order;
of pictures only the newest of each channel, so a slow one skips pictures instead of falling behind.
"""

from __future__ import annotations

import asyncio
import json
import logging
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from fastapi import WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from carstage.files.whole import write_whole
from carstage.runs.folder import INPUTS_FILE
from carstage.web.configure.store import ConfigStore
from carstage.web.datasets.jobs import JobService
from carstage.web.loading import load
from carstage.web.messages import (
    Channel,
    ChannelsMessage,
    ClientMessage,
    ConfigMessage,
    ConfigState,
    DatasetsMessage,
    DriveMessage,
    JobMessage,
    LogMessage,
    Message,
    RunMessage,
    RunsMessage,
    RunSummary,
    SnapshotMessage,
    TicksMessage,
    WatchMessage,
)
from carstage.web.preview.run_previews import Previews
from carstage.web.roots import Roots
from carstage.web.runs.service import RunService

_LOOK_S = 0.05
_IDLE_LOOK_S = 1.0
_LIST_EVERY = 10
"""Looks between two at the lists of runs, jobs and datasets."""
_MOST_PENDING = 2000
_MOST_CLIENTS = 64
_TRY_AGAIN_LATER = 1013

_GONE = (WebSocketDisconnect, RuntimeError, OSError)
"""What sending raises when the page has gone."""

_log = logging.getLogger("carstage.web")


@dataclass(eq=False)
class _Client:
    """A connection: what it looks at, what it has seen, what waits for it."""

    socket: WebSocket
    run_id: str | None = None
    previews: bool = False
    fresh: bool = False
    lines_seen: int = 0
    ticks_seen: int = 0
    loads_seen: int = 0
    channels_seen: list[Channel] | None = None
    pictures_seen: dict[str, int] = field(default_factory=dict)
    texts: list[str] = field(default_factory=list)
    pictures: dict[int, bytes] = field(default_factory=dict)
    wake: asyncio.Event = field(default_factory=asyncio.Event)
    lost: bool = False

    def post(self, message: Message) -> None:
        self.texts.append(message.model_dump_json())
        self.lost = len(self.texts) > _MOST_PENDING  # it does not read any more
        self.wake.set()

    def watch(self, message: WatchMessage) -> None:
        if message.run_id != self.run_id:
            self.run_id, self.fresh = message.run_id, True
            self.pictures.clear()
        self.previews = message.previews


@dataclass(frozen=True, slots=True)
class _Look:
    """What a client wants of its run, and has seen of it."""

    run_id: str
    fresh: bool
    previews: bool
    lines_seen: int
    ticks_seen: int
    loads_seen: int
    channels_seen: list[Channel] | None


@dataclass(slots=True)
class _Found:
    """What is new to it."""

    lines_seen: int = 0
    ticks_seen: int = 0
    loads_seen: int = 0
    channels: list[Channel] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)
    ticks: dict[str, int] = field(default_factory=dict)
    pictures: dict[int, bytes] = field(default_factory=dict)


class LiveHub:
    """All connections; belongs to the event loop."""

    def __init__(
        self,
        config: ConfigStore,
        runs: RunService,
        jobs: JobService,
        previews: Previews,
        roots: Roots,
    ) -> None:
        self._config = config
        self._runs = runs
        self._jobs = jobs
        self._previews = previews
        self._roots = roots
        self._clients: set[_Client] = set()
        self._driving = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._config_told: ConfigState | None = None
        self._summaries: dict[str, RunSummary] = {}
        self._runs_sent: list[tuple[str, int]] = []
        self._jobs_sent: dict[str, Message] = {}
        self._datasets: dict[str, float] = {}

    def config_changed(self, state: ConfigState) -> None:
        """Send it to all clients; may be called from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._tell_config, state)

    def _tell_config(self, state: ConfigState) -> None:
        self._config_told = state
        self._broadcast(ConfigMessage(config=state))

    async def look_on(self) -> None:
        """Look until cancelled."""
        self._loop = asyncio.get_running_loop()
        await asyncio.to_thread(load)
        number = 0
        while True:
            begin_s = self._loop.time()
            try:
                if number % _LIST_EVERY == 0 or not self._clients:
                    await self._look_at_lists()
                for client in list(self._clients):
                    await self._look_for(client)
            except Exception:  # noqa: BLE001 - a look that fails must not end all others
                _log.exception("looking at the runs failed")
            number += 1
            pause_s = _LOOK_S if self._clients else _IDLE_LOOK_S
            await asyncio.sleep(max(_LOOK_S / 5, begin_s + pause_s - self._loop.time()))

    async def serve(self, socket: WebSocket) -> None:
        """One connection, to its end."""
        await socket.accept()
        if len(self._clients) >= _MOST_CLIENTS:
            await socket.close(_TRY_AGAIN_LATER, "too many connections")
            return
        client = _Client(socket)
        await asyncio.to_thread(load)
        snapshot, told = await asyncio.to_thread(self._snapshot), self._config_told
        if told is not None and told.rev > snapshot.config.rev:  # changed while it was made
            snapshot = snapshot.model_copy(update={"config": told})
        client.post(snapshot)
        self._clients.add(client)
        self._runs_sent = []  # its list is of before: what went meanwhile must be told
        sender = asyncio.create_task(self._send(client))
        try:
            while True:
                text = await socket.receive_text()
                with suppress(ValidationError):  # of a newer page: unknown messages are ignored
                    message = ClientMessage.model_validate_json(text).root
                    if isinstance(message, WatchMessage):
                        client.watch(message)
                    else:
                        await asyncio.to_thread(self._drive, message)
        except (WebSocketDisconnect, KeyError, RuntimeError):
            pass  # gone, or it has sent bytes
        finally:
            self._clients.discard(client)
            sender.cancel()
            (fault,) = await asyncio.gather(sender, return_exceptions=True)
            if isinstance(fault, Exception) and not isinstance(fault, _GONE):
                _log.error("sending to a page failed", exc_info=fault)

    async def close(self) -> None:
        """Close all connections."""
        for client in list(self._clients):
            with suppress(*_GONE):
                await client.socket.close(1001)

    def _drive(self, message: DriveMessage) -> None:
        """Hand on what is pressed, to a run that is driven at the page; in a thread."""
        run = self._summaries.get(message.run_id)
        folder = self._runs.folder(message.run_id)
        if run is None or run.driven is None or run.alive != "running" or folder is None:
            return
        state = message.model_dump(include={"sender", "sequence", "held", "presses", "axes"})
        path = folder / INPUTS_FILE
        with self._driving, suppress(OSError):  # the run was removed
            path.parent.mkdir(exist_ok=True)
            write_whole(path, json.dumps(state).encode())

    def _snapshot(self) -> SnapshotMessage:
        runs = self._runs.summaries()
        shown = next((run for run in runs if run.state != "queued"), None)
        return SnapshotMessage(
            config=self._config.state(),
            runs=runs,
            run=None if shown is None else self._runs.detail(shown.run_id),
            jobs=self._jobs.all(),
        )

    async def _send(self, client: _Client) -> None:
        while not client.lost:
            await client.wake.wait()
            client.wake.clear()
            while client.texts or client.pictures:
                texts, client.texts = client.texts, []
                for text in texts:
                    await client.socket.send_text(text)
                if client.pictures:
                    channel = next(iter(client.pictures))
                    await client.socket.send_bytes(client.pictures.pop(channel))
        await client.socket.close(_TRY_AGAIN_LATER, "too slow")

    def _broadcast(self, message: Message) -> None:
        for client in self._clients:
            client.post(message)

    async def _look_at_lists(self) -> None:
        await asyncio.to_thread(self._runs.advance)
        if not self._clients:
            return
        runs = await asyncio.to_thread(self._runs.summaries)
        order = [(run.run_id, run.position) for run in runs]
        if order != self._runs_sent:
            self._runs_sent = order
            self._broadcast(RunsMessage(runs=runs))
        else:
            for run in runs:
                if self._summaries.get(run.run_id) != run:
                    self._broadcast(RunMessage(run_id=run.run_id, run=run))
        self._summaries = {run.run_id: run for run in runs}
        for job in await asyncio.to_thread(self._jobs.all):
            if self._jobs_sent.get(job.job_id) != job:
                self._jobs_sent[job.job_id] = job
                self._broadcast(JobMessage(job=job))
        datasets = await asyncio.to_thread(self._fingerprint)
        if datasets != self._datasets:
            self._datasets = datasets
            self._broadcast(DatasetsMessage())

    def _fingerprint(self) -> dict[str, float]:
        """Changes when a dataset or an episode comes or goes."""
        found = {}
        for dataset in self._roots.datasets().values():
            with suppress(OSError):
                found[dataset.dataset] = dataset.changed() or 0.0
        return found

    async def _look_for(self, client: _Client) -> None:
        run_id = client.run_id
        if run_id is None:
            return
        if client.fresh:
            client.lines_seen = client.ticks_seen = client.loads_seen = 0
            client.channels_seen = None
            client.pictures_seen.clear()
        look = _Look(
            run_id,
            client.fresh,
            client.previews,
            client.lines_seen,
            client.ticks_seen,
            client.loads_seen,
            client.channels_seen,
        )
        client.fresh = False
        found = await asyncio.to_thread(self._look_at_run, look, dict(client.pictures_seen))
        if found is None:
            client.fresh = look.fresh  # the run has no folder yet
        elif client.run_id == run_id:  # it may have turned to another one meanwhile
            client.lines_seen, client.ticks_seen = found.lines_seen, found.ticks_seen
            client.loads_seen = found.loads_seen
            client.channels_seen = found.channels
            client.pictures_seen.update(found.ticks)
            client.pictures.update(found.pictures)
            for message in found.messages:
                client.post(message)
            if found.pictures:
                client.wake.set()

    def _look_at_run(self, look: _Look, pictures_seen: Mapping[str, int]) -> _Found | None:
        """What is new about a run; in a thread."""
        folder = self._runs.folder(look.run_id)
        run = self._summaries.get(look.run_id)
        if run is None:
            return None
        found = _Found()
        if folder is None:
            if run.alive != "ended":
                return None
            # Refused before it made a folder: what its command has printed is all there is.
            if look.fresh:
                log = self._runs.output(run.run_id)
                found.messages.append(LogMessage(run_id=run.run_id, reset=True, lines=log))
            return found
        with self._runs.locked:
            follower = self._runs.follow(look.run_id)
            if follower is None:
                return None
            follower.read()
            lines = follower.lines_after(look.lines_seen)
            ticks = follower.ticks.after(look.ticks_seen)
            loads = follower.loads.after(look.loads_seen)
            found.lines_seen, found.ticks_seen = follower.lines_seen, follower.ticks.seen
            found.loads_seen = follower.loads.seen
        channels = self._previews.channels(run.sensors)
        if lines or look.fresh:
            found.messages.append(LogMessage(run_id=run.run_id, reset=look.fresh, lines=lines))
        if ticks or loads or look.fresh:
            found.messages.append(
                TicksMessage(run_id=run.run_id, reset=look.fresh, ticks=ticks, loads=loads)
            )
        found.channels = channels
        if channels != look.channels_seen:  # while a run is planned, its sensors are not known
            found.messages.append(ChannelsMessage(run_id=run.run_id, channels=channels))
        if look.previews:
            if run.alive == "running":
                self._previews.want(folder)
            self._take_pictures(folder, channels, pictures_seen, found)
        return found

    def _take_pictures(
        self,
        folder: Path,
        channels: list[Channel],
        seen: Mapping[str, int],
        found: _Found,
    ) -> None:
        ticks = self._previews.ticks(folder)
        for channel in channels:
            tick = ticks.get(channel.sensor_id)
            if tick is None or seen.get(channel.sensor_id) == tick:
                continue
            packet = self._previews.packet(folder, channel, tick)
            if packet is not None:
                found.ticks[channel.sensor_id] = tick
                found.pictures[channel.channel] = packet
