"""A campaign: faults drawn from a seed, one after the other, beside one server for all."""

from __future__ import annotations

import json
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from datetime import timedelta
from pathlib import Path
from typing import Any

from benchmarks.framework.faults.command import RunCommand
from benchmarks.framework.faults.io_errors import RUN_ID, IoError, survey
from benchmarks.framework.faults.kinds import FAULTS, Fault
from benchmarks.framework.faults.trial import CONFIG, Hashes, Trial, hashes_of, run_trial
from carstage.bench.verdict import Figure, Verdict
from carstage.errors import BadInputError, CarStageError
from carstage.server import EmbeddedServer, allot_ports

_REFERENCE_S = 600.0
_JOURNAL = "trials.jsonl"


def draw_faults(count: int, seed: int, kinds: Sequence[str] = ()) -> list[Fault]:
    """Draw faults; each kind comes once before any comes again.

    The n-th fault of a seed does not depend on ``count``.

    Raises:
        BadInputError: there is no such kind.
    """
    for kind in kinds:
        if kind not in FAULTS:
            raise BadInputError(f"There is no fault {kind!r}.", f"Known: {', '.join(FAULTS)}.")
    rng = random.Random(seed)
    faults: list[Fault] = []
    while len(faults) < count:
        names = list(kinds or FAULTS)
        rng.shuffle(names)
        faults += [FAULTS[name](random.Random(rng.getrandbits(64))) for name in names]
    return faults[:count]


def run_campaign(
    *,
    count: int,
    seed: int,
    kinds: Sequence[str] = (),
    scratch: Path | None = None,
    minutes: float | None = None,
    notify: Callable[[str], None] = lambda _: None,
) -> tuple[Verdict, list[Trial]]:
    """Run faults and judge what came of each.

    Args:
        count: how many.
        seed: what they are drawn from.
        kinds: only these; empty: all.
        scratch: existing folder for the trials, which are kept then; None: a temporary one, in
            which trials that went well are removed at once.
        minutes: begin no further trial after that time.
        notify: called with one line per trial.

    Raises:
        CarStageError: the server does not start, or the run without a fault fails.
    """
    faults = draw_faults(count, seed, kinds)
    return _play(lambda folder, ports: faults, scratch, minutes, notify)


def run_io_errors(
    *,
    count: int,
    seed: int,
    scratch: Path | None = None,
    minutes: float | None = None,
    notify: Callable[[str], None] = lambda _: None,
) -> tuple[Verdict, list[Trial]]:
    """Give errors of the system to single calls of runs; see :func:`run_campaign`.

    Raises:
        BadInputError: there is no ``strace``.
        CarStageError: the server does not start, or the run without a fault fails.
    """

    def draw(folder: Path, ports: tuple[int, int]) -> list[Fault]:
        notify("Recording under strace, for the calls of a run.")
        config, out = folder / "config.yaml", folder / "survey"
        config.write_text(CONFIG, "utf-8")
        arguments = [word for setting in remote_settings(ports) for word in ("--set", setting)]
        command = [sys.executable, "-m", "carstage.cli", "run", str(config), "--out", str(out)]
        command += [*arguments, "--set", "episodes=1", "--run-id", RUN_ID]
        calls = survey(command, out, folder / "survey.log")
        rng = random.Random(seed)
        return [IoError(random.Random(rng.getrandbits(64)), calls) for _ in range(count)]

    verdict, trials = _play(draw, scratch, minutes, notify)
    return replace(verdict, name="io-errors"), trials


def _play(
    draw: Callable[[Path, tuple[int, int]], Sequence[Fault]],
    scratch: Path | None,
    minutes: float | None,
    notify: Callable[[str], None],
) -> tuple[Verdict, list[Trial]]:
    """Run a trial for each of the faults that are drawn, given a folder and a server's ports."""
    begun_s = time.monotonic()
    trials: list[Trial] = []
    with ExitStack() as stack:
        folder = scratch or Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix="carstage-faults-"))
        )
        server = CampaignServer(folder / "server.log")
        stack.callback(server.stop)
        notify("Recording without a fault, for comparison.")
        expected = record_reference(folder / "reference", server.ports())
        faults = draw(folder, server.ports())
        count = len(faults)
        first_s = time.monotonic()
        for number, fault in enumerate(faults, 1):
            if minutes is not None and time.monotonic() - begun_s > 60.0 * minutes:
                break
            trial_folder = folder / f"{number:04d}-{fault.name}"
            trial = run_trial(number, fault, trial_folder, server.ports(), expected)
            trials.append(trial)
            with (folder / _JOURNAL).open("a", encoding="utf-8") as journal:
                journal.write(json.dumps(asdict(trial)) + "\n")
            if scratch is None and trial.ok:
                shutil.rmtree(trial_folder, ignore_errors=True)
            each_s = (time.monotonic() - first_s) / number
            notify(f"{_line(trial, count)}; {_duration(each_s * (count - number))} left")
        wall_s = time.monotonic() - begun_s
    return judge(trials, wall_s), trials


def judge(trials: Sequence[Trial], wall_s: float) -> Verdict:
    """Count what went wrong; every count has to be 0."""
    unresumed = [trial for trial in trials if not trial.complete and not trial.resumed]
    return Verdict(
        "faults",
        (
            Figure("trials", len(trials), ">=", 1),
            Figure("trials in which the fault struck", sum(trial.struck for trial in trials)),
            Figure("runs that completed at once", sum(trial.complete for trial in trials)),
            Figure(
                "runs that ended and completed with the same command",
                sum(trial.resumed is True for trial in trials),
            ),
            Figure("runs that did not complete with the same command", len(unresumed), "==", 0),
            Figure("ends without a clear error", _sum(trials, "unclear"), "==", 0),
            Figure("committed files that differ", _sum(trials, "differing"), "==", 0),
            Figure("findings of validate", _sum(trials, "invalid"), "==", 0),
            Figure("episodes with ledger rows missing", _sum(trials, "missing_rows"), "==", 0),
            Figure("processes and files left behind", _sum(trials, "left_behind"), "==", 0),
            Figure("wall time (s)", round(wall_s, 1)),
        ),
    )


def table(trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """One row per kind of fault."""
    rows = []
    for name in sorted({trial.fault for trial in trials}, key=_order):
        mine = [trial for trial in trials if trial.fault == name]
        if mine:
            rows.append(
                {
                    "fault": name,
                    "trials": len(mine),
                    "struck": sum(trial.struck for trial in mine),
                    "completed_at_once": sum(trial.complete for trial in mine),
                    "completed_by_the_same_command": sum(trial.resumed is True for trial in mine),
                    "attempts": sum(trial.attempts for trial in mine),
                    "wrong": sum(not trial.ok for trial in mine),
                    "mean_wall_s": round(sum(trial.wall_s for trial in mine) / len(mine), 1),
                }
            )
    return rows


def _order(name: str) -> int:
    return list(FAULTS).index(name) if name in FAULTS else len(FAULTS)


def table_text(trials: Sequence[Trial]) -> str:
    """The table for people, and what went wrong in which trial."""
    lines = [f"{'fault':<16} trials struck  at once  again  attempts  wrong  s each"]
    lines += [
        f"{row['fault']:<16} {row['trials']:>6} {row['struck']:>6} {row['completed_at_once']:>8} "
        f"{row['completed_by_the_same_command']:>6} {row['attempts']:>9} {row['wrong']:>6} "
        f"{row['mean_wall_s']:>7}"
        for row in table(trials)
    ]
    for trial in trials:
        for problem in _problems(trial):
            lines.append(f"trial {trial.number}, {trial.fault} ({trial.moment}): {problem}")
    return "\n".join(lines)


class CampaignServer:
    """The server of all trials that do not harm it; replaced when it is gone all the same.

    Args:
        log_path: file for what it prints.
    """

    def __init__(self, log_path: Path) -> None:
        self._log_path = log_path
        self._server: EmbeddedServer | None = None

    def ports(self) -> tuple[int, int]:
        """RPC and streaming port of a server that runs."""
        if self._server is None or not self._server.alive():
            self.stop()
            server = EmbeddedServer(port=allot_ports().rpc, threads=1, log_path=self._log_path)
            server.start()
            self._server = server
        port = self._server.endpoint.port
        return port, port + 1

    def stop(self) -> None:
        """End it."""
        if self._server is not None:
            self._server.stop()


def record_reference(folder: Path, ports: tuple[int, int]) -> Hashes:
    """The hashes of a run that nothing disturbs.

    Args:
        folder: for its files; must not exist.
        ports: RPC and streaming port of the campaign's server.

    Raises:
        CarStageError: it fails.
    """
    folder.mkdir()
    config = folder / "config.yaml"
    config.write_text(CONFIG, "utf-8")
    settings = remote_settings(ports)
    out, log = folder / "dataset", folder / "run.log"
    with RunCommand(config, out, settings, log, {}) as run:
        if run.wait(_REFERENCE_S) != 0:
            raise CarStageError(
                f"The run without a fault failed: {run.output[-1000:]}", f"See {log}."
            )
    return hashes_of(out)


def remote_settings(ports: tuple[int, int]) -> list[str]:
    """The ``--set`` that name the campaign's server."""
    return [f"server={{kind: remote, port: {ports[0]}, self_test: 'off'}}"]


def _line(trial: Trial, count: int) -> str:
    end = "completed" if trial.complete else "completed by the same command"
    problems = _problems(trial)
    if problems:
        end = f"WRONG: {problems[0]}"
    struck = trial.moment if trial.struck else f"{trial.moment}, too late"
    return (
        f"[{trial.number}/{count}] {trial.fault} ({struck}): {end}, "
        f"{trial.attempts} attempts, {trial.wall_s:.0f} s"
    )


def _problems(trial: Trial) -> list[str]:
    found = Counter(
        [
            *trial.unclear,
            *trial.differing,
            *trial.invalid,
            *trial.missing_rows,
            *trial.left_behind,
        ]
    )
    if not found and not trial.ok:
        found["the same command did not complete it"] = 1
    return list(found)


def _sum(trials: Sequence[Trial], what: str) -> int:
    return sum(len(getattr(trial, what)) for trial in trials)


def _duration(seconds: float) -> str:
    return str(timedelta(seconds=round(seconds)))
