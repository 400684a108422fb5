"""Open every disk that a power cut may leave of a run, and go on with some of them."""

from __future__ import annotations

import json
import random
import shutil
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from benchmarks.framework.crash_states.calls import Operation, record_calls
from benchmarks.framework.crash_states.disk import VARIANTS, Disk, State
from benchmarks.framework.faults.campaign import (
    CampaignServer,
    record_reference,
    remote_settings,
)
from benchmarks.framework.faults.command import RunCommand
from benchmarks.framework.faults.trial import (
    CONFIG,
    Hashes,
    Trial,
    hashes_of,
    judge_dataset,
    judge_processes,
    last_line,
)
from carstage.bench.verdict import Figure, Verdict
from carstage.dataset import Dataset
from carstage.errors import BadInputError, CarStageError
from carstage.files.hashing import hash_of
from carstage.runs.attempts import left_runs
from carstage.storage import open_store

LEAST_STATES, LEAST_COMPLETIONS = 1000, 150
_EPISODES = 2
_OUT = "new/folders/dataset"
_END_S = 300.0
_PER_STRATUM = 8
_MOST_NOTES = 20


@dataclass(frozen=True, slots=True)
class Crash:
    """A power cut.

    Attributes:
        number: of the last operation that had ended.
        operation: that one.
        variant: what the disk kept of those that were not synced.
        state: what is left.
        known: the episodes that the run had reported as committed.
    """

    number: int
    operation: Operation
    variant: str
    state: State
    known: frozenset[str]

    def __str__(self) -> str:
        return f"{self.variant}, after operation {self.number}: {self.operation}"


def measure_crash_states(
    *,
    completions: int = 160,
    most_states: int | None = None,
    seed: int = 0,
    scratch: Path | None = None,
    notify: Callable[[str], None] = lambda _: None,
) -> tuple[Verdict, list[Trial]]:
    """Record a run's operations on its files, then judge the disks that power cuts leave.

    Args:
        completions: at so many of the states the same command is given again.
        most_states: look at no more states, spread over the whole run; None: at all.
        seed: what is drawn by chance is drawn from it.
        scratch: existing folder for all files, which are kept then; None: a temporary one.
        notify: called with one line per step.

    Raises:
        BadInputError: there is no ``strace``, or it cannot tell what the run does.
        CarStageError: the server does not start, or a run fails that nothing disturbs.
    """
    begun_s = time.monotonic()
    rng = random.Random(seed)
    with ExitStack() as stack:
        folder = scratch or Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="carstage-crash-"))
        )
        server = CampaignServer(folder / "server.log")
        stack.callback(server.stop)
        notify("Recording without strace, for comparison.")
        expected = record_reference(folder / "reference", server.ports())
        notify("Recording under strace.")
        mirror = Mirror(folder / "disk")
        command = _command(folder, mirror.root / _OUT, server.ports())
        operations = record_calls(command, mirror.root, folder / "strace.log")
        _check_recording(operations, mirror, expected)
        notify(f"{len(operations)} operations on files.")
        problems, counts, chosen = _open_states(
            operations, mirror, expected, most_states, rng, notify
        )
        trials = []
        for number, crash in enumerate(_spread(chosen, completions, rng), 1):
            trials.append(_complete(number, crash, mirror, folder, server.ports(), expected))
            notify(f"[{number}/{completions}] {crash}: {'well' if trials[-1].ok else 'WRONG'}")
        wall_s = time.monotonic() - begun_s
    short = most_states is not None
    figures = (
        Figure("operations", len(operations)),
        Figure("different states", sum(counts.values()), ">=", 1 if short else LEAST_STATES),
        *(Figure(f"states: {variant}", counts[variant]) for variant in VARIANTS),
        Figure("states that readers misread", len(problems), "==", 0),
        Figure("states completed", len(trials), ">=", 1 if short else LEAST_COMPLETIONS),
        Figure("kinds of operations before them", len({trial.moment for trial in trials})),
        Figure("completions that went wrong", sum(not trial.ok for trial in trials), "==", 0),
        Figure("wall time (s)", round(wall_s, 1)),
    )
    return Verdict("crash-states", figures, problems[:_MOST_NOTES]), trials


def to_json(trial: Trial) -> dict[str, Any]:
    """A completion for the result file: what is wrong only where something is."""
    return {name: value for name, value in asdict(trial).items() if value not in ([], None)}


class Mirror:
    """A folder that is made to hold one state after the other.

    Args:
        root: the folder; made here.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        root.mkdir()
        self._held: State = {}

    def read(self) -> State:
        """What is in the folder now."""
        return {
            path.relative_to(self.root).as_posix(): None if path.is_dir() else path.read_bytes()
            for path in sorted(self.root.rglob("*"))
        }

    def empty(self) -> None:
        """Remove all that is in the folder."""
        shutil.rmtree(self.root)
        self.root.mkdir()
        self._held = {}

    def hold(self, state: State) -> None:
        """Change the folder, which nobody else has changed, so that it holds a state."""
        for path in sorted(self._held.keys() - state.keys(), reverse=True):
            if self._held[path] is None:
                (self.root / path).rmdir()
            else:
                (self.root / path).unlink()
        for path, content in sorted(state.items()):
            if path in self._held and self._held[path] == content:
                continue
            if content is None:
                (self.root / path).mkdir()
            else:
                (self.root / path).write_bytes(content)
        self._held = state


def _command(folder: Path, out: Path, ports: tuple[int, int]) -> list[str]:
    config = folder / "config.yaml"
    config.write_text(CONFIG, "utf-8")
    settings = [word for setting in _settings(ports) for word in ("--set", setting)]
    command = [sys.executable, "-m", "carstage.cli", "run", str(config), "--out", str(out)]
    return [*command, *settings]


def _settings(ports: tuple[int, int]) -> list[str]:
    return [*remote_settings(ports), f"episodes={_EPISODES}"]


def _check_recording(operations: Sequence[Operation], mirror: Mirror, expected: Hashes) -> None:
    """The operations lead to the very files that lie on the disk; else nothing could be judged."""
    disk = Disk()
    for operation in operations:
        disk.apply(operation)
    there, rebuilt = mirror.read(), disk.state("all written", random.Random(0))
    different = [
        path
        for path in sorted({*there, *rebuilt})
        if (path in there, there.get(path)) != (path in rebuilt, rebuilt.get(path))
    ]
    if different:
        raise BadInputError(
            f"The log of strace leads to other files than there are: {', '.join(different[:5])}.",
            "See what benchmarks.framework.crash_states.calls leaves out.",
        )
    if hashes_of(mirror.root / _OUT) != expected:
        raise CarStageError("The run under strace recorded something else.", "Try it again.")
    mirror.empty()


def _crashes(
    operations: Sequence[Operation], most_states: int | None, rng: random.Random
) -> Iterator[Crash]:
    """All power cuts that leave different disks, or so many spread over the run."""
    disk, seen, reported = Disk(), set(), _reported(operations)
    each = 1
    if most_states is not None:
        each = max(1, len(operations) * len(VARIANTS) // most_states)
    turn = 0
    for number, operation in enumerate(operations):
        disk.apply(operation)
        known = frozenset(episode for episode, first in reported.items() if first <= number)
        for variant in VARIANTS:
            turn += 1
            if turn % each:
                continue
            state = disk.state(variant, rng)
            key = hash((known, frozenset(state.items())))
            if key not in seen:
                seen.add(key)
                yield Crash(number, operation, variant, state, known)


def _open_states(
    operations: Sequence[Operation],
    mirror: Mirror,
    expected: Hashes,
    most_states: int | None,
    rng: random.Random,
    notify: Callable[[str], None],
) -> tuple[list[str], Counter[str], dict[tuple[str, str, str], list[Crash]]]:
    """Let readers open each state.

    Returns:
        What was wrong, the number of states by variant, and some states by variant and by kind
        and place of the operation before.
    """
    problems: list[str] = []
    counts: Counter[str] = Counter()
    chosen: dict[tuple[str, str, str], list[Crash]] = defaultdict(list)
    for crash in _crashes(operations, most_states, rng):
        counts[crash.variant] += 1
        mirror.hold(crash.state)
        found = _misread(mirror.root / _OUT, crash.known, expected)
        problems += [f"{crash}: {problem}" for problem in found]
        some = chosen[crash.variant, crash.operation.kind, crash.operation.place]
        if len(some) < _PER_STRATUM:
            some.append(crash)
        elif rng.random() < 0.1:
            some[rng.randrange(_PER_STRATUM)] = crash
        if sum(counts.values()) % 1000 == 0:
            notify(f"{sum(counts.values())} states, operation {crash.number}.")
    mirror.empty()
    return problems, counts, chosen


def _reported(operations: Sequence[Operation]) -> dict[str, int]:
    """The operation by which the run says that an episode is in the dataset, by its id."""
    found: dict[str, int] = {}
    for number, operation in enumerate(operations):
        if operation.kind == "write" and operation.path.endswith("/events.jsonl"):
            for line in operation.data.splitlines():
                if b'"episode_committed"' in line:
                    found.setdefault(json.loads(line)["episode_id"], number)
    return found


def _misread(out: Path, known: frozenset[str], expected: Hashes) -> list[str]:
    """What is wrong with what readers see of a dataset.

    Args:
        out: its folder, which may be missing.
        known: episodes that the run has reported as committed.
        expected: what the episodes must be.
    """
    found = []
    try:
        markers = open_store(out).committed() if out.is_dir() else {}
        for episode in sorted(known - markers.keys()):
            found.append(f"{episode} was reported and is lost")
        for episode, marker in markers.items():
            folder = out / "episodes" / episode / marker.attempt
            files = {entry.path: entry.hash for entry in marker.files}
            if files != expected[episode]:
                found.append(f"{episode} has another marker")
            for path, named in files.items():
                file = folder / path
                if not file.is_file() or hash_of(file.read_bytes()) != named:
                    found.append(f"{episode}: {path} is missing or not whole")
        if (out / "dataset.json").exists():
            found += _differently_listed(Dataset(out), markers)
        elif markers:
            found.append("there are episodes, and no dataset")
        for run in left_runs(out, open_store(out)):
            str(run.describe)
    except Exception as error:  # noqa: BLE001 - whatever a reader raises is a finding
        found.append(f"{type(error).__name__}: {error}")
    return found


def _differently_listed(dataset: Dataset, markers: Mapping[str, object]) -> Iterator[str]:
    if {episode.id for episode in dataset.episodes} != set(markers):
        yield "the dataset lists other episodes than it has markers"
    for episode in dataset.episodes:
        if sum(1 for _ in episode.iter_frames()) != episode.frames:
            yield f"{episode.id} has other frames than its marker says"


def _spread(
    chosen: Mapping[tuple[str, str, str], list[Crash]], count: int, rng: random.Random
) -> list[Crash]:
    """So many states: of each kind of operation and variant one before any has two."""
    left = {key: rng.sample(some, len(some)) for key, some in sorted(chosen.items())}
    found: list[Crash] = []
    while len(found) < count and left:
        for key in rng.sample(sorted(left), len(left)):
            found.append(left[key].pop())
            if not left[key]:
                del left[key]
    return found[:count]


def _complete(
    number: int,
    crash: Crash,
    mirror: Mirror,
    folder: Path,
    ports: tuple[int, int],
    expected: Hashes,
) -> Trial:
    """Give the same command again at a state, and judge what comes of it."""
    kind = f"{crash.operation.kind} {crash.operation.place}"
    trial = Trial(number, crash.variant, detail=str(crash), moment=kind, struck=True)
    begun_s = time.monotonic()
    mirror.hold(crash.state)
    out = mirror.root / _OUT
    log = folder / "again.log"
    with RunCommand(folder / "config.yaml", out, _settings(ports), log, {}) as run:
        trial.exit_code = run.wait(_END_S)
        trial.resumed = trial.exit_code == 0
        if not trial.resumed:
            trial.unclear.append(f"the same command again: {last_line(run.output)}")
    judge_processes(trial, out)
    judge_dataset(trial, out, _EPISODES, expected)
    trial.wall_s = round(time.monotonic() - begun_s, 1)
    mirror.empty()
    return trial
