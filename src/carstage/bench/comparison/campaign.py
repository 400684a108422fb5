"""All runs of a comparison, one after the other; each result is kept as soon as it is there."""

from __future__ import annotations

import dataclasses
import json
import math
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from carstage.bench.calibration import slowness
from carstage.bench.comparison.machine import describe_machine
from carstage.bench.comparison.presets import Experiment, Preset
from carstage.bench.comparison.programs import CARSTAGE, PROGRAMS
from carstage.bench.comparison.running import Workplace
from carstage.bench.comparison.trials import (
    LOOP,
    Key,
    Trial,
    TrialResult,
    estimate_s,
    plan_trials,
)
from carstage.config import check_config
from carstage.errors import BadInputError, CollectorError
from carstage.runs.servers import ServerSetup
from carstage.server import EmbeddedServer, Endpoint, RemoteServer, Server, allot_ports

TRIALS_FILE = "trials.jsonl"
NOISE = 4.0
"""Standard deviation of what is added to pictures: drawn ones are smoother than a camera's."""
PACE_HZ = 10.0
_FORMAT = 2

Progress = Callable[[int, int], None]


class Campaign:
    """The runs of a preset, and what is known of them.

    Args:
        preset: how much is measured.
        experiments: which.
        out: folder of results; those of an earlier, broken-off campaign are gone on with.
        programs: names of those that are compared; None: all.
        server: host and port of a server that runs already; None starts the embedded simulator
            with frames that repeat.
        scratch: folder for what programs write, on the disk to be measured; default: ``out``.

    Raises:
        BadInputError: ``out`` holds results of another campaign, or there is no such program.
    """

    def __init__(
        self,
        preset: Preset,
        experiments: Iterable[Experiment],
        out: Path,
        *,
        programs: Collection[str] | None = None,
        server: tuple[str, int] | None = None,
        scratch: Path | None = None,
    ) -> None:
        self.preset = preset
        self._out = out
        self._given = server
        out.mkdir(parents=True, exist_ok=True)
        self._scratch = scratch or out
        unknown = sorted(set(programs or ()) - set(PROGRAMS))
        if unknown:
            raise BadInputError(
                f"There is no program {unknown[0]!r}.", f"Choose from {', '.join(PROGRAMS)}."
            )
        planned = plan_trials(preset, experiments)
        self.trials = [one for one in planned if not programs or one.program in programs]
        self.results: dict[Key, tuple[Trial, TrialResult]] = {}
        self.left_out: dict[str, str] = {}
        """Programs that cannot run here, or not with labels, and why."""
        self._lacking: dict[tuple[str, bool], list[str]] = {}
        self.machine = self._read()

    @property
    def left(self) -> list[Trial]:
        """Runs that have no result yet, in their order."""
        return [trial for trial in self.trials if trial.key not in self.results]

    @property
    def estimate_s(self) -> float:
        """Rough seconds that the rest takes on this machine."""
        return estimate_s(self.left, self.preset) * max(1.0, float(self.machine["slowness"]))

    def run(
        self, progress: Progress = lambda done, total: None, minutes: float | None = None
    ) -> None:
        """Make what is left.

        Args:
            progress: called with the runs done and their total number.
            minutes: begin no further run after that time; None: make all.

        Raises:
            CollectorError: a program failed; the same command goes on with it.
        """
        end_s = math.inf if minutes is None else time.monotonic() + 60.0 * minutes
        for paced in (False, True):
            todo = [trial for trial in self.left if (trial.experiment == "totals") == paced]
            if not todo or time.monotonic() > end_s:
                continue
            with self._workplace(paced) as workplace:
                todo = [trial for trial in todo if not self._is_left_out(trial, workplace.python)]
                for trial in _warm_up(todo):
                    workplace.run(dataclasses.replace(trial, frames=2), look=False)
                for trial in todo:
                    if time.monotonic() > end_s:
                        break
                    self._keep(trial, _second_chance(workplace, trial))
                    progress(len(self.results), len(self.trials))

    def _is_left_out(self, trial: Trial, python: str) -> bool:
        """Whether the client's Python lacks what a program needs."""
        name, key = trial.program, (trial.program, trial.labels)
        if key not in self._lacking:
            lacks = self._lacking[key] = PROGRAMS[name].lacks(python, trial.labels)
            if lacks:
                self.left_out[name] = (
                    f"{python}, the client's Python, has no {', '.join(lacks)}; install it there "
                    "and give the same command again"
                )
        return bool(self._lacking[key])

    @contextmanager
    def _workplace(self, paced: bool) -> Iterator[Workplace]:
        with ExitStack() as stack:
            endpoint = stack.enter_context(self._server(paced)).endpoint
            config = check_config({"server": _remote(endpoint), "rig": {"sensors": [_ANY]}})
            setup = ServerSetup(config)
            with setup.facts() as facts:
                yield Workplace(endpoint, facts, str(setup.client.path), self.preset, self._scratch)

    def _server(self, paced: bool) -> Server:
        if self._given is not None:
            return RemoteServer(*self._given)
        arguments = ["--loop", str(LOOP), "--loop-noise", str(NOISE)]
        arguments += ["--protocol", self.preset.carla_version]
        if paced:
            # Ten frames per second are meant for the machine that targets were written for.
            arguments += ["--pace", f"{PACE_HZ / max(1.0, slowness()):.3f}"]
        return EmbeddedServer(port=allot_ports().rpc, arguments=arguments)

    def _keep(self, trial: Trial, result: TrialResult) -> None:
        self.results[trial.key] = trial, result
        row = {**dataclasses.asdict(trial), "result": dataclasses.asdict(result)}
        with (self._out / TRIALS_FILE).open("a", encoding="utf-8") as file:
            file.write(json.dumps(row, allow_nan=True) + "\n")

    def _read(self) -> dict[str, Any]:
        """The machine of an earlier campaign with its results, or this one's, written first."""
        path = self._out / TRIALS_FILE
        preset = dataclasses.asdict(dataclasses.replace(self.preset, repeats=0))
        if not path.exists():
            machine = describe_machine(self._scratch)
            head = {"format": _FORMAT, "preset": preset, "machine": machine}
            path.write_text(json.dumps(head) + "\n", "utf-8")
            return machine
        first, *rows = _lines(path)
        if first.get("format") != _FORMAT or first["preset"] != json.loads(json.dumps(preset)):
            raise BadInputError(
                f"{path} holds results of another comparison.", "Choose another --out."
            )
        planned = {trial.key: trial for trial in self.trials}
        for row in rows:
            result = TrialResult(**row.pop("result"))
            trial = Trial(**row)
            if planned.get(trial.key) == trial:
                self.results[trial.key] = trial, result
        machine = first["machine"]
        assert isinstance(machine, dict)
        return machine


def _warm_up(todo: list[Trial]) -> list[Trial]:
    """Runs whose first one would pay for others: files that are read, kernels that are compiled.

    Car-STAGE alone compiles any, for its encoders and labels; most of them in the first experiment.
    """
    first: dict[str, Trial] = {}
    for trial in todo:
        first.setdefault(CARSTAGE if trial.program == CARSTAGE else "", trial)
    return list(first.values())


def _second_chance(workplace: Workplace, trial: Trial) -> TrialResult:
    """A run, made once more if it failed: clients sometimes abort while they end.

    The result of a second run is marked: ``failed_before`` in what was found.

    Raises:
        CollectorError: it failed twice; the cause is how it failed first.
    """
    look = trial.repeat == 0
    try:
        return workplace.run(trial, look=look)
    except CollectorError as first:
        try:
            result = workplace.run(trial, look=look)
        except CollectorError as second:
            raise second from first
    return dataclasses.replace(result, found={**result.found, "failed_before": 1.0})


def _lines(path: Path) -> list[dict[str, Any]]:
    """The rows of a file; a torn last one is cut off, so that the next begins a line."""
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        path.write_bytes(whole)
    return [json.loads(line) for line in whole.splitlines()]


_ANY = {"id": "IMU", "kind": "imu"}


def _remote(endpoint: Endpoint) -> dict[str, Any]:
    return {
        "kind": "remote",
        "host": endpoint.host,
        "port": endpoint.port,
        "self_test": "off",
    }
