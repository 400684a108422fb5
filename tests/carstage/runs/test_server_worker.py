"""What a worker does about servers and collectors that fail; a script stands for the collector.

The script prints the events of a collector; so each way to end is met at once, without a server.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, ClassVar

import pytest

from carstage.config import Config, check_config
from carstage.errors import CarStageError, DiskFullError, ServerEndedError, ServerError
from carstage.plan import ServerFacts, plan_episodes
from carstage.runs.attempt_commit import Job
from carstage.runs.folder import RunFolder
from carstage.runs.interruption import Interruption
from carstage.runs.server_worker import ServerWorker
from carstage.runs.servers import ServerSetup
from carstage.server import Endpoint, Server, describe_embedded, free_port

RECORDED = {"event": "episode_recorded", "ticks": 10, "incomplete": 0}


class Servers:
    """Makes servers of which only the starting and ending is real, and counts."""

    def __init__(self, *, fail_starts: Sequence[CarStageError] = ()) -> None:
        self.failures = list(fail_starts)
        self.calls: list[str] = []

    def make(self, config: Config, log_path: Path | None) -> Server:
        del config, log_path
        return CountedServer(self)


class CountedServer(Server):
    kind: ClassVar[str] = "counted"

    def __init__(self, all_servers: Servers) -> None:
        super().__init__()
        self._all = all_servers

    def start(self) -> Endpoint:
        if self._all.failures:
            raise self._all.failures.pop(0)
        self._all.calls.append("start")
        self._endpoint = Endpoint("127.0.0.1", free_port(), free_port(), "0.9.16", None)
        return self._endpoint

    def stop(self) -> None:
        if self._endpoint is not None:
            self._all.calls.append("stop")
        self._endpoint = None

    def alive(self) -> bool:
        return self._endpoint is not None

    def log_tail(self, lines: int = 20) -> str:
        return "last words of the server"


class RecordedLanding:
    """Stands for an attempt on its way; remembers that it was given up."""

    def __init__(self, job: Job, folder: Path) -> None:
        self.job = job
        self.attempt = "a1"
        self.raw_folder = folder
        self.given_up = False
        self.gnss = {"projection": "transverse_mercator", "north": "+y"}

    def segment_sealed(self, stream: str, segment: int) -> None:
        del stream, segment

    def give_up(self) -> None:
        self.given_up = True


class Host:
    """The run, as a worker knows it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.events: list[str] = []
        self.landings: list[RecordedLanding] = []
        self.failures: list[tuple[CarStageError, bool]] = []
        self.incomplete: list[int] = []
        self.accepts = True
        self.retries = 1

    def begin(self, job: Job) -> RecordedLanding:
        self.landings.append(RecordedLanding(job, self._folder / "raw"))
        return self.landings[-1]

    def on_event(self, event: Mapping[str, Any]) -> None:
        self.events.append(str(event["event"]))

    def poll(self) -> None:
        pass

    def waiting(self, what: str) -> AbstractContextManager[None]:
        del what
        return nullcontext()

    def start_failed(self, job: Job, error: CarStageError) -> bool:
        self.events.append("start_failed")
        return job.tries < self.retries

    def recorded(self, attempt_commit: RecordedLanding, incomplete_ticks: int) -> bool:
        del attempt_commit
        self.incomplete.append(incomplete_ticks)
        return self.accepts

    def attempt_failed(
        self, attempt_commit: RecordedLanding, error: CarStageError, *, final: bool
    ) -> None:
        del attempt_commit
        self.failures.append((error, final))


@pytest.fixture(scope="module")
def job() -> Job:
    described = describe_embedded()
    facts = ServerFacts(maps=described.maps, blueprints={}, dialect=described.protocol)
    (spec,) = plan_episodes(check_config({"pedestrians": {"count": 0}}), facts)
    return Job(spec, spec.episode_id)


Record = Callable[..., tuple[Host, Servers]]


@pytest.fixture
def record(job: Job, tmp_path: Path) -> Iterator[Record]:
    """Records attempts one after the other, each with a collector that says and ends as given."""

    def run(
        *attempts: tuple[Sequence[Mapping[str, Any]], str],
        settings: Mapping[str, Any] | None = None,
        servers: Servers | None = None,
        accepts: bool = True,
        interpreter: str | None = None,
    ) -> tuple[Host, Servers]:
        servers = servers or Servers()
        host = Host(tmp_path)
        host.accepts = accepts
        config = check_config(dict(settings or {}))
        with RunFolder(tmp_path) as folder, Interruption() as interruption:
            python = tmp_path / "python"
            worker = ServerWorker(
                ServerSetup(config, servers.make),
                host,  # type: ignore[arg-type]
                folder,
                interruption,
                python=interpreter or str(python),
            )
            with worker:
                for said, end in attempts:
                    lines = "".join(json.dumps({"time": 0.0, **event}) + "\n" for event in said)
                    python.write_text(
                        f"#!{sys.executable}\nimport os, signal, sys, time\n"
                        f"sys.stdout.write({lines!r}); sys.stdout.flush()\n{end}\n"
                    )
                    python.chmod(0o755)
                    worker.record(job)
        return host, servers

    return run


def test_server_serves_one_episode_after_the_other(record: Record) -> None:
    host, servers = record(*[([RECORDED], "")] * 3)
    assert servers.calls == ["start", "stop"]
    assert host.incomplete == [0, 0, 0]
    assert host.failures == []


def test_a_collector_is_started_before_the_server_is_up(record: Record, tmp_path: Path) -> None:
    told = tmp_path / "told"

    class Slow(Servers):
        """Servers that are made once a collector has told how it was started."""

        def make(self, config: Config, log_path: Path | None) -> Server:
            deadline_s = time.monotonic() + 30.0
            while not told.exists():
                assert time.monotonic() < deadline_s
                time.sleep(0.01)
            return super().make(config, log_path)

    tell = f"open({str(told)!r}, 'a').write(sys.argv[3] + chr(10))"
    host, _ = record(([RECORDED], tell), ([RECORDED], tell), servers=Slow())
    assert host.incomplete == [0, 0]
    first, *others = told.read_text().splitlines()
    assert first == "-"  # its plan comes later
    # The script may end before it is given its plan, and is replaced then.
    assert len(others) in {1, 2}
    assert all(Path(other).name.startswith("collector-plan-") for other in others)


def test_server_is_replaced_after_as_many_episodes_as_the_user_says(record: Record) -> None:
    settings = {"server": {"kind": "embedded", "restart_every": 2}}
    host, servers = record(*[([RECORDED], "")] * 5, settings=settings)
    assert servers.calls == ["start", "stop"] * 3
    assert host.events.count("server_started") == 3


def test_attempt_that_broke_off_is_followed_by_a_fresh_server(record: Record) -> None:
    killed = ([], "os.kill(os.getpid(), signal.SIGKILL)")
    host, servers = record(killed, ([RECORDED], ""))
    assert servers.calls == ["start", "stop"] * 2
    ((error, final),) = host.failures
    assert "ended by SIGKILL" in error.message
    assert not final
    assert [attempt_commit.given_up for attempt_commit in host.landings] == [True, False]


def test_error_of_the_collector_carries_the_servers_last_lines(record: Record) -> None:
    said = {"event": "error", "kind": "client", "message": "time-out of 20000ms", "hint": "Look."}
    host, _ = record(([said], "sys.exit(1)"))
    ((error, final),) = host.failures
    assert error.message.startswith("time-out of 20000ms (episode ")
    assert "last words of the server" in error.hint
    assert not final


@pytest.mark.parametrize("kind", ["plan", "scene", "version"])
def test_refusal_is_final_and_says_nothing_against_the_server(record: Record, kind: str) -> None:
    said = {"event": "error", "kind": kind, "message": "no such blueprint", "hint": ""}
    host, servers = record(([said], "sys.exit(1)"), ([RECORDED], ""))
    assert host.failures[0][1]
    assert servers.calls == ["start", "stop"]


def test_interpreter_that_cannot_be_started_is_named_and_not_tried_again(record: Record) -> None:
    host, servers = record(([RECORDED], ""), interpreter="/nowhere/python")
    ((error, final),) = host.failures
    assert "/nowhere/python" in error.message
    assert "server.client_python" in error.hint
    assert final
    assert servers.calls == ["start", "stop"]


def test_full_disk_is_told_apart_and_says_nothing_against_the_server(record: Record) -> None:
    said = {"event": "error", "kind": "disk", "message": "Writing the raw log failed", "hint": ""}
    host, servers = record(([said], "sys.exit(1)"), ([RECORDED], ""))
    assert isinstance(host.failures[0][0], DiskFullError)
    assert servers.calls == ["start", "stop"]


def test_recording_with_gaps_that_is_not_accepted_gets_a_fresh_server(record: Record) -> None:
    gaps = ([{**RECORDED, "incomplete": 3}], "")
    host, servers = record(gaps, gaps, accepts=False)
    assert host.incomplete == [3, 3]
    assert servers.calls == ["start", "stop"] * 2


def test_collector_that_holds_too_much_memory_is_ended_and_the_setting_named(
    record: Record,
) -> None:
    settings = {"supervision": {"collector_memory": 64}}
    greedy = ([], "held = bytearray(90_000_000)\ntime.sleep(120)")
    host, _ = record(greedy, settings=settings)
    ((error, _),) = host.failures
    assert "64 MB are its limit" in error.message
    assert "supervision.collector_memory" in error.hint


def test_silent_server_is_given_up_with_its_last_lines(record: Record) -> None:
    settings = {"supervision": {"hang_s": 2.0}}
    host, servers = record(([], "time.sleep(120)"), settings=settings)
    ((error, _),) = host.failures
    assert isinstance(error, ServerError)
    assert "has not answered" in error.message
    assert "last words of the server" in error.hint
    assert servers.calls == ["start", "stop"]


def test_long_patience_holds_for_the_collector_too(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("carstage.runs.server_worker._STALL_S", 0.0)
    settings = {"supervision": {"hang_s": 900.0}}
    host, _ = record(([RECORDED], "time.sleep(0.5)"), settings=settings)
    assert host.failures == []


def test_loading_a_map_may_take_longer_than_another_call(record: Record, tmp_path: Path) -> None:
    record(([RECORDED], ""), settings={"supervision": {"hang_s": 30.0}})
    (path,) = tmp_path.glob("runs/*/logs/collector-plan-*.json")
    server = json.loads(path.read_bytes())["server"]
    assert server["load_timeout_s"] == 300.0
    assert 30.0 < server["timeout_s"] < 300.0


def test_server_that_ends_while_it_starts_is_started_once_more(record: Record) -> None:
    host, servers = record(
        ([RECORDED], ""), servers=Servers(fail_starts=[ServerEndedError("It ended.")])
    )
    assert host.events[:2] == ["server_lost", "server_started"]
    assert servers.calls == ["start", "stop"]


@pytest.mark.parametrize(
    "failures",
    [
        [ServerEndedError("It ended.")] * 2,
        [ServerEndedError("It ended.", status=1)] * 2,
        [ServerError("It was not ready after 180 s.")],
    ],
)
def test_server_that_cannot_be_started_ends_the_run(
    record: Record, failures: list[CarStageError]
) -> None:
    with pytest.raises(ServerError):
        record(([RECORDED], ""), servers=Servers(fail_starts=failures))


def test_server_that_is_killed_again_and_again_while_it_starts_counts_as_a_retry(
    record: Record,
) -> None:
    killed = [ServerEndedError("It ended.", status=-9)] * 2
    host, servers = record(([RECORDED], ""), ([RECORDED], ""), servers=Servers(fail_starts=killed))
    assert host.events[:3] == ["server_lost", "start_failed", "server_started"]
    assert host.incomplete == [0]
    assert servers.calls == ["start", "stop"]
