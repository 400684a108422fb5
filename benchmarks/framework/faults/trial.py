"""One trial: a run, a fault, the same command again, and what is wrong afterwards."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pyarrow.parquet as pq

from benchmarks.framework.faults.command import RunCommand
from benchmarks.framework.faults.kinds import HANG_S, STEPS, Fault, KillSupervisor
from carstage.errors import CarStageError
from carstage.runs.orphans import orphans
from carstage.validation import validate_dataset

_MOMENT_S = 240.0
_END_S = 300.0
_LAST_PROCESS_S = 30.0

Hashes = Mapping[str, Mapping[str, str]]
"""Named hash by path, by episode id."""

CONFIG = f"""\
name: faults
seed: 3
episodes: 2
duration_s: {STEPS / 5}
fps: 5
vehicles: {{count: 1}}
pedestrians: {{count: 1}}
image_size: [64, 36]
timing: {{warmup_ticks: 3}}
rig:
  sensors:
    - {{id: CAM, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: LIDAR, kind: lidar, pose: {{z: 1.8}},
       attributes: {{channels: 8, points_per_second: 4000}}}}
    - {{id: IMU, kind: imu}}
conversion: {{workers: 1}}
supervision: {{hang_s: {HANG_S}}}
"""
"""Two episodes of two segments, with a camera and its two twins, a LiDAR and an IMU."""


@dataclass(slots=True)
class Trial:
    """One fault and what came of it.

    Attributes:
        number: from 1.
        fault, detail, moment: what struck when.
        struck: whether there was anything to strike before the run ended.
        exit_code: of the first run; None when it did not end by itself.
        complete: whether the first run completed.
        resumed: whether the same command again completed; None where it was not needed.
        attempts: attempts that were begun, of both runs.
        wall_s: how long all took.
        unclear, differing, invalid, missing_rows, left_behind: what is wrong, one entry each.
    """

    number: int
    fault: str
    detail: str = ""
    moment: str = ""
    struck: bool = False
    exit_code: int | None = None
    complete: bool = False
    resumed: bool | None = None
    attempts: int = 0
    wall_s: float = 0.0
    unclear: list[str] = field(default_factory=list)
    differing: list[str] = field(default_factory=list)
    invalid: list[str] = field(default_factory=list)
    missing_rows: list[str] = field(default_factory=list)
    left_behind: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Whether the run ended as it should."""
        wrong = (
            self.unclear,
            self.differing,
            self.invalid,
            self.missing_rows,
            self.left_behind,
        )
        return not any(wrong) and (self.complete or self.resumed is True)


def settings_of(fault: Fault, ports: tuple[int, int]) -> list[str]:
    """The ``--set`` of a trial's runs."""
    server = "server={kind: embedded, threads: 1}"
    if not fault.own_server:
        server = f"server={{kind: remote, host: {fault.host}, port: {ports[0]}, self_test: 'off'}}"
    return [server, f"episodes={fault.episodes}", *fault.settings]


def run_trial(
    number: int, fault: Fault, folder: Path, ports: tuple[int, int], expected: Hashes
) -> Trial:
    """Run one trial in a folder of its own.

    Args:
        number: of the trial.
        fault: what strikes.
        folder: must not exist.
        ports: RPC and streaming port of the campaign's server.
        expected: hashes of the run without a fault.
    """
    folder.mkdir(parents=True)
    config = folder / "config.yaml"
    config.write_text(CONFIG, "utf-8")
    trial = Trial(number, fault.name, moment=str(fault.moment))
    begun_s = time.monotonic()
    with ExitStack() as stack:
        out = fault.prepare(stack, folder, ports)
        arguments = (config, out, settings_of(fault, ports))
        with RunCommand(
            *arguments, folder / "first.log", fault.environment, fault.prefix, fault.run_id
        ) as run:
            if run.wait_for(fault.moment, _MOMENT_S):
                trial.struck = fault.strike(run)
            trial.exit_code = run.wait(_END_S)
            trial.detail = fault.detail
            trial.struck = trial.struck or fault.has_struck()
            trial.unclear += fault.wrong()
            _judge_end(trial, fault, run)
        if not (isinstance(fault, KillSupervisor) and fault.leaves_orphan):
            judge_processes(trial, out)
        fault.lift()
        if not trial.complete or fault.sweeps:
            with RunCommand(*arguments, folder / "second.log", {}) as again:
                resumed = again.wait(_END_S) == 0
                trial.resumed = None if trial.complete else resumed
                if not resumed:
                    trial.unclear.append(f"the same command again: {last_line(again.output)}")
            judge_processes(trial, out)
        judge_dataset(trial, out, fault.episodes, expected)
    trial.wall_s = round(time.monotonic() - begun_s, 1)
    return trial


def hashes_of(out: Path) -> Hashes:
    """The hashes in the commit markers of a dataset."""
    found = {}
    for path in sorted((out / "commits").glob("*.json")):
        marker = json.loads(path.read_bytes())
        found[path.stem] = {entry["path"]: entry["hash"] for entry in marker["files"]}
    return found


def _judge_end(trial: Trial, fault: Fault, run: RunCommand) -> None:
    """The first run is complete, or its message gives the reason."""
    code, output = trial.exit_code, run.output
    trial.complete = code == 0
    if code is None:
        trial.unclear.append(f"no end within {_END_S:.0f} s: {last_line(output)}")
    elif "Traceback" in output:
        trial.unclear.append(f"a traceback: {last_line(output)}")
    elif fault.ends_supervisor and code < 0:
        return
    elif code != 0 and not any(
        line.startswith(("Error:", "Episode ")) for line in output.splitlines()
    ):
        trial.unclear.append(f"exit code {code} without an error: {last_line(output)}")


def judge_processes(trial: Trial, out: Path) -> None:
    """Nothing that a run has started is left; its processes may need a moment to end."""
    for run in sorted((out / "runs").glob("*")):
        left = orphans(run.name, 0.0)
        _, alive = psutil.wait_procs(left, timeout=_LAST_PROCESS_S)
        for process in alive:
            trial.left_behind.append(f"{process.pid}: {_command(process)}")
            process.kill()


def judge_dataset(trial: Trial, out: Path, episodes: int, expected: Hashes) -> None:
    """Every episode is there with equal bytes, valid, and nothing else is left."""
    found, committed = hashes_of(out), _committed(out)
    if len(found) != episodes:
        trial.differing.append(f"{len(found)} of {episodes} episodes are committed")
    for episode, files in found.items():
        reference = expected.get(episode, {})
        trial.differing += [
            f"{episode}/{path}"
            for path in sorted({*files, *reference})
            if files.get(path) != reference.get(path)
        ]
        ledger = out / "episodes" / episode / committed[episode] / "frames.parquet"
        rows = pq.read_metadata(ledger).num_rows
        if rows != STEPS:
            trial.missing_rows.append(f"{episode}: {rows} of {STEPS}")
    try:
        report = validate_dataset(out)
    except CarStageError as error:
        trial.invalid.append(str(error))
    else:
        trial.invalid += [] if report.ok else [str(problem) for problem in report.problems]
    for status in sorted((out / "runs").glob("*/status.json")):
        document: dict[str, Any] = json.loads(status.read_bytes())
        if document["state"] not in ("done", "failed", "interrupted"):
            trial.left_behind.append(f"{status.parent.name} is still {document['state']}")
        raw = status.parent / "raw"
        trial.left_behind += [str(path) for path in raw.rglob("*") if path.is_file()]
    trial.left_behind += [
        str(path.relative_to(out))
        for path in sorted(out.glob("episodes/*/*"))
        if committed.get(path.parent.name) != path.name
    ]
    trial.attempts = sum(
        path.read_bytes().count(b'"attempt_reserved"') for path in out.glob("runs/*/events.jsonl")
    )


def _committed(out: Path) -> dict[str, str]:
    """The attempt that is committed, by episode id."""
    return {
        path.stem: json.loads(path.read_bytes())["attempt"]
        for path in (out / "commits").glob("*.json")
    }


def _command(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())[-200:]
    except psutil.Error:
        return "?"


def last_line(output: str) -> str:
    """The last line of an output that says something."""
    lines = [line for line in output.splitlines() if line.strip()]
    return lines[-1][:300] if lines else "nothing was printed"
