"""Plays all trials against a server; finds the names of the client that no trial covers."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.server_process import running_server
from benchmarks.simulator.session import synchronous_session
from carstage.bench.verdict import Figure, Verdict
from client_api import (  # noqa: F401 - they register their trials
    actors,
    blueprints,
    clients,
    commands,
    maps,
    recordings,
    scenery,
    sensors,
    street_lights,
    traffic_lights,
    traffic_manager,
    value_types,
    vehicles,
    walkers,
    worlds,
)
from client_api.entries import Entry, Support, entries
from client_api.surface import surface
from client_api.trial_scene import TrialScene

logger = logging.getLogger(__name__)

_TIMEOUT_S = 900.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """How one trial ended: its names, and what went wrong, empty for nothing."""

    names: tuple[str, ...]
    failure: str


def untried() -> tuple[str, ...]:
    """Names of the client that no entry covers."""
    known = list(entries())
    return tuple(name for name in surface() if not any(entry.covers(name) for entry in known))


def unknown() -> tuple[str, ...]:
    """Names in entries that the client does not have."""
    have = set(surface())
    groups = {name.rpartition(".")[0] or name for name in have}
    return tuple(
        name
        for entry in entries()
        for name in entry.names
        if name not in have and name.removesuffix(".*") not in groups
    )


def play(port: int, chosen: Sequence[int]) -> list[Outcome]:
    """Play entries, by their numbers, in one client session; for a process of its own."""
    known = list(entries())
    outcomes = []
    with synchronous_session(port, delta_s=0.05, seed=7) as session:
        scene = TrialScene(session)
        for number in chosen:
            entry = known[number]
            outcomes.append(Outcome(entry.names, _tried(entry, scene)))
    return outcomes


def _tried(entry: Entry, scene: TrialScene) -> str:
    try:
        try:
            entry.act(scene)
        finally:
            scene.sweep()
    except AssertionError as error:
        return str(error)
    except Exception:  # noqa: BLE001 - the other trials go on
        return traceback.format_exc(limit=-2)
    return ""


def check_api(*, server_arguments: Sequence[str] = (), only: str = "") -> Verdict:
    """Try every name of the client.

    Args:
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
    with running_server(server_arguments) as port:
        for group in groups:
            if group:
                outcomes += run_trial(play, port, group, timeout_s=_TIMEOUT_S)
    return _verdict(outcomes)


def _verdict(outcomes: Sequence[Outcome]) -> Verdict:
    failed = [outcome for outcome in outcomes if outcome.failure]
    names = surface()
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
        Figure("names without an entry", len(untried()), "==", 0),
        Figure("entries without a name", len(unknown()), "==", 0),
        Figure("trials", len(outcomes)),
        Figure("trials that failed", len(failed), "==", 0),
    )
    notes = [f"{', '.join(o.names[:3])}: {o.failure}" for o in failed]
    notes += [f"nobody tries {name}" for name in untried()]
    notes += [f"the client has no {name}" for name in unknown()]
    return Verdict("api", figures, notes)
