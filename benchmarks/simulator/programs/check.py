"""Goes through a folder of CARLA's programs and says of each whether it runs here."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from benchmarks.loopback_only import enter
from benchmarks.simulator.programs.catalogue import (
    HOME_TOWN,
    PROGRAMS,
    SMOKE_FOLDER,
    Program,
    SmokeModule,
    towns_of,
)
from benchmarks.simulator.programs.running import PORT, Outcome, Runner
from benchmarks.simulator.programs.smoke import SMOKE_PORT, run_module, smoke_modules
from benchmarks.simulator.traffic.towns import carla_maps
from carstage.bench.verdict import Figure, Verdict
from carstage.errors import BadInputError
from carstage.server import EmbeddedServer

LEAST_SMOKE_SHARE = 0.9
"""Of the cases of CARLA's smoke tests that are run."""
_START_MAP = "Stage01"


@dataclass(frozen=True, slots=True)
class Programs:
    """What was tried, and what became of it.

    Attributes:
        verdict: the counts.
        outcomes: of each program, and of each case of the smoke tests.
    """

    verdict: Verdict
    outcomes: Sequence[Outcome]

    @property
    def ok(self) -> bool:
        """Whether nothing failed that has to pass."""
        return self.verdict.ok


def check_programs(
    folder: Path,
    *,
    only: Sequence[str] = (),
    maps: Path | None = None,
    python: str = sys.executable,
    protocol: str = "0.9.16",
    seconds: float = 20.0,
    progress: Callable[[Outcome], None] = lambda outcome: None,
) -> Programs:
    """Run CARLA's examples, utilities and smoke tests as they are.

    Where this process may, it leaves the network for a namespace of its own, so that nothing can be
    fetched, and the ports that stand in the programs are free.

    Args:
        folder: ``PythonAPI`` of CARLA's sources or of a release.
        only: patterns of paths, such as ``examples/*``; none means all.
        maps: folder with OpenDRIVE files of CARLA's towns; by default those of the package that
            brings them as test data, where it is installed.
        python: interpreter with the client wheel.
        protocol: version of that wheel.
        seconds: how long a program runs that ends only when it is interrupted.
        progress: called with each outcome.

    Raises:
        BadInputError: there is nothing of CARLA's in the folder.
        ServerError: a server does not start, or its port is taken.
    """
    programs = [p for p in PROGRAMS if _wanted(p.path, only) and (folder / p.path).is_file()]
    modules = [m for m in smoke_modules(folder) if _wanted(f"{SMOKE_FOLDER}/{m.name}.py", only)]
    if not programs and not modules:
        raise BadInputError(
            f"--folder: {folder} holds none of CARLA's programs that are asked for.",
            "Give the folder PythonAPI of CARLA's sources or of a release.",
        )
    notes = []
    try:
        enter()
    except OSError as error:
        notes.append(f"the network was within reach of the programs: {error.strerror}")
    outcomes: list[Outcome] = []
    with ExitStack() as stack:
        towns = towns_of((p for p in programs if not p.lacks), modules)
        found = stack.enter_context(carla_maps(maps, towns))
        servers = _Servers(protocol, () if found is None else ("--maps", str(found)))
        if found is not None and towns:
            _bake(found, towns)
        for outcome in _all(programs, modules, Runner(folder, python, seconds), servers):
            progress(outcome)
            outcomes.append(outcome)
    if found is None and towns:
        notes.append(f"without OpenDRIVE files of {', '.join(towns)}: stand-ins instead")
    return Programs(_verdict(outcomes, programs, notes), outcomes)


def _wanted(path: str, only: Sequence[str]) -> bool:
    return not only or any(fnmatch(path, pattern) for pattern in only)


@dataclass(frozen=True, slots=True)
class _Servers:
    """Starts servers alike."""

    protocol: str
    arguments: Sequence[str]

    @contextmanager
    def running(self, port: int, town: str) -> Iterator[Path]:
        """A fresh server on a port; yields a folder that is gone when it has ended."""
        with tempfile.TemporaryDirectory(prefix="carstage-programs-") as scratch:
            server = EmbeddedServer(
                map_name=town,
                port=port,
                log_path=Path(scratch) / "server.log",
                arguments=("--protocol", self.protocol, *self.arguments),
            )
            with server:
                yield Path(scratch)


def _all(
    programs: Sequence[Program], modules: Sequence[SmokeModule], runner: Runner, servers: _Servers
) -> Iterator[Outcome]:
    for program in programs:
        if program.lacks:
            yield Outcome(program.name, "not run", f"needs {program.lacks}")
        elif not program.with_server_of:
            with servers.running(PORT, _START_MAP) as scratch:
                yield runner.run(program, scratch)
                for further in programs:
                    if further.with_server_of == program.path:
                        yield runner.run(further, scratch)
    for module in modules:
        if module.lacks:
            yield Outcome(f"{SMOKE_FOLDER}/{module.name}.py", "not run", f"needs {module.lacks}")
            continue
        with servers.running(SMOKE_PORT, HOME_TOWN) as scratch:
            yield from run_module(module, runner.folder, scratch, python=runner.python)


def _bake(maps: Path, towns: Sequence[str]) -> None:
    """Compute CARLA's towns ahead: the programs do not wait as long as that takes."""
    command = [sys.executable, "-m", "carstage_sim", "bake", "--maps", str(maps), *towns]
    subprocess.run(command, check=True, stdout=sys.stderr)


def _verdict(
    outcomes: Sequence[Outcome], programs: Sequence[Program], notes: Sequence[str]
) -> Verdict:
    names = {program.name for program in programs}
    of_programs = [outcome for outcome in outcomes if outcome.name in names]
    cases = [outcome for outcome in outcomes if outcome.name not in names]
    figures: list[Figure] = []
    if of_programs:
        figures += [
            Figure("programs_passed", _count(of_programs, "passed")),
            Figure("programs_failed", _count(of_programs, "failed"), "<=", 0),
            Figure("programs_not_run", _count(of_programs, "not run")),
        ]
    if cases:
        passed, failed = _count(cases, "passed"), _count(cases, "failed")
        share = passed / max(1, passed + failed)
        figures += [
            Figure("smoke_cases_passed", passed),
            Figure("smoke_cases_failed", failed),
            Figure("smoke_share_passed", share, ">=", LEAST_SMOKE_SHARE),
        ]
    odd = [f"{o.name}: {o.result}, {o.reason}" for o in outcomes if o.result != "passed"]
    return Verdict("programs", tuple(figures), [*notes, *odd])


def _count(outcomes: Sequence[Outcome], result: str) -> int:
    return sum(outcome.result == result for outcome in outcomes)
