"""Plays trials in the interpreter of any client wheel: ``python -m client_api.playing``.

Arguments: the server's port, a free one for the Traffic Manager, a file for the outcomes, and the
numbers of the entries. Python 3.8, the standard library and ``carla`` alone.
"""

from __future__ import annotations

import json
import os
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.simulator.session import synchronous_session
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
from client_api.entries import Entry, entries
from client_api.surface import surface
from client_api.trial_scene import TrialScene

if TYPE_CHECKING:
    from collections.abc import Sequence


def play(port: int, traffic_manager_port: int, chosen: Sequence[int]) -> list[tuple[int, str]]:
    """Play entries, by their numbers, in one client session; what went wrong with each.

    Entries of which this client has no name are left out.
    """
    known = list(entries())
    names = surface()
    outcomes = []
    with synchronous_session(
        port, delta_s=0.05, seed=7, traffic_manager_port=traffic_manager_port
    ) as session:
        scene = TrialScene(session, port)
        for number in chosen:
            if any(known[number].covers(name) for name in names):
                outcomes.append((number, _tried(known[number], scene)))
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


def main() -> None:
    """Play, and write ``{"surface": names, "outcomes": [[number, failure]]}``."""
    port, traffic_manager_port = map(int, sys.argv[1:3])
    outcomes = play(port, traffic_manager_port, [int(number) for number in sys.argv[4:]])
    told = json.dumps({"surface": surface(), "outcomes": outcomes})
    Path(sys.argv[3]).write_text(told, "utf-8")
    os._exit(0)  # clients may hang or abort where their threads end


if __name__ == "__main__":
    main()
