"""``python -m carstage.runs.slot``: a worker of a run that is another process.

It does what a run with one worker does (server, self-test, collector, converters, commits), but for
planning: it asks for one episode after the other, and all that a run writes into its folder goes to
the run that it belongs to. See ``carstage.execution.slots`` for what is said on the line.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from carstage.config import Config, check_config, dump_config
from carstage.config.servers import CarlaServerConfig
from carstage.errors import BadInputError, CarStageError, WorkerLostError
from carstage.execution import InlineExecutor, SlotProgram
from carstage.execution.ray_slots import CARD_VARIABLE
from carstage.execution.slot_line import SlotLine
from carstage.plan import EpisodePlan
from carstage.runs.attempt_commit import Job
from carstage.runs.events import GraphicsCardChecked, Notice, RunEvent
from carstage.runs.folder import PROCESS_FILE, RunFolder, RunStatus
from carstage.runs.identity import identify
from carstage.runs.interruption import ANSWER_S, EXIT_CODE, Interruption
from carstage.runs.orphans import WORKER_VARIABLE, worker_mark
from carstage.runs.reading import read_document
from carstage.runs.record import RunRecord
from carstage.runs.servers import ServerSetup, make_server
from carstage.runs.session import Session
from carstage.runs.wakeup_pipe import WakeupPipe
from carstage.server import ClientPython, Endpoint, PortRange, Server
from carstage.server.graphics import ADAPTER_OPTION, describe_card, wanted_card
from carstage.spec import EpisodeSpec
from carstage.storage import DatasetPath, RemotePath, dataset_root, open_store

_OWN_PYTHON = "own"
_END_S = 8.0
"""A slot ends sooner than the run that waits for it."""
_RUNS_OWN = ("run_started", "run_finished")


def slot_program(
    folder: RunFolder,
    dataset: DatasetPath,
    number: int,
    count: int,
    config: Config,
    client: ClientPython,
    environment: Mapping[str, str],
    retries: int,
) -> SlotProgram:
    """What the ``number``-th of ``count`` slots of a run is to run.

    Args:
        folder: the run's.
        dataset: where it is.
        number: of the slot, from 1.
        count: of slots.
        config: what is recorded, with this slot's ports, threads and graphics card.
        client: the Python that the collector runs with.
        environment: what is recorded with, by version.
        retries: further attempts of an episode that fails.
    """
    setup = {
        "run_id": folder.run_id,
        "dataset": str(dataset),
        "work": str(folder.work),
        "process": dict(folder.process),
        "number": number,
        "count": count,
        "config": dump_config(config),
        "client": _OWN_PYTHON if str(client.path) == sys.executable else str(client.path),
        "client_version": client.client,
        "environment": dict(environment),
        "retries": retries,
    }
    return SlotProgram(
        module="carstage.runs.slot",
        setup=setup,
        log_path=folder.logs / f"worker-{number}" / "worker.log",
        environment={WORKER_VARIABLE: worker_mark(folder.run_id, number)},
    )


class SlotFolder(RunFolder):
    """A run's folder as one of its slots sees it: events and status go to the run.

    Raw recordings lie where those of a run with one worker do, so that whoever clears up after the
    run finds them. Logs have a folder of their own.
    """

    def __init__(self, line: SlotLine, setup: Mapping[str, Any]) -> None:
        self._line = line
        self._number = int(setup["number"])
        self.run_id = str(setup["run_id"])
        self.work = Path(setup["work"])
        self.path = self.work / "runs" / self.run_id
        self.process = setup["process"]
        self._own = identify()
        seen = read_document(self.path / PROCESS_FILE) == dict(self.process)
        if not seen and not isinstance(dataset_root(setup["dataset"]), RemotePath):
            raise BadInputError(
                f"The run's folder {self.path} is not seen on {self._own['host']}.",
                "Give an --out that all nodes of the cluster see at the same path, or one in an "
                "object store.",
            )
        for folder in (self.logs, self.raw):
            folder.mkdir(parents=True, exist_ok=True)

    @property
    def logs(self) -> Path:
        """Folder of the logs of this slot's server and collectors."""
        return self.path / "logs" / f"worker-{self._number}"

    @property
    def self_test(self) -> Path:
        """Folder for the raw recording of a self-test."""
        folder = self.raw / f"worker-{self._number}"
        folder.mkdir(exist_ok=True)
        return folder

    def write_event(self, event: str, fields: Mapping[str, Any]) -> dict[str, Any]:
        """Tell an event to the run."""
        line = {"event": event, **fields}
        if event not in _RUNS_OWN:
            self._line.send("event", line=line)
        if event in ("episode_committed", "episode_failed", "episode_skipped"):
            self._line.send("done", key=line["episode_id"])
        return line

    def write_status(self, status: RunStatus, *, durable: bool = False) -> None:
        """Tell the run what this slot does."""
        del durable
        current = status.to_json()["current"]
        self._line.send("status", state=status.state, current=current, process=self._own)


class _SlotServer(ServerSetup):
    """Starts the server, and looks on which graphics card it is."""

    def __init__(self, record: RunRecord, config: Config, *rest: Any) -> None:
        super().__init__(config, *rest)
        self._record = record
        server = config.server
        self._card: int | None = None
        if isinstance(server, CarlaServerConfig):
            self._card = wanted_card(server.arguments)

    def start(self, log_path: Path) -> tuple[Server, Endpoint]:
        """See ``ServerSetup.start``."""
        server, endpoint = super().start(log_path)
        if self._card is not None and endpoint.pid is not None:
            found, sentence = describe_card(self._card, endpoint.pid)
            self._record.event(GraphicsCardChecked(self._card, found))
            if sentence:
                self._record.notice(sentence)
        return server, endpoint


class _Jobs:
    """The jobs that the run hands out; see ``session.JobSource``."""

    def __init__(self, line: SlotLine) -> None:
        self._line = line
        self._asked = False
        self.over = False
        self.idle = False

    def ask(self) -> None:
        """See ``JobSource.ask``."""
        if not self._asked and not self.over:
            self._asked = True
            self._line.send("want")

    def received(self) -> list[tuple[Job, bool]]:
        """See ``JobSource.received``."""
        jobs = []
        for message in self._line.received():
            self.over = self.over or "end" in message
            if "idle" in message:
                self.idle = True
            if "job" in message:
                self._asked = self.idle = False
                jobs.append(_job(message["job"]))
        return jobs


def _job(given: Mapping[str, Any]) -> tuple[Job, bool]:
    spec = EpisodeSpec.from_json(given["spec"])
    tries, first = int(given["tries"]), int(given["first_attempt"])
    return Job(spec, str(given["episode_id"]), tries, first), bool(given["recorded"])


def _with_card(config: Config) -> Config:
    """The configuration, with the graphics card that Ray has allotted to this slot."""
    card, server = os.environ.get(CARD_VARIABLE), config.server
    if card is None or not isinstance(server, CarlaServerConfig):
        return config
    if wanted_card(server.arguments) is not None:
        return config
    document = dump_config(config)
    document["server"]["arguments"] = [*server.arguments, f"{ADAPTER_OPTION}{card}"]
    return check_config(document)


def _work(line: SlotLine, setup: Mapping[str, Any], interruption: Interruption) -> None:
    """Record what the run hands out, until it says that this is all."""
    config = _with_card(check_config(setup["config"]))
    folder = SlotFolder(line, setup)

    def tell(event: RunEvent) -> None:
        if isinstance(event, Notice):
            line.send("notice", sentence=event.sentence)

    path = sys.executable if setup["client"] == _OWN_PYTHON else setup["client"]
    ports = PortRange().share(int(setup["number"]), int(setup["count"]))
    store = open_store(setup["dataset"])
    record = RunRecord(folder, interruption, tell)
    server_setup = _SlotServer(
        record,
        config,
        partial(make_server, ports=ports),
        ClientPython(Path(path), setup["client_version"]),
    )
    patience = partial(interruption.left_before_s, ANSWER_S)
    with store.within(patience), WakeupPipe() as wakeup:
        line.notifies(wakeup.notify)
        try:
            session = Session(
                config,
                server_setup,
                store,
                record,
                interruption,
                wakeup,
                int(setup["retries"]),
                setup["environment"],
                InlineExecutor(),
                _Jobs(line),
                folder.self_test,
            )
            session.run(EpisodePlan.empty(), EpisodePlan.empty())
        finally:
            line.notifies(lambda: None)
            with suppress(OSError):  # a failed self-test's recording is kept
                folder.self_test.rmdir()


def main() -> int:
    """Be a slot; returns the exit status."""
    line = SlotLine()
    with Interruption(end_s=_END_S) as interruption:
        setup = line.next()["setup"]
        try:
            _work(line, setup, interruption)
        except WorkerLostError:
            return EXIT_CODE  # nobody is left to be told
        except CarStageError as error:
            line.send_error(error)
            return error.exit_code
        return EXIT_CODE if interruption.requested else 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # the thread that reads the line may be in the middle of it
