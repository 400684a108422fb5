"""Two hosts that record into one folder, held still, killed and started anew by chance.

A host is a mount and a PID namespace of its own; in half of the schedules it has another boot id
and machine id, too, as another machine has. What a run cannot see there it must not take for dead.
In each schedule both hosts run the same command. At drawn moments all processes of a host stop as
by SIGSTOP and go on later, as a laptop that sleeps, or are killed and the host begins again. Runs
are taken for silent after a second instead of a minute, so that the other host takes over at once.

At the end every episode must have been committed exactly once, with all its files and the bytes of
a run that nobody disturbed. Whoever was not killed must have ended well.
"""

from __future__ import annotations

import json
import random
import secrets
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from benchmarks.framework.faults.command import Moment
from benchmarks.framework.faults.trial import CONFIG, Hashes, hashes_of
from carstage.bench.verdict import Figure, Verdict
from carstage.errors import BadInputError
from carstage.files.hashing import hash_of_file

SCHEDULES = 50
_STEPS = 10
_EPISODES = 2
_POLL_S = 0.02
_PATIENCE_S = 600.0
_PROGRAM = (
    "import sys, carstage.runs.reading as reading; reading.RESTED_S = 1.0;"
    "from carstage.cli import main; main()"
)
_NAMESPACES = ("unshare", "--pid", "--mount", "--fork", "--kill-child", "--mount-proc")


@dataclass(slots=True)
class Disturbance:
    """What happens to a host.

    Attributes:
        moment: when, in the life of its run.
        kill: whether it is killed, else held still.
        away_s: how long it is gone.
    """

    moment: Moment
    kill: bool
    away_s: float

    def __str__(self) -> str:
        return f"{'killed' if self.kill else 'held'} at {self.moment} for {self.away_s:.1f} s"


@dataclass(slots=True)
class Host:
    """A host, the runs that it has begun, and what is to happen to it.

    Attributes:
        other_machine: it has another boot id and machine id.
        starts_s: when it begins, after the first one.
        disturbances: in this order; each is of the run that goes on then.
        runs: ids of its runs.
        failures: runs that ended by themselves, and not well.
        back_s: when it goes on, while it is away.
        due_s: when the next disturbance strikes, once its event has come.
    """

    name: str
    other_machine: bool
    starts_s: float
    disturbances: list[Disturbance]
    runs: list[str] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    done: bool = False
    process: subprocess.Popen[bytes] | None = None
    back_s: float | None = None
    due_s: float | None = None

    def begin(self, config: Path, out: Path) -> None:
        """Start its run."""
        run_id = f"{self.name}-{len(self.runs)}"
        self.runs.append(run_id)
        command = [sys.executable, "-c", _PROGRAM, "run", str(config), "--out", str(out)]
        script = 'exec "$@"'
        if self.other_machine:
            folder = config.parent / self.name
            folder.mkdir(exist_ok=True)
            ids = {"boot": "/proc/sys/kernel/random/boot_id", "machine": "/etc/machine-id"}
            for name in ids:
                if not (folder / name).exists():
                    (folder / name).write_text(secrets.token_hex(16) + "\n")
            binds = [f"mount --bind '{folder / name}' {there}" for name, there in ids.items()]
            script = " && ".join([*binds, script])
        with (config.parent / f"{run_id}.log").open("wb") as log:
            self.process = subprocess.Popen(
                [*_NAMESPACES, "sh", "-c", script, "sh", *command, "--run-id", run_id],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def family(self) -> Iterator[psutil.Process]:
        """All its processes but the one that made the namespaces."""
        assert self.process is not None
        with suppress(psutil.Error):
            yield from psutil.Process(self.process.pid).children(recursive=True)

    def send(self, number: signal.Signals) -> None:
        """Send a signal to all its processes."""
        for process in self.family():
            with suppress(psutil.Error):
                process.send_signal(number)

    def kill(self) -> None:
        """Kill the first process of its PID namespace, and with it all."""
        if self.process is not None and self.process.poll() is None:
            self.process.kill()  # --kill-child takes the namespace with it
            self.process.wait()


def draw_schedule(rng: random.Random) -> list[Host]:
    """Two hosts and what happens to them."""
    other_machine = rng.random() < 0.5
    hosts = []
    for name in ("a", "b"):
        count = rng.choice((1, 1, 2)) if name == "a" else rng.choice((0, 1, 1))
        hosts.append(
            Host(
                name,
                other_machine,
                rng.uniform(0, 6) if name == "b" else 0.0,
                [
                    Disturbance(_draw_moment(rng), rng.random() < 0.4, rng.uniform(0.5, 12))
                    for _ in range(count)
                ],
            )
        )
    return hosts


def _draw_moment(rng: random.Random) -> Moment:
    return rng.choice(
        (
            Moment("attempt_reserved", rng.randint(1, _EPISODES), rng.uniform(0, 2)),
            Moment("tick", rng.randint(1, _STEPS * _EPISODES)),
            Moment("segment_sealed", rng.randint(1, 12), rng.uniform(0, 0.1)),
            # Between the last frame and the marker.
            Moment("episode_recorded", rng.randint(1, _EPISODES), rng.uniform(0, 0.4)),
            Moment("episode_committed", 1, rng.uniform(0, 0.1)),
        )
    )


def measure_two_hosts(
    schedules: int = SCHEDULES,
    seed: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Verdict:
    """Play schedules and judge what came of each.

    Args:
        schedules: how many.
        seed: what they are drawn from.
        progress: called with the schedules done and their total number.

    Raises:
        BadInputError: this user may not make namespaces.
    """
    if subprocess.run([*_NAMESPACES, "true"], capture_output=True, check=False).returncode:
        raise BadInputError("This user may not make PID and mount namespaces.", "Try it as root.")
    rng = random.Random(seed)
    wrong: dict[str, int] = dict.fromkeys(
        ("episodes_that_differ", "files_not_there", "runs_that_failed", "left_behind"), 0
    )
    held = killed = attempts = races = 0
    notes: list[str] = []
    with tempfile.TemporaryDirectory(prefix="carstage-two-hosts-") as name:
        scratch = Path(name)
        expected = _reference(scratch)
        for number in range(schedules):
            folder = scratch / str(number)
            folder.mkdir()
            hosts = draw_schedule(rng)
            struck = _play(hosts, folder)
            held += sum(not one.kill for one in struck)
            killed += sum(one.kill for one in struck)
            for run in folder.glob("dataset/runs/*"):
                attempts += _count(run, "attempt_reserved")
                races += _count(run, "episode_skipped", '"attempt": "a')
            found = _judge(folder, hosts, expected)
            for key, entries in found.items():
                wrong[key] += len(entries)
                notes += [f"schedule {number}: {key}: {entry}" for entry in entries[:3]]
            if any(found.values()):
                notes.append(f"schedule {number}: " + "; ".join(map(str, struck)))
            progress(number + 1, schedules)
    return Verdict(
        "two-hosts",
        (
            Figure("schedules", schedules, ">=", 1),
            Figure("hosts_held_still", held, ">=", 1),
            Figure("hosts_killed", killed),
            Figure("attempts_begun", attempts),
            Figure("attempts_that_came_second", races),
            *(Figure(name, count, "==", 0) for name, count in wrong.items()),
        ),
        notes,
    )


def _reference(scratch: Path) -> Hashes:
    folder = scratch / "reference"
    folder.mkdir()
    (host,) = [Host("calm", False, 0.0, [])]
    _play([host], folder)
    expected = hashes_of(folder / "dataset")
    if len(expected) != _EPISODES:
        raise BadInputError("The run that nobody disturbs fails.", _tail(folder / "calm-0.log"))
    return expected


def _play(hosts: Sequence[Host], folder: Path) -> list[Disturbance]:
    """Run both hosts to their ends; returns what could be done to them."""
    config, out = folder / "config.yaml", folder / "dataset"
    config.write_text(CONFIG)
    began_s = time.monotonic()
    struck = []
    pause = threading.Event()
    try:
        while not all(host.done for host in hosts):
            now_s = time.monotonic() - began_s
            if now_s > _PATIENCE_S:
                for host in hosts:
                    if not host.done:
                        host.failures.append(f"{host.runs[-1]} did not end")
                break
            for host in hosts:
                if not host.done:
                    struck += _step(host, now_s, config, out)
            pause.wait(_POLL_S)
    finally:
        for host in hosts:
            host.kill()
    return struck


def _step(host: Host, now_s: float, config: Path, out: Path) -> list[Disturbance]:
    """Do what is due for a host; returns the disturbance that struck."""
    if host.process is None:
        if now_s >= max(host.starts_s, host.back_s or 0.0):
            host.begin(config, out)
        return []
    if host.back_s is not None:
        if now_s < host.back_s:
            return []
        host.back_s = None
        host.send(signal.SIGCONT)
    code = host.process.poll()
    if code is not None:
        host.done = True
        if code:
            host.failures.append(
                f"{host.runs[-1]}: {_tail(config.parent / f'{host.runs[-1]}.log')}"
            )
        return []
    if not host.disturbances:
        return []
    disturbance = host.disturbances[0]
    if _count(out / "runs" / host.runs[-1], disturbance.moment.event) < disturbance.moment.nth:
        return []
    if host.due_s is None:
        host.due_s = now_s + disturbance.moment.after_s
    if now_s < host.due_s:
        return []
    host.due_s = None
    del host.disturbances[0]
    host.back_s = now_s + disturbance.away_s
    if disturbance.kill:
        host.kill()
        host.process = None
    else:
        host.send(signal.SIGSTOP)
    return [disturbance]


def _judge(folder: Path, hosts: Sequence[Host], expected: Hashes) -> dict[str, list[str]]:
    """What is wrong in a folder, after the command has ended well there once more, and again."""
    out = folder / "dataset"
    failures = [failure for host in hosts for failure in host.failures]
    last = Host("last", False, 0.0, [])
    for _ in range(2):  # the second one clears up after what the first one committed
        last.done, last.process = False, None
        _play([last], folder)
    failures += last.failures
    found = hashes_of(out)
    differ = [name for name in sorted({*found, *expected}) if found.get(name) != expected.get(name)]
    missing = []
    markers = {
        path.stem: json.loads(path.read_bytes())["attempt"]
        for path in (out / "commits").glob("*.json")
    }
    for episode, files in found.items():
        for path, named in files.items():
            try:
                with (out / "episodes" / episode / markers[episode] / path).open("rb") as file:
                    same = hash_of_file(file, named)[0] == named
            except OSError:
                same = False
            if not same:
                missing.append(f"{episode}/{path}")
    left = [
        str(path.relative_to(out))
        for path in sorted(out.glob("episodes/*/*"))
        if markers.get(path.parent.name) != path.name
    ]
    left += [str(path.relative_to(out)) for path in sorted(out.glob("runs/*/raw/*/*"))]
    return {
        "episodes_that_differ": differ,
        "files_not_there": missing,
        "runs_that_failed": failures,
        "left_behind": left,
    }


def _count(run: Path, event: str, also: str = "") -> int:
    """The events of that name which hold a further text."""
    try:
        lines = (run / "events.jsonl").read_text("utf-8", "replace").splitlines()
    except OSError:
        return 0
    return sum(f'"event": "{event}"' in line and also in line for line in lines)


def _tail(log: Path) -> str:
    return log.read_text("utf-8", "replace").strip()[-300:] if log.exists() else ""
