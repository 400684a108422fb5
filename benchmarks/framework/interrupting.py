"""How fast a run ends when it is asked to, on a machine that has much else to do.

Each trial starts a run while processes that only count keep every core busy, sends it SIGINT,
SIGTERM or SIGHUP at a moment drawn by chance, and takes the time until its process is gone. Then
the same command runs on a calm machine. Every episode must be there with the bytes of a run that
nobody interrupted, and none that was wholly recorded may be recorded again.
"""

from __future__ import annotations

import os
import random
import signal
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.framework.busy_machine import busy_processes
from benchmarks.framework.faults.command import Moment, RunCommand
from benchmarks.framework.faults.trial import hashes_of
from carstage.bench.verdict import Figure, Verdict
from carstage.runs.interruption import END_S

TRIALS = 30
PER_CORE = 3
EPISODES = 2
_STEPS = 10
_MOMENT_S = 900.0
_END_S = 300.0
_COMPLETE_S = 900.0
_COLD_EVERY = 4
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

SIZE = (640, 360)

CONFIG = f"""\
name: interrupting
seed: 5
episodes: {EPISODES}
duration_s: {_STEPS / 10}
vehicles: {{count: 4}}
pedestrians: {{count: 4}}
rig: {{preset: demo}}
"""


def draw_moment(random_source: random.Random) -> Moment:
    """A moment of the life of a run, each part of it as probable as the others."""
    draw = random_source.uniform
    return random_source.choice(
        (
            Moment("run_started", 1, draw(0, 5)),
            Moment("attempt_reserved", random_source.randint(1, EPISODES), draw(0, 8)),
            Moment("tick", random_source.randint(1, EPISODES * _STEPS)),
            Moment("episode_recorded", random_source.randint(1, EPISODES), draw(0, 0.5)),
            Moment("episode_committed", 1, draw(0, 2)),
        )
    )


def measure_interrupting(
    trials: int = TRIALS,
    per_core: int = PER_CORE,
    seed: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
    *,
    size: tuple[int, int] = SIZE,
) -> Verdict:
    """Interrupt runs under load, and let each complete on a calm machine.

    Args:
        trials: runs that are interrupted; every fourth one begins with empty caches.
        per_core: busy processes for each core that this process may use.
        seed: of the moments.
        progress: called with the trials done and their total number.
        size: width and height of their pictures (px).
    """
    random_source = random.Random(seed)
    count = per_core * len(os.sched_getaffinity(0))
    ends_s: list[float] = []
    lost = differing = unfinished = waiting = 0
    notes: list[str] = []
    with tempfile.TemporaryDirectory(prefix="carstage-interrupting-") as name:
        scratch = Path(name)
        config = scratch / "config.yaml"
        config.write_text(f"{CONFIG}image_size: {list(size)}\n")
        calm = scratch / "calm"
        _complete(config, calm, scratch / "calm.log")
        expected = hashes_of(calm)
        for number in range(trials):
            out = scratch / str(number)
            cold = number % _COLD_EVERY == _COLD_EVERY - 1
            moment = draw_moment(random_source)
            if cold:  # in the middle of what is computed once on a machine
                moment = Moment("run_started", 1, random_source.uniform(0, 60))
            sent = _SIGNALS[number % len(_SIGNALS)]
            caches = {"CARSTAGE_CACHE_DIR": str(scratch / f"cache-{number}")} if cold else {}
            log = scratch / f"{number}.log"
            with busy_processes(count), RunCommand(config, out, (), log, caches) as command:
                if not command.wait_for(moment, _MOMENT_S):
                    notes.append(f"trial {number}: no moment {moment}")
                    continue
                command.process.send_signal(sent)
                began_s = time.monotonic()
                code = command.wait(_END_S)
                ends_s.append(time.monotonic() - began_s)
                recorded = {e["episode_id"] for e in command.events("episode_recorded")}
            what = f"trial {number}: {sent.name} at {moment}{', cold' if cold else ''}"
            notes.append(f"{what}: {ends_s[-1]:.1f} s, {len(recorded)} recorded, exit code {code}")
            waiting += len(list(out.glob("runs/*/raw/*/*/pending.json")))
            again = _complete(config, out, scratch / f"{number}-again.log")
            unfinished += again is None
            lost += len(recorded & (again or set()))
            others = [n for n, f in expected.items() if hashes_of(out).get(n) != f]
            differing += len(others)
            progress(number + 1, trials)
    return Verdict(
        "interrupting",
        (
            Figure("interrupted_runs", len(ends_s), ">=", 1),
            Figure("busy_processes", count, ">=", 1),
            Figure("slowest_end_s", max(ends_s, default=0.0), "<=", END_S),
            Figure("median_end_s", sorted(ends_s)[len(ends_s) // 2] if ends_s else 0.0),
            Figure("recorded_episodes_that_waited", waiting),
            Figure("recorded_episodes_recorded_again", lost, "==", 0),
            Figure("runs_not_completed", unfinished, "==", 0),
            Figure("episodes_that_differ", differing, "==", 0),
        ),
        notes,
    )


def _complete(config: Path, out: Path, log: Path) -> set[str] | None:
    """Run the command to its end; the ids of the episodes that it recorded, None if it failed."""
    environment: Mapping[str, str] = {}
    with RunCommand(config, out, (), log, environment) as command:
        code = command.wait(_COMPLETE_S)
        recorded = {event["episode_id"] for event in command.events("episode_recorded")}
    return recorded if code == 0 else None
