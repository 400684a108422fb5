"""Plays all trials against a server, with any client wheel; finds names that no trial covers."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.simulator.client_process import TrialError
from benchmarks.simulator.server_process import running_server
from carstage.bench.verdict import Figure, Verdict
from carstage.releases import KNOWN
from carstage.server import free_port
from client_api import playing  # noqa: F401 - the trials register themselves
from client_api.entries import Support, entries
from client_api.since import UNTIL
from client_api.surface import surface

_TIMEOUT_S = 900.0
_ROOT = Path(__file__).parents[3]
_PATH = (_ROOT / "src", _ROOT, _ROOT / "tests" / "conformance")
NEWEST = str(KNOWN[-1])


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one trial ended: its names, and what went wrong, empty for nothing."""

    names: tuple[str, ...]
    failure: str


def untried(names: Sequence[str] | None = None) -> tuple[str, ...]:
    """Names of the client that no entry covers; of the newest client if none are given."""
    known = list(entries())
    asked = surface() if names is None else names
    return tuple(name for name in asked if not any(entry.covers(name) for entry in known))


def unknown() -> tuple[str, ...]:
    """Names in entries that neither the newest client has nor, by ``UNTIL``, an older one."""
    have = {*surface(), *(name for gone in UNTIL.values() for name in gone)}
    groups = {name.rpartition(".")[0] or name for name in have}
    return tuple(
        name
        for entry in entries()
        for name in entry.names
        if name not in have and name.removesuffix(".*") not in groups
    )


def check_api(
    *,
    version: str = NEWEST,
    python: Path = Path(sys.executable),
    server_arguments: Sequence[str] = (),
    only: str = "",
) -> Verdict:
    """Try every name of a client.

    Args:
        version: of the client, and of the protocol that the server speaks to it.
        python: the interpreter that has the client's wheel.
        server_arguments: further arguments of the server.
        only: part of the names whose trials are played; all without it.

    Raises:
        ServerError: the server did not start.
        TrialError: a client process died.
    """
    known = list(entries())
    chosen = [k for k, e in enumerate(known) if not only or any(only in name for name in e.names)]
    # What replaces the episode or the Traffic Manager runs last, each in a process of its own: what
    # others hold would not outlive it.
    together = [k for k in chosen if not known[k].own_process]
    groups = [together, *([k] for k in chosen if known[k].own_process)]
    outcomes: list[Outcome] = []
    names: Sequence[str] = ()
    with running_server(("--protocol", version, *server_arguments)) as port:
        for group in filter(None, groups):
            names, played = _played(python, port, group)
            outcomes += [Outcome(known[number].names, failure) for number, failure in played]
    return _verdict(outcomes, names, len(chosen))


def _played(
    python: Path, port: int, chosen: Sequence[int]
) -> tuple[Sequence[str], Sequence[tuple[int, str]]]:
    """Play entries in a process of their own: the client's names, each entry's failure."""
    with tempfile.TemporaryDirectory(prefix="carstage-check-") as home:
        told = Path(home) / "told.json"
        arguments = [str(port), str(free_port()), str(told), *map(str, chosen)]
        try:
            ended = subprocess.run(
                [str(python), "-m", "client_api.playing", *arguments],
                # An empty home folder, so that the client's navigation cache cannot be stale.
                env={**os.environ, "HOME": home, "PYTHONPATH": os.pathsep.join(map(str, _PATH))},
                capture_output=True,
                text=True,
                errors="replace",
                timeout=_TIMEOUT_S,
            )
        except subprocess.TimeoutExpired as error:
            raise TrialError(f"the trials did not end within {_TIMEOUT_S:.0f} s") from error
        if not told.exists():
            last = "\n".join(ended.stderr.splitlines()[-20:])
            raise TrialError(f"the client process ended with {ended.returncode}:\n{last}")
        document = json.loads(told.read_text("utf-8"))
        return document["surface"], [(int(k), str(f)) for k, f in document["outcomes"]]


def _verdict(outcomes: Sequence[Outcome], names: Sequence[str], asked: int) -> Verdict:
    failed = [outcome for outcome in outcomes if outcome.failure]
    by_support = {
        support: sum(
            any(entry.covers(name) for entry in entries() if entry.support is support)
            for name in names
        )
        for support in Support
    }
    figures = (
        Figure("names of the client", len(names)),
        *(Figure(support.value, count) for support, count in by_support.items()),
        Figure("names without an entry", len(untried(names)), "==", 0),
        Figure("entries without a name", len(unknown()), "==", 0),
        Figure("trials", len(outcomes)),
        Figure("trials not in this wheel", asked - len(outcomes)),
        Figure("trials that failed", len(failed), "==", 0),
    )
    notes = [f"{', '.join(o.names[:3])}: {o.failure}" for o in failed]
    notes += [f"nobody tries {name}" for name in untried(names)]
    notes += [f"no client has {name}" for name in unknown()]
    return Verdict("api", figures, notes)
